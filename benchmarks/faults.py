"""What is lost when something fails: `python benchmarks/faults.py [--part jobs,logging,...] [--seed
1]`.

Faults are injected into small searches, their logging, sweeps and an investigation: kills at a
chosen write of a file or statement of the database or at a random moment, disks that are full from
a chosen write on or really are (a small tmpfs, where it may be mounted), stores that are away,
locked, cut short or of another version, signals, folders and homes that cannot be written, a cache
that several share, umasks and other ways to start Python. Then the command is repeated, or `sync`
and `doctor` are called, as the program itself says. Of each fault faults.json tells what was
observed. Nothing may be lost: files are whole, results are the same as without the fault, every run
is in the store once and finished, none says it is running, and no user reads a traceback. The exit
code says whether that holds.
"""

import argparse
import contextlib
import errno
import io
import json
import operator
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy is imported

import tractexp

tractexp.__version__  # noqa: B018

from tractexp.storage import files  # noqa: E402

STORED = Path(__file__).with_name("faults.json")
SEARCH = ("optimizer=pso", "optimizer.population=20", "budget=200")
SWEEP = ("-m", *SEARCH, "seed=range(0,4)", "hydra.sweep.dir=sweep", "hydra.launcher.n_jobs=2")
# files of a search; which of them is the result, after the three of its configuration
WRITTEN, RESULT = 8, 4
# kills of workers, of all; kB of a disk that is too small
WORKERS, MACHINES, DISKS = 5, 10, (40, 400, 1100)
MOMENTS, STATEMENTS = 16, 18  # kills of a search at any moment; of what logs, at a statement
SHARING = 6  # commands that begin at once on one cache
FULL = OSError(errno.ENOSPC, "No space left on device")


class Fault(dict):
    """One fault and what was observed; `lost` says whether anything was."""


def told(fault: str, observed: str, *problems: str) -> Fault:
    """A fault; `problems` are what should not be, "" for each that is not."""
    wrong = [problem for problem in problems if problem]
    return Fault(fault=fault, observed="; ".join([observed, *wrong]), lost=bool(wrong))


# Jobs in a process of their own, forked from this one, where everything is imported


def forked(
    act: Callable[[], int | None],
    kill_after: float | None = None,
    way: int = signal.SIGKILL,
    once: str = "",
) -> tuple[int, str]:
    """Run in a copy of this process; the exit code (of a signal negative) and what was printed.

    The signal is sent so many seconds after `once` was printed.
    """
    with tempfile.TemporaryFile() as said:
        sys.stdout.flush()
        child = os.fork()
        if child == 0:
            os.dup2(said.fileno(), 1)
            os.dup2(said.fileno(), 2)
            sys.stdout, sys.stderr = (
                io.TextIOWrapper(os.fdopen(k, "wb", 0), write_through=True) for k in (1, 2)
            )
            warnings.simplefilter("default")  # as users have it, whatever the tests set
            # which a shell's background jobs ignore
            signal.signal(signal.SIGINT, signal.default_int_handler)
            code = 1
            try:
                code = operator.index(act() or 0)
            except BaseException:
                import traceback

                traceback.print_exc()
            finally:  # whatever happens: two would go on here
                os._exit(code)
        if kill_after is not None:
            while runs(child) and once and once.encode() not in os.pread(said.fileno(), 100_000, 0):
                time.sleep(0.05)
            time.sleep(kill_after)
            os.kill(child, way)
        _, status = os.waitpid(child, 0)
        said.seek(0)
        code = -os.WTERMSIG(status) if os.WIFSIGNALED(status) else os.WEXITSTATUS(status)
        return code, said.read().decode(errors="replace")


def runs(child: int) -> bool:
    return os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None


def command(folder: Path, *arguments: str) -> int:
    """The command line, within this process; MLflow, which is imported here, is used here."""
    from tractexp import tracking
    from tractexp.__main__ import main
    from tractexp.tracking import process

    class Here:
        def __init__(self, uri: str):
            self.uri = uri

        def log(self, run):
            return tracking.log(run, self.uri)

    process.start_ahead, process.open_logger = lambda: None, Here
    os.chdir(folder)
    sys.argv = ["tractexp", *arguments]
    return main()


def nth_write(n: int, fails: Callable[[], None], for_good: bool) -> None:
    """Let the nth file that gets its name fail, and where it is `for_good` every later one.

    A file that is whole already takes its place in another folder on a full disk, too.
    """
    replace, count = os.replace, 0

    def counted(*paths):
        nonlocal count
        if not str(paths[0]).endswith(files.PART):
            return replace(*paths)
        count += 1
        if count == n or (for_good and count > n):
            fails()
        return replace(*paths)

    files.os = type("OS", (), {**vars(os), "replace": staticmethod(counted)})


def full() -> None:
    raise FULL


def killed() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def job(folder: Path, *more: str) -> Callable[[], int]:
    return lambda: command(folder, *SEARCH, "hydra.run.dir=run", *more)


def result(path: Path) -> dict | None:
    """What a search found, without the times it took; None where there is no result."""
    try:
        content = json.loads(path.read_text())
    except FileNotFoundError:
        return None
    return {
        key: content[key]
        for key in ("parameters", "objective", "simulations", "verdicts", "intervals")
    }


def halves(folder: Path) -> str:
    """Files that are not whole, in words."""
    wrong = []
    for path in folder.rglob("*.json"):
        try:
            json.loads(path.read_text())
        except ValueError:
            wrong.append(path.name)
    wrong += [
        path.name
        for path in folder.rglob("*.html")
        if not path.read_text().rstrip().endswith("</html>")
    ]
    return f"NOT WHOLE: {', '.join(wrong)}" if wrong else ""


def trace(said: str) -> str:
    return "A TRACEBACK WAS SHOWN" if "Traceback" in said else ""


def in_store(folder: Path, expected: int, name: str = "outputs/mlflow.db") -> str:
    """What is wrong with the runs of a store: those that count are the finished ones, each under
    its key once.
    """
    with contextlib.closing(sqlite3.connect(folder / name)) as store:
        alive = "select run_uuid, status from runs where lifecycle_stage = 'active'"
        states = dict(store.execute(alive).fetchall())
        keys = store.execute(
            "select value, run_uuid from tags where key = 'tractexp.key'"
        ).fetchall()
    finished = [key for key, run in keys if states.get(run) == "FINISHED"]
    wrong = [f"{len(finished)} FINISHED RUNS, NOT {expected}"] * (len(finished) != expected)
    wrong += ["A RUN IS THERE TWICE"] * (len({*finished}) != len(finished))
    wrong += ["A RUN SAYS IT IS RUNNING"] * ("RUNNING" in states.values())
    return ", ".join(wrong)


def synced(folder: Path) -> tuple[int, str]:
    return forked(lambda: command(folder, "sync"))


def same(folder: Path, reference: dict, file: str = "run/result.json") -> str:
    return "" if result(folder / file) == reference else "ANOTHER RESULT"


# Parts


def jobs(
    work: Path, chance: random.Random, at: Iterable[int] = range(1, 1 + WRITTEN)
) -> Iterator[Fault]:
    """A search whose files cannot be written, or whose process dies `at` one of them."""
    reference = work / "reference"
    reference.mkdir()
    code, said = forked(job(reference))
    assert code == 0, said
    found = result(reference / "run" / "result.json")
    # made once: to make one takes ten times as long as the search
    store = reference / "outputs" / "mlflow.db"

    def fresh(name: str) -> Path:
        folder = made(work / name)
        (folder / "outputs").mkdir()
        shutil.copy(store, folder / "outputs")
        return folder

    def failing(n: int, fails: Callable[[], None], folder: Path) -> Callable[[], int]:
        def act() -> int:
            nth_write(n, fails, fails is full)
            return job(folder)()

        return act

    for n in at:
        folder = fresh(f"killed{n}")
        code, said = forked(failing(n, killed, folder))
        kept = sorted(p.name for p in (folder / "run").iterdir() if not p.name.startswith("."))
        wrong = halves(folder)
        had = same(folder, found) if "result.json" in kept else ""
        again, more = forked(job(folder))
        yield told(
            f"kill -9 of a search at its file {n} of {WRITTEN}",
            f"left whole: {', '.join(kept) or 'nothing'}; repeated, the same result",
            wrong,
            had,
            same(folder, found),
            trace(more),
            "" if code < 0 and again == 0 else f"EXIT {code}, {again}",
        )
    for n in at:
        folder = fresh(f"full{n}")
        code, said = forked(failing(n, full, folder))
        kept = (
            sorted(p.name for p in (folder / "run").glob("*")) if (folder / "run").is_dir() else []
        )
        lost = "" if n <= RESULT or "result.json" in kept else "THE RESULT IS LOST"
        sentence = next((s for s in said.splitlines() if "No space left" in s), "").strip()
        expected = 2 if n <= RESULT + 1 else 0  # the history; what is drawn is no reason to fail
        again, more = forked(job(folder))
        yield told(
            f"disk full from file {n} of {WRITTEN} on",
            f"exit {code}, {len(kept)} files kept, '{shorter(sentence, folder)}'",
            halves(folder),
            lost,
            trace(said),
            "" if code == expected else f"NOT EXIT {expected}",
            "" if sentence else "NO SENTENCE",
            same(folder, found),
            "" if again == 0 else f"THEN EXIT {again}: {more}",
        )
    started = time.monotonic()
    forked(job(fresh("timed")))
    took = time.monotonic() - started
    for k in range(MOMENTS):
        folder, after = fresh(f"moment{k}"), chance.uniform(0, took)
        code, said = forked(job(folder), after)
        wrong, again = halves(folder), forked(job(folder))
        yield told(
            f"kill -9 of a search after {after:.2f} s of its {took:.2f}",
            f"exit {code}; repeated, the same result",
            wrong,
            same(folder, found),
            trace(again[1]),
            f"THEN EXIT {again[0]}" if again[0] else "",
        )
    for k, way in enumerate([signal.SIGTERM] * 4 + [signal.SIGINT] * 2):
        folder = made(work / f"signal{k}")
        after = chance.uniform(0.3, 2.0)
        long = lambda folder=folder: command(  # noqa: E731
            folder,
            "optimizer=pso",
            "optimizer.iterations=10000000",
            "hydra.run.dir=run",
            "tracking.enabled=false",
        )
        code, said = forked(long, after, way, once="optimizer: pso")
        last = said.strip().splitlines()[-1] if said.strip() else ""
        kept = (folder / "run" / "interrupted.json").is_file()
        yield told(
            f"{signal.Signals(way).name} of a search, {after:.1f} s after it began",
            f"exit {code}, '{shorter(last, folder)}'",
            "" if code == 128 + way else f"NOT EXIT {128 + way}",
            trace(said),
            halves(folder),
            "" if kept else "THE BEST SO FAR IS LOST",
        )


def logging(work: Path, chance: random.Random) -> Iterator[Fault]:
    """A process killed while it writes a run into the store, at one of the
    statements that do so.
    """
    from tractexp import tracking
    from tractexp.tracking.run import TrackedRun
    from tractexp.tracking.runfile import save

    def opens() -> None:
        tracking.open_store(tracking.find_default_uri(empty))

    empty = made(work / "empty")
    forked(opens)

    def logs(folder: Path, n: int | None) -> Callable[[], None]:
        def act() -> None:
            uri = tracking.find_default_uri(folder)
            (folder / "result.json").write_text("{}")
            child = TrackedRun("e", "child", metrics={"x": 1.0})
            steps = list(range(1, 400))
            run = TrackedRun(
                "e",
                "job",
                {"a": 1},
                {"x": 1.0},
                {"c": (steps, steps)},
                artifacts=[folder / "result.json"],
                children=[child],
            )
            kept = save(folder / "job", run, uri)
            tracking.open_store(uri)
            count = counting_statements(n)
            kept.mark_logged(tracking.log(kept.run, uri))
            print("statements", count[0])

        return act

    def fresh(name: str) -> Path:
        folder = made(work / name)
        (folder / "outputs").mkdir()
        shutil.copy(empty / "outputs" / "mlflow.db", folder / "outputs" / "mlflow.db")
        return folder

    code, said = forked(logs(fresh("whole"), None))
    assert code == 0, said
    most = int(said.split()[-1])
    for n in sorted(chance.sample(range(1, most + 1), STATEMENTS)):
        folder = fresh(f"statement{n}")
        code, said = forked(logs(folder, n))
        with contextlib.closing(sqlite3.connect(folder / "outputs" / "mlflow.db")) as store:
            before = sorted(state for (state,) in store.execute("select status from runs"))
        again, more = forked(lambda folder=folder: command(folder, "sync", "."))
        twice, _ = forked(lambda folder=folder: command(folder, "sync", "."))
        yield told(
            f"kill -9 while logging, at statement {n} of {most}",
            f"left in the store: {', '.join(before) or 'nothing'}; after sync, one whole run",
            in_store(folder, 1),
            trace(more),
            "" if code == -9 and again == twice == 0 else f"EXIT {code}, {again}",
        )


def counting_statements(n: int | None) -> list[int]:
    """Count what the database is told from here on; the nth kills this process."""
    from sqlalchemy import event
    from sqlalchemy.engine import Engine

    count = [0]

    def heard(*_):
        count[0] += 1
        if count[0] == n:
            killed()

    event.listen(Engine, "before_cursor_execute", heard)
    return count


def stores(work: Path, chance: random.Random) -> Iterator[Fault]:
    """Stores that are away, locked, damaged or of another version when a search has ended."""
    made_once = made(work / "made")
    code, said = forked(job(made_once))
    assert code == 0, said
    found = result(made_once / "run" / "result.json")
    sound = (made_once / "outputs" / "mlflow.db").read_bytes()

    def with_store(name: str, content: bytes) -> tuple[Path, Path]:
        folder = made(work / name)
        (folder / "outputs").mkdir()
        (folder / "outputs" / "mlflow.db").write_bytes(content)
        return folder, folder / "outputs" / "mlflow.db"

    def observed(
        fault: str, folder: Path, mend: Callable[[], None] = lambda: None, runs: int = 2
    ) -> Fault:
        """Search, mend, and bring in; a run of the sound store has no folder here."""
        started = time.monotonic()
        code, said = forked(job(folder))
        took = time.monotonic() - started
        sentence = next(
            (s for s in said.splitlines() if s.startswith(("not logged", "logged in"))), ""
        )
        mend()
        healed, doctor = forked(lambda: command(folder, "doctor", "."))
        return told(
            fault,
            f"exit {code} after {took:.0f} s, '{shorter(sentence, folder)}'; in the store after"
            " doctor",
            same(folder, found),
            trace(said + doctor),
            "" if sentence else "NO SENTENCE",
            in_store(folder, runs),
            "" if (code, healed) == (0, 0) else f"EXIT {code}, {healed}: {doctor}",
        )

    for share in (0.0, 0.3, 0.9):
        folder, _ = with_store(f"cut{share}", sound[: int(share * len(sound))])
        yield observed(f"store cut short to {share:.0%}", folder, runs=1)
    folder, database = with_store("junk", bytes(chance.randrange(256) for _ in range(5000)))
    yield observed(
        "store overwritten with noise, which nobody knows for ours, moved away",
        folder,
        database.unlink,
        1,
    )
    folder, database = with_store("torn", torn(sound, chance))
    yield observed("a page of the store overwritten", folder, runs=1)
    folder, database = with_store("locked", sound)
    other = sqlite3.connect(database, check_same_thread=False)
    other.execute("BEGIN EXCLUSIVE")
    yield observed("store locked by another process", folder, other.close)
    folder, database = with_store("newer", sound)
    version(database, "ffff00000000")
    yield observed(
        "store of a newer MLflow", folder, lambda: version(database, version_of(sound, work))
    )
    folder = made(work / "taken")
    (folder / "outputs").write_text("a file where the folder should be")
    yield observed(
        "a file where the store's folder should be", folder, (folder / "outputs").unlink, runs=1
    )


def torn(sound: bytes, chance: random.Random) -> bytes:
    """A store whose schema page is overwritten in the middle."""
    page = bytearray(sound)
    page[100:3000] = bytes(chance.randrange(256) for _ in range(2900))
    return bytes(page)


def version(database: Path, number: str) -> None:
    with contextlib.closing(sqlite3.connect(database)) as store:
        store.execute("UPDATE alembic_version SET version_num = ?", (number,))
        store.commit()


def version_of(sound: bytes, work: Path) -> str:
    (work / "sound.db").write_bytes(sound)
    with contextlib.closing(sqlite3.connect(work / "sound.db")) as store:
        return store.execute("SELECT version_num FROM alembic_version").fetchone()[0]


# Sweeps, in processes of their own


def begun(folder: Path, *arguments: str, **environment: str) -> subprocess.Popen[str]:
    said = (folder / "said.txt").open("w")
    whole, there = [sys.executable, "-m", "tractexp", *arguments], os.environ | environment
    return subprocess.Popen(
        whole, cwd=folder, stdout=said, stderr=said, text=True, start_new_session=True, env=there
    )


def everyone(leader: int) -> list[int]:
    """The processes that a command has started, itself last: workers, and what logs, which has left
    its group.
    """
    found, todo = [leader], [leader]
    while todo:
        parent = todo.pop()
        for path in Path("/proc").glob("[0-9]*/stat"):
            with contextlib.suppress(OSError):
                if path.read_text().rpartition(")")[2].split()[1] == str(parent):
                    found.insert(0, int(path.parent.name))
                    todo.append(int(path.parent.name))
    return found


def kill(pids: list[int]) -> None:
    for pid in pids:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def swept(folder: Path) -> dict:
    return {p.parent.name: result(p) for p in sorted(folder.glob("sweep/*/result.json"))}


def sweeps(work: Path, chance: random.Random) -> Iterator[Fault]:
    """A sweep that loses workers, the whole machine again and again, or its disk."""
    reference = made(work / "sound")
    started = time.monotonic()
    process = begun(reference, *SWEEP)
    assert process.wait() == 0, (reference / "said.txt").read_text()
    took = time.monotonic() - started
    found = swept(reference)

    folder, process = made(work / "workers"), None
    process = begun(folder, *SWEEP)
    killed_at = []
    for _ in range(WORKERS):
        time.sleep(chance.uniform(0.1, 0.25) * took)
        if process.poll() is not None:
            break
        workers = [pid for pid in everyone(process.pid)[:-1] if "LokyProcess" in line_of(pid)]
        if workers:
            kill([chance.choice(workers)])
            killed_at.append(len(swept(folder)))
    code = process.wait()
    said = (folder / "said.txt").read_text()
    # a job that was hit three times is listed as failed, and run by the same command again
    if code:
        begun(folder, *SWEEP).wait()
    for k, done in enumerate(killed_at, start=1):
        yield told(
            f"kill -9 of a worker, number {k} of one sweep, {done} of 4 jobs done",
            f"exit {code}; all four results are those of the sweep without a fault",
            "" if swept(folder) == found else "OTHER RESULTS",
            trace(said),
            halves(folder),
        )

    folder, count = made(work / "machine"), 0
    while count < MACHINES:
        process, after = begun(folder, *SWEEP), chance.uniform(0.25, 0.95) * took
        time.sleep(after)
        if process.poll() is not None:
            shutil.rmtree(folder / "sweep")  # it was done: begin anew
            continue
        kill(everyone(process.pid))
        process.wait()
        count += 1
        done = swept(folder)
        yield told(
            f"kill -9 of a whole sweep with all its processes after {after:.0f} s, time {count}",
            f"{len(done)} of 4 results on disk, each that of the sweep without a fault",
            "" if all(found[number] == one for number, one in done.items()) else "ANOTHER RESULT",
            halves(folder),
        )
    code = begun(folder, *SWEEP).wait()
    said = (folder / "said.txt").read_text()
    yield told(
        f"the command repeated after {MACHINES} kills of the whole machine",
        f"exit {code}, all four results the same",
        "" if swept(folder) == found else "OTHER RESULTS",
        trace(said),
        halves(folder),
        running(folder),
    )
    yield from disks(work, found)


def line_of(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ")
    except OSError:
        return ""


def running(folder: Path) -> str:
    with contextlib.closing(sqlite3.connect(folder / "outputs" / "mlflow.db")) as store:
        ((count,),) = store.execute("select count(*) from runs where status = 'RUNNING'").fetchall()
    return f"{count} RUNS SAY THEY ARE RUNNING" if count else ""


def disks(work: Path, found: dict) -> Iterator[Fault]:
    """A sweep on a disk that is full at some time, given room, and repeated."""
    for kilobytes in DISKS:
        folder = made(work / f"disk{kilobytes}")
        mount = ["mount", "-t", "tmpfs", "-o"]
        if subprocess.run(
            [*mount, f"size={kilobytes}k", "tmpfs", str(folder)], capture_output=True
        ).returncode:
            return  # not allowed here
        try:
            log = work / f"said{kilobytes}.txt"
            with log.open("w") as said:
                whole = [sys.executable, "-m", "tractexp", *SWEEP]
                code = subprocess.run(whole, cwd=folder, stdout=said, stderr=said).returncode
            first = log.read_text()
            kept = swept(folder)
            subprocess.run(["mount", "-o", "remount,size=60m", str(folder)], check=True)
            with log.open("w") as said:
                again = subprocess.run(whole, cwd=folder, stdout=said, stderr=said).returncode
            last = first.strip().splitlines()[-1]
            yield told(
                f"the disk of a sweep and its store is full at {kilobytes} kB",
                f"exit {code}, {len(kept)} of 4 results kept, '{shorter(last, folder)}'; then exit"
                f" {again}, all 4",
                "" if swept(folder) == found else "OTHER RESULTS",
                trace(first + log.read_text()),
                halves(folder),
                "" if again == 0 else log.read_text()[-300:],
            )
        finally:
            # what logs may be in it still
            subprocess.run(["umount", "-l", str(folder)], check=False)


def longer(work: Path, chance: random.Random) -> Iterator[Fault]:
    """An investigation, killed and repeated: it goes on where it was, to the same bits."""
    asked = (
        "task=discrepancy",
        "task.effects=[stator_resistance]",
        "hydra.run.dir=run",
        "tracking.enabled=false",
    )
    cache = os.environ.get("TRACTEXP_CACHE_DIR")

    def investigates(folder: Path, kept: Path) -> Callable[[], int]:
        def act() -> int:
            from tractexp.cache import store

            store.DESCENTS.folder = kept
            return command(folder, *asked)

        return act

    whole, started = made(work / "whole"), time.monotonic()
    code, said = forked(investigates(whole, made(work / "kept_whole")))
    assert code == 0, (said, cache)
    took, content = time.monotonic() - started, (whole / "run" / "discrepancy.json").read_bytes()
    descents = len(list((work / "kept_whole" / "descents").iterdir()))
    folder, kept = made(work / "stopped"), made(work / "kept")
    for share in (0.35, 0.6, 0.8):
        code, _ = forked(investigates(folder, kept), share * took)
        there = len(list((kept / "descents").iterdir()))
        yield told(
            f"kill -9 of an investigation after {share:.0%} of its time",
            f"{there} of its {descents} fits and draws are kept",
            "" if there else "NOTHING IS KEPT",
            halves(folder),
        )
    started = time.monotonic()
    code, said = forked(investigates(folder, kept))
    equal = code == 0 and (folder / "run" / "discrepancy.json").read_bytes() == content
    yield told(
        "the investigation repeated after three kills",
        f"exit {code}, the same bytes in {(time.monotonic() - started) / took:.0%} of the time",
        "" if equal else "OTHER RESULTS",
        trace(said),
    )


def places(work: Path, chance: random.Random) -> Iterator[Fault]:
    """Folders that cannot be written, caches that are shared, umasks, and other ways to start
    Python.
    """
    reference = made(work / "reference")
    cache = {"TRACTEXP_CACHE_DIR": str(made(work / "cache"))}
    search = (*SEARCH, "hydra.run.dir=run")
    assert started_in(reference, search, **cache)[0] == 0
    found = result(reference / "run" / "result.json")

    def same_result(fault: str, name: str, *flags: str, umask: int = -1, **more: str) -> Fault:
        folder = made(work / name)
        code, said = started_in(folder, search, *flags, umask=umask, **cache | more)
        return told(
            fault,
            f"exit {code}, the same result",
            same(folder, found),
            trace(said),
            halves(folder),
            f"EXIT {code}" if code else "",
            in_store(folder, 1),
            readable(folder),
        )

    def refusal(fault: str, folder: Path, **more: str) -> Fault:
        code, said = started_in(folder, search, **cache | more)
        left = sorted(path.name for path in folder.rglob("*"))
        return told(
            fault,
            f"exit {code}, '{shorter(said.strip(), folder)}'",
            "" if code == 2 else "NOT EXIT 2",
            trace(said),
            "" if said.startswith("tractexp: ") else "NO SENTENCE",
            f"LEFT: {', '.join(left)}" if left else "",
        )

    for umask in (0o000, 0o077, 0o027):
        yield same_result(f"a search under umask {umask:03o}", f"umask{umask}", umask=umask)
    yield same_result("a search under python -O", "optimized", "-O")
    yield same_result("a search under python -X dev -W error", "dev", "-X", "dev", "-W", "error")
    yield same_result(
        "a search under LC_ALL=C and another PYTHONHASHSEED",
        "plain",
        LC_ALL="C",
        PYTHONHASHSEED="7",
    )
    with unwritable(work / "home") as home:
        gone = {
            "TRACTEXP_CACHE_DIR": "",
            "XDG_CACHE_HOME": "",
            "HOME": str(home),
            "MPLCONFIGDIR": "",
        }
        yield same_result("a home folder that cannot be written", "homeless", **gone)
    with unwritable(work / "folder") as folder:
        yield refusal("a folder that cannot be written", folder)
    with unwritable(work / "store") as folder:
        yield refusal(
            "a cache that cannot be written",
            made(work / "cacheless"),
            TRACTEXP_CACHE_DIR=str(folder),
        )
    shared = made(work / "shared")
    shared.chmod(0o777)
    yield refusal(
        "a cache that others can write to", made(work / "open"), TRACTEXP_CACHE_DIR=str(shared)
    )
    yield from side_by_side(work, chance, search, found)


def side_by_side(
    work: Path, chance: random.Random, search: tuple[str, ...], found: dict
) -> Iterator[Fault]:
    """Commands that begin at once on one empty cache, one of which is killed; then one more on what
    that left.
    """
    cache = str(made(work / "common"))
    folders = [made(work / f"common{k}") for k in range(SHARING)]
    jobs_of = [begun(folder, *search, TRACTEXP_CACHE_DIR=cache) for folder in folders]
    time.sleep(chance.uniform(1.0, 4.0))
    kill(everyone(jobs_of[0].pid))
    for k, (folder, process) in enumerate(zip(folders, jobs_of, strict=True)):
        code, said = process.wait(), (folder / "said.txt").read_text()
        expected = (-signal.SIGKILL, 0) if k == 0 else (0,)
        yield told(
            f"{SHARING} commands at once on an empty cache, the first killed: number {k + 1}",
            f"exit {code}",
            halves(folder),
            trace(said),
            "" if code in expected else f"EXIT {code}",
            same(folder, found) if code == 0 else "",
        )
    code = begun(folders[0], *search, TRACTEXP_CACHE_DIR=cache).wait()
    said = (folders[0] / "said.txt").read_text()
    yield told(
        "the killed command repeated on that cache",
        f"exit {code}, the same result",
        same(folders[0], found),
        trace(said),
        f"EXIT {code}" if code else "",
    )


def started_in(
    folder: Path, arguments: tuple[str, ...], *flags: str, umask: int = -1, **environment: str
):
    """Exit code, and what was printed, of a command in a process of its own; an empty variable is
    taken away.
    """
    there = {name: value for name, value in (os.environ | environment).items() if value}
    command = [sys.executable, *flags, "-m", "tractexp", *arguments]
    done = subprocess.run(
        command,
        cwd=folder,
        env=there,
        umask=umask,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    return done.returncode, done.stdout


@contextlib.contextmanager
def unwritable(folder: Path) -> Iterator[Path]:
    """A folder in which nobody can write: of modes, or, where this process may do as it likes, of a
    mount.
    """
    made(folder)
    mount = ["mount", "-t", "tmpfs", "-o", "ro,size=64k", "tmpfs", str(folder)]
    as_mount = os.geteuid() == 0 and not subprocess.run(mount, capture_output=True).returncode
    if not as_mount:
        folder.chmod(0o555)
    try:
        yield folder
    finally:
        folder.chmod(0o755) if not as_mount else subprocess.run(
            ["umount", "-l", str(folder)], check=True
        )


def readable(folder: Path) -> str:
    """What is wrong with modes: files that their owner cannot read, and what names the store open
    to others.
    """
    files_of = [path for path in folder.rglob("*") if path.is_file()]
    closed = [path.name for path in files_of if not path.stat().st_mode & 0o400]
    wide = [
        path.name for path in files_of if path.name == "mlflow.json" and path.stat().st_mode & 0o077
    ]
    wrong = [f"NOT READABLE: {', '.join(closed)}"] * bool(closed)
    return ", ".join(wrong + ["mlflow.json IS OPEN TO OTHERS"] * bool(wide))


def shorter(sentence: str, folder: Path) -> str:
    return sentence.replace(f"{folder}/", "").replace(str(folder), ".")[:160]


def made(folder: Path) -> Path:
    folder.mkdir(parents=True)
    return folder


PARTS = {
    "jobs": jobs,
    "logging": logging,
    "stores": stores,
    "sweeps": sweeps,
    "longer": longer,
    "places": places,
}


def ready() -> None:
    """Import and compile what forked processes then have at hand."""
    import tractexp.__main__
    from tractexp.tracking.store import import_lightly, import_mlflow

    import_mlflow(sql=True)
    with import_lightly():
        import mlflow.pyfunc  # noqa: F401
    import hydra  # noqa: F401
    import plotly.graph_objects  # noqa: F401
    import scipy.optimize
    import scipy.stats  # noqa: F401

    import tractexp.api.identify
    import tractexp.identification.estimate
    import tractexp.identification.profile
    import tractexp.report.identify  # noqa: F401
    from tractexp.configuration.plugin import discover

    discover()


def main() -> int:
    """Inject the faults of the parts asked for, and store what was observed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--part", default=",".join(PARTS))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--store", type=Path, default=STORED)
    asked = parser.parse_args()
    ready()
    known = json.loads(asked.store.read_text()) if asked.store.exists() else {}
    for part in asked.part.split(","):
        with tempfile.TemporaryDirectory(prefix="faults") as work:
            found = []
            for fault in PARTS[part](Path(work), random.Random(asked.seed)):
                print(
                    f"{'LOST' if fault['lost'] else 'held':>4}  {fault['fault']}:"
                    f" {fault['observed']}",
                    flush=True,
                )
                found.append(fault)
                known[part] = found
                known = {name: known[name] for name in PARTS if name in known}
                files.write(asked.store, json.dumps(known, indent=1) + "\n")
    count, lost = (
        sum(map(len, known.values())),
        sum(f["lost"] for faults in known.values() for f in faults),
    )
    print(f"{count} faults, {lost} of which lost something")
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
