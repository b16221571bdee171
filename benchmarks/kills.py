"""Real commands ended by `kill -9` while their results get their places: what is left?

    python benchmarks/kills.py [--every N]        at every Nth call that changes the disk; 1

Each long task is computed once, in a folder with the results of an identification. A copy of the
process then writes what was found, and ends at the first such call; the next copy at the second,
and so on. An export, a survey and a station are done anew each time; of the latter two the results
are looked at, beside which an earlier page may stand until theirs is drawn. Left may be the earlier
files whole, or the new ones, to the bit: the counts of both go to kills.json, and the exit code
says whether anything else was.
"""

import argparse
import contextlib
import functools
import io
import itertools
import os
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from unittest import mock

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy is imported

import tractexp

tractexp.__version__  # noqa: B018

from run_machine import ended_at  # noqa: E402

from tractexp.__main__ import main as command  # noqa: E402
from tractexp.api.job import Job  # noqa: E402
from tractexp.storage import files  # noqa: E402
from tractexp.storage.run_folder import LOCK, settle  # noqa: E402

ALWAYS = ("tracking.enabled=false", "hydra.run.dir=run")
IDENTIFY = ("optimizer=multistart_least_squares", "budget=200", *ALWAYS)
EFFECTS = "task.effects=[stator_resistance]"
SEARCH = "optimizer=multistart_least_squares"
# tasks whose results are written at their end
LONG = {
    "discrepancy": (EFFECTS,),
    "profile": (SEARCH, "budget=200", "task.points=3"),
    "plan": (),
    "posterior": (SEARCH, "budget=200", "task.steps=100", "task.walkers=16"),
    "linear_network": (),
}
FOLDERS = ("survey", "station")  # tasks that keep what they found of each file of a folder
RESULTS = (".json", ".csv")  # of these, beside what is kept; their page is drawn afterwards
EXPORT = ("task=export", "task.format=modelica", *ALWAYS)
EARLIER, NEWER = "the earlier, whole", "the newer, whole"
State = dict[str, bytes]


def run(*arguments: str) -> None:
    """Run a command in this process, silently; raises `SystemExit` where it fails."""
    with (
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(io.StringIO()) as told,
    ):
        code = command(arguments)
    if code:
        raise SystemExit(told.getvalue())


def read_state(folder: Path) -> State:
    """{path: content} of what the next command that looks at a folder finds there."""
    with tempfile.TemporaryDirectory() as place:
        copy = shutil.copytree(folder, Path(place, "copy"))
        (copy / LOCK).unlink(missing_ok=True)  # its holder has ended
        settle(copy)
        return {
            path.relative_to(copy).as_posix(): path.read_bytes()
            for path in sorted(copy.rglob("*"))
            if path.is_file() and ".tractexp." not in str(path.relative_to(copy))
        }


def kill_each(do: Callable[[], object], folder: Path, every: int) -> Iterator[State]:
    """What is left of a folder by a copy of this process that is ended while it does something: at
    each call that changes the disk, until it comes to its end.
    """
    with tempfile.TemporaryDirectory() as place:
        before = shutil.copytree(folder, Path(place, "before"))
        for moment in itertools.count(1, every):
            if not (child := os.fork()):
                with contextlib.suppress(BaseException), ended_at(moment, lambda: os._exit(9)):
                    do()
                os._exit(0)
            _, code = os.waitpid(child, 0)
            if code:
                yield read_state(folder)
            shutil.rmtree(folder)
            shutil.copytree(before, folder)
            if not code:
                return


def kill_long_task(task: str, every: int) -> Counter[str]:
    """How often which files were left of those of an identification and a longer task."""
    run(*IDENTIFY)
    folder, left = Path("run").absolute(), []
    earlier, write = read_state(folder), Job.write

    def write_and_end(job, results, track):
        left.extend(kill_each(lambda: write(job, results, track), folder, every))
        paths = write(job, results, track)
        left.append(read_state(folder))  # the last one: that of nobody who was ended
        return paths

    with mock.patch.object(Job, "write", write_and_end):
        run(f"task={task}", "data=tibet_30pct", *LONG[task], *ALWAYS)
    return count(left[:-1], earlier, left[-1])


def kill_folder_task(task: str, every: int) -> Counter[str]:
    """How often which results were left of a folder of two records, and of three."""
    tractexp.examples("records")
    last = Path("records", "dip3.cfg")
    parts = sorted(Path("records").glob(f"{last.stem}.*"))
    Path("kept").mkdir()
    for part in parts:
        part.rename(Path("kept", part.name))
    folder = Path("run")
    command = (f"task={task}", "data.path=records", "task.cores=1", *ALWAYS)
    run(*command)
    earlier = _select_results(read_state(folder))
    for part in parts:
        Path("kept", part.name).rename(part)
    states = kill_each(lambda: run(*command), folder, every)
    left = [_select_results(state) for state in states]
    run(*command)
    return count(left, earlier, _select_results(read_state(folder)))


def _select_results(state: State) -> State:
    """The files at the top of a folder that hold what a task came to."""
    return {path: content for path, content in state.items() if _is_result(path)}


def _is_result(path: str) -> bool:
    return "/" not in path and path.endswith(RESULTS)


def kill_export(every: int) -> Counter[str]:
    """How often which file was left of two exports, of the estimates of two seeds."""
    for seed in (1, 2):
        run(*IDENTIFY, f"seed={seed}", "model.fixed.q_v=3" if seed == 2 else "seed=1")
        shutil.copytree("run", f"fit{seed}")
        shutil.rmtree("run")
    run(*EXPORT, "task.parameters=fit1")
    folder = Path("run")
    newer = (*EXPORT, "task.parameters=fit2")
    earlier = read_state(folder)["load.mo"]
    left = [state["load.mo"] for state in kill_each(lambda: run(*newer), folder, every)]
    run(*newer)  # the same bits, whoever was ended before
    names = ({"load.mo": content} for content in left)
    return count(names, {"load.mo": earlier}, {"load.mo": read_state(folder)["load.mo"]})


def count(states, earlier: State, newer: State) -> Counter[str]:
    """How many states are the earlier and the newer one; others by what differs from both."""
    assert earlier != newer
    names = {EARLIER: earlier, NEWER: newer}
    counts: Counter[str] = Counter()
    for state in states:
        whole = [name for name, one in names.items() if state == one]
        odd = {k for k in state.keys() | newer.keys() if state.get(k) != newer.get(k)}
        counts[whole[0] if whole else f"neither: {', '.join(sorted(odd))}"] += 1
    return counts


def perform(every: int) -> dict[str, Counter[str]]:
    """The counts of each command, in a folder that goes."""
    found = {}
    for name, kill in KILLS.items():
        with tempfile.TemporaryDirectory() as place, contextlib.chdir(place):
            found[name] = kill(every)
            print(name, found[name], flush=True)
    return found


KILLS: dict[str, Callable[[int], Counter[str]]] = {
    **{task: functools.partial(kill_long_task, task) for task in LONG},
    **{task: functools.partial(kill_folder_task, task) for task in FOLDERS},
    "export": kill_export,
}


if __name__ == "__main__":
    asked = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    asked.add_argument("--every", type=int, default=1)
    counts = perform(asked.parse_args().every)
    files.write_json(Path(__file__).with_suffix(".json"), counts)
    sys.exit(any(name.startswith("neither") for one in counts.values() for name in one))
