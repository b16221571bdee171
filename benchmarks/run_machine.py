"""A machine of states for the folder of a run: runs, kills, full disks, second runs, `again`,
`sync` and exports.

Hypothesis chooses what comes next, from every state that comes about; what must hold is looked at
after each step. The search of a run is left out, which these say nothing of: its files are written,
its folder is taken and given, its settings read back and its run logged by the code of the package.
A directory stands for the MLflow store.

    python benchmarks/run_machine.py [MINUTES]        a long one; the short one is a test

Its statistics go to run_machine.json.
"""

import collections
import contextlib
import errno
import io
import itertools
import json
import os
import shutil
import sys
import tempfile
import time
import uuid
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import pytest
import yaml
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    rule,
    run_state_machine_as_test,
)

from tractexp import tracking
from tractexp.api.job import Job
from tractexp.cli.again import build_repeat_command
from tractexp.errors import UserError
from tractexp.storage import files
from tractexp.storage.run_folder import CONFIGURATION, GOES, LOCK, NEXT, WHOLE, run_folder
from tractexp.tracking import TrackedRun, runfile, sync

# of `os`: each changes what is on the disk
CALLS = ("replace", "mkdir", "unlink", "rmdir", "open", "fsync")
URI = "sqlite:////nowhere/mlflow.db"
SEEDS, MOMENTS = st.integers(1, 4), st.integers(1, 120)
COUNTS: collections.Counter[str] = collections.Counter()
STATES: set[tuple[bool, ...]] = set()


def result_of(seed: int) -> str:
    """What a run of a seed leaves, the same bits each time; one of four has no history."""
    return json.dumps({"seed": seed, "parameters": {"C": seed / 7}})


def write(seed: int):
    def results(folder: Path) -> list[Path]:
        paths = [files.write(folder / "result.json", result_of(seed))]
        return paths + (
            [files.write(folder / "history.csv", f"seed {seed}\n")] if seed != 4 else []
        )

    return results


def configuration_of(folder: Path, seed: int) -> dict[str, str]:
    runtime = {"cwd": str(folder.parent), "config_sources": []}
    overrides = yaml.safe_dump(["optimizer=pso", f"seed={seed}"])
    return {
        "hydra.yaml": yaml.safe_dump({"hydra": {"runtime": runtime}}),
        "overrides.yaml": overrides,
    }


class Shelf:
    """A store: a folder with a file for each run that was logged, of which a killed writer leaves
    none.
    """

    def __init__(self, folder: Path):
        self.folder = folder

    def runs(self) -> dict[str, dict]:
        return {path.stem: json.loads(path.read_text()) for path in self.folder.glob("*.json")}

    def log(self, run: TrackedRun, uri: str, *, again: bool = False) -> str:
        for run_id, content in self.runs().items():
            if again and content["key"] == run.key:
                return run_id
        run_id = uuid.uuid4().hex
        files.write(self.folder / f"{run_id}.json", json.dumps({"key": run.key, "name": run.name}))
        return run_id

    def run_of(self, client: object, uri: str, run_id: str) -> object:
        if (content := self.runs().get(run_id)) is None:
            return None
        info = SimpleNamespace(
            run_id=run_id, status="FINISHED", lifecycle_stage="active", run_name=content["name"]
        )
        return SimpleNamespace(
            info=info, data=SimpleNamespace(tags={"tractexp.key": content["key"]})
        )


@contextlib.contextmanager
def ended_at(moment: int, end):
    """Let the call of this number that changes the disk end by `end`."""
    numbers = itertools.count(1)
    with contextlib.ExitStack() as stack:
        for name in CALLS:
            stack.enter_context(
                mock.patch.object(os, name, counted(getattr(os, name), numbers, moment, end))
            )
        yield


def counted(usual, numbers, moment: int, end):
    """A call that does as usual, but for the one whose number has come."""

    def call(*arguments, **more):
        if next(numbers) == moment:
            end()
        return usual(*arguments, **more)

    return call


class RunMachine(RuleBasedStateMachine):
    """`newest` are the seeds of which the whole run in the folder may be: several where a process
    was ended.
    """

    def __init__(self):
        super().__init__()
        self.root = Path(tempfile.mkdtemp())
        self.folder, self.shelf = self.root / "run", Shelf(self.root / "store")
        self.shelf.folder.mkdir()
        self.newest: set[int | None] = {None}
        self.here = Path.cwd()

    def teardown(self):
        os.chdir(self.here)
        shutil.rmtree(self.root, ignore_errors=True)

    # What is done

    def perform(self, seed: int) -> None:
        def track(paths: list[Path]) -> TrackedRun:
            return TrackedRun("e", str(seed), artifacts=paths)

        with (
            run_folder(self.folder, configuration_of(self.folder, seed), frozenset()) as place,
            mock.patch.object(tracking, "log", self.shelf.log),
            contextlib.redirect_stdout(io.StringIO()),
        ):
            config = {"tracking": {"enabled": True, "uri": URI}}
            job = Job(config, {}, self.folder, placed=place.place)
            job.send(track(job.write(write(seed), track)))

    @initialize(seed=st.none() | SEEDS)
    def begin(self, seed):
        """Fresh, or with an earlier run."""
        if seed is not None:
            self.run(seed)

    @rule(seed=SEEDS)
    def run(self, seed):
        COUNTS["run"] += 1
        self.perform(seed)
        self.newest = {seed}
        assert (self.folder / "result.json").read_text() == result_of(seed)

    @rule(seed=SEEDS, moment=MOMENTS)
    def run_and_kill(self, seed, moment):
        if not (child := os.fork()):
            with contextlib.suppress(BaseException), ended_at(moment, lambda: os._exit(9)):
                self.perform(seed)
            os._exit(0)
        _, code = os.waitpid(child, 0)
        COUNTS["killed" if code else "run, the kill came too late"] += 1
        self.newest = self.newest | {seed} if code else {seed}

    @rule(seed=SEEDS, moment=MOMENTS)
    def run_on_a_full_disk(self, seed, moment):
        def full():
            COUNTS["disk full"] += 1
            raise OSError(errno.ENOSPC, "No space left on device")

        with contextlib.suppress(UserError, OSError), ended_at(moment, full):
            self.perform(seed)
        self.newest |= {seed}

    @rule(seed=SEEDS)
    def run_beside_another(self, seed):
        COUNTS["second run"] += 1
        held = run_folder(self.folder, configuration_of(self.folder, seed), frozenset())
        with held, pytest.raises(UserError, match=f"in use by process {os.getpid()}"):
            self.perform(seed)

    @rule(seed=SEEDS)
    def run_and_refuse(self, seed):
        COUNTS["refused"] += 1
        with (
            contextlib.suppress(UserError),
            run_folder(self.folder, configuration_of(self.folder, seed), frozenset()),
        ):
            raise UserError("a wrong setting")

    @rule()
    def export(self):
        """A task that writes files for others, and no result."""
        COUNTS["export"] += 1
        with run_folder(self.folder, configuration_of(self.folder, 9), frozenset()) as place:
            files.write(self.folder / "load.mo", "model")
            place.conclude()

    @rule()
    def again(self):
        if not (self.folder / "result.json").exists() and not (self.folder / WHOLE).exists():
            return
        COUNTS["again"] += 1
        with contextlib.redirect_stdout(io.StringIO()):
            arguments = build_repeat_command([str(self.folder)])
        os.chdir(self.here)
        assert arguments == ["optimizer=pso", f"seed={self.seed()}"]

    @rule()
    def sync(self):
        COUNTS["sync"] += 1
        stand_ins = {
            "open_store": lambda uri: None,
            "run_of": self.shelf.run_of,
            "log": self.shelf.log,
        }
        with mock.patch.multiple(sync, **stand_ins):
            counts = sync.sync(self.root)
        assert counts[sync.NOT] == 0
        one = runfile.read(self.folder)
        assert (one is not None) == (self.folder / "result.json").exists()
        if one is not None:  # a whole result is in the store, whatever ended its run
            keys = [content["key"] for content in self.shelf.runs().values()]
            assert keys.count(one.run.key) == 1
            assert one.run.name == str(self.seed())

    # What holds

    def seed(self) -> int:
        return json.loads((self.folder / "result.json").read_text())["seed"]

    @invariant()
    def a_whole_result_fits_its_configuration(self):
        STATES.add(self.state())
        # a newer one is whole: it has its places at the next look
        if (self.folder / WHOLE / GOES).exists():
            assert (self.folder / WHOLE / "result.json").exists() or (
                self.folder / "result.json"
            ).exists()
            return
        if not (self.folder / "result.json").exists():
            assert None in self.newest
            return
        seed = self.seed()
        assert seed in self.newest
        assert (self.folder / "result.json").read_text() == result_of(seed)
        assert (self.folder / "history.csv").exists() == (seed != 4)
        told = yaml.safe_load((self.folder / CONFIGURATION / "overrides.yaml").read_text())
        assert told == ["optimizer=pso", f"seed={seed}"]

    @invariant()
    def no_run_is_in_the_store_twice(self):
        keys = [content["key"] for content in self.shelf.runs().values()]
        assert len(keys) == len({*keys})

    def state(self) -> tuple[bool, ...]:
        names = {path.name for path in self.folder.iterdir()} if self.folder.is_dir() else set()
        kept = json.loads((self.folder / runfile.FILE).read_text()) if runfile.FILE in names else {}
        on_the_way = any(name.startswith(f"{NEXT}.") and name != LOCK for name in names)
        return (
            "result.json" in names,
            CONFIGURATION in names,
            WHOLE in names,
            on_the_way,
            LOCK in names,
            bool(kept),
            bool(kept.get("run_id")),
            "load.mo" in names,
        )


RunMachine.TestCase.settings = settings(deadline=None)
SHORT = settings(
    max_examples=40,
    stateful_step_count=12,
    deadline=None,
    suppress_health_check=[*HealthCheck],
    database=None,
    derandomize=True,
)


def main(minutes: float) -> None:
    """Runs of 60 steps until the time is over; writes and prints what was done and how many states
    came about. What does not hold is raised, with the steps that lead there.
    """
    until = time.monotonic() + 60 * minutes
    rounds = 0
    long = replace_settings(max_examples=20, stateful_step_count=60)
    while time.monotonic() < until:
        run_state_machine_as_test(RunMachine, settings=long)
        rounds += 1
    steps = sum(COUNTS.values())
    content = {"walks": 20 * rounds, "steps": steps, "states": len(STATES), "counts": COUNTS}
    files.write_json(Path(__file__).with_suffix(".json"), content)
    print(f"{rounds} rounds, {steps} steps, {len(STATES)} states")
    for name, count in COUNTS.most_common():
        print(f"  {count:>6}  {name}")


def replace_settings(**more) -> settings:
    return settings(SHORT, derandomize=False, **more)


if __name__ == "__main__":
    main(float(sys.argv[1]) if sys.argv[1:] else 10.0)
