"""`tractexp doctor`: whether everything a run stands on is sound; what can be healed without loss
is.
"""

import argparse
import os
import shutil
import sqlite3
import time
from collections.abc import Iterable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

from tractexp import tracking
from tractexp.cli.sync import FOLDER, send_folder
from tractexp.errors import UserError
from tractexp.storage import files
from tractexp.storage.run_folder import WHOLE, settle
from tractexp.text import quoting
from tractexp.text.progress import say
from tractexp.tracking import owner
from tractexp.tracking.store import find_database, open_store, raise_sentences

DOES = (
    "Check versions, cores, caches, disk, the MLflow store and its runs; heal what can be, say what"
    " is wrong."
)
LEAST_FREE_BYTES = 500e6  # bytes of a disk that is not nearly full
BUSY = 2.0  # s to wait for a store that another process writes to

Finding = tuple[str, str]
SOUND, HEALED, WRONG = "well", "healed", "WRONG"


def doctor(arguments: list[str]) -> int:
    """Check and heal; returns the exit code, 2 where something is left that is wrong."""
    parser = argparse.ArgumentParser(prog="tractexp doctor", description=DOES)
    parser.add_argument(
        "folder", nargs="?", type=Path, default=FOLDER, help=f"of runs; default: {FOLDER}"
    )
    parser.add_argument(
        "--uri", help="the MLflow store; default: MLFLOW_TRACKING_URI, else outputs/mlflow.db here"
    )
    chosen = parser.parse_args(arguments)
    uri = tracking.resolve_address(chosen.uri)
    wrong = sum(
        map(
            print_findings,
            (
                check_versions(),
                check_cores(),
                check_disk(chosen.folder),
                check_caches(),
                find_leavings(chosen.folder),
            ),
        )
    )
    if print_findings(store(uri)):
        return 2
    wrong += print_findings(check_runs(uri))
    if chosen.folder.is_dir():
        wrong += send_folder(chosen.folder, chosen.uri)["not logged"]
    return 2 if wrong else 0


def print_findings(findings: Iterable[Finding]) -> int:
    """Print findings; how many of them are wrong."""
    wrong = 0
    for state, sentence in findings:
        say(f"{state:>6}  {sentence}")
        wrong += state == WRONG
    return wrong


def check_versions() -> Iterator[Finding]:
    """Whether the packages installed are those that this one asks for."""
    from importlib.metadata import PackageNotFoundError, requires, version

    from packaging.requirements import Requirement

    wrong = []
    for needed in map(Requirement, requires("tractexp") or ()):
        if needed.marker is not None and not needed.marker.evaluate({"extra": ""}):
            continue
        try:
            if not needed.specifier.contains(installed := version(needed.name), prereleases=True):
                wrong.append(f"{needed.name} {installed} is installed, and {needed} is needed")
        except PackageNotFoundError:
            wrong.append(f"{needed.name} is not installed, and {needed} is needed")
    for sentence in wrong:
        needed = sentence.rpartition("and ")[2].removesuffix(" is needed")
        yield WRONG, f"{sentence}: {quoting.shell('pip', 'install', needed)}"
    if not wrong:
        yield SOUND, "every package is of a version that is known to work"


def check_cores() -> Iterator[Finding]:
    """How many cores a sweep may use, and whether a worker starts.

    However long it takes, and as often as a sweep tries it: on a machine that is short of time or
    memory the first may be killed before it begins.
    """
    from joblib import cpu_count

    from tractexp.process.workers import Workers

    try:
        list(Workers(1, apart=True).results(abs, [1], trace=lambda item: False))
    except Exception as error:
        yield (
            WRONG,
            f"no worker process starts ({type(error).__name__}: {error}): sweeps and surveys cannot"
            " run",
        )
        return
    yield SOUND, f"{cpu_count()} of {os.cpu_count()} cores may be used, and a worker starts"


def check_disk(folder: Path) -> Iterator[Finding]:
    """Whether there is room for results."""
    place = next(
        (p for p in (folder.absolute(), *folder.absolute().parents) if p.is_dir()), Path.cwd()
    )
    free = shutil.disk_usage(place).free
    if not os.access(place, os.W_OK):
        yield WRONG, f"{place} may not be written: results need another folder (hydra.run.dir=...)"
    elif free < LEAST_FREE_BYTES:
        yield (
            WRONG,
            f"only {free / 1e6:.0f} MB are free on the disk of {place}: make room before a sweep",
        )
    else:
        yield SOUND, f"{free / 1e9:.1f} GB are free on the disk of {place}"


def check_caches() -> Iterator[Finding]:
    """Whether the store can be written and its entries be read."""
    from tractexp.cache.store import CODE, find_cache_folder, find_damaged_files

    try:
        folder = find_cache_folder()
        files.write(
            folder / "doctor.txt", "written and removed by tractexp doctor\n", lasting=False
        ).unlink()
    except (OSError, UserError) as error:
        yield WRONG, f"nothing can be kept of what is compiled: {error}"
        return
    gone = [*find_damaged_files(folder), *files.find_leftovers(folder)]
    for path in gone:
        path.unlink(missing_ok=True)
    if gone:
        yield HEALED, f"{len(gone)} damaged or unfinished files of the cache {folder} are removed"
    yield SOUND, f"the cache {folder} holds {len(list((folder / CODE.kind).glob('*')))} kernels"


def find_leavings(folder: Path) -> Iterator[Finding]:
    """Findings on partial files of processes that were killed while they wrote."""
    halves = files.find_leftovers(folder) if folder.is_dir() else []
    for path in halves:
        path.unlink(missing_ok=True)
    if halves:
        yield HEALED, f"{len(halves)} files of {folder} that were never finished are removed"
    for whole in [*folder.rglob(WHOLE)] if folder.is_dir() else []:
        try:
            if settle(whole.parent):
                yield (
                    HEALED,
                    f"the results in {whole.parent} have their places; a run was killed before they"
                    " had",
                )
        except UserError as error:
            yield WRONG, str(error)


def store(uri: str) -> Iterator[Finding]:
    """Whether the store can be used; a damaged one is set aside, for the runs are kept beside their
    results.
    """
    database = find_database(uri)
    if database is not None and not database.exists():
        yield SOUND, f"there is no MLflow store {database} yet: it is made when something is logged"
        return
    if database is not None and (problem := _describe_fault(database)):
        if problem == "locked":
            yield (
                WRONG,
                f"the MLflow store {database} is locked by another process: runs are kept until it"
                " lets go",
            )
            return
        if not _is_ours(database):
            yield (
                WRONG,
                f"{database} is no MLflow store ({problem}) and is left as it is: name another by"
                " --uri",
            )
            return
        aside = database.with_name(f"{database.name}.damaged-{time.strftime('%Y-%m-%d_%H-%M-%S')}")
        files.move(database, aside)
        yield (
            HEALED,
            f"the MLflow store {database} is damaged ({problem}); it is set aside as {aside.name}",
        )
    try:
        tracking.open_store(uri)
    except UserError as error:
        yield WRONG, str(error)
        return
    yield SOUND, f"the MLflow store {uri} can be used"


def _is_ours(database: Path) -> bool:
    """Whether a damaged file was a store of MLflow's, as far as what is left of it says; an empty
    one is nobody's.
    """
    content = files.read(database)
    return not content.strip(b"\0") or b"alembic_version" in content or b"mlflow." in content


def _describe_fault(database: Path) -> str:
    """The fault of an SQLite file, in a few words; "locked" for one that is in use, "" for a sound
    one.
    """
    try:
        with closing(sqlite3.connect(database, timeout=BUSY)) as connection:
            (verdict,) = connection.execute("PRAGMA quick_check(1)").fetchone()
            if verdict != "ok":
                return str(verdict).partition("\n")[0]
            connection.execute("SELECT version_num FROM alembic_version")
            if os.access(database, os.W_OK):
                connection.execute("BEGIN IMMEDIATE")
                connection.rollback()
    except sqlite3.OperationalError as error:
        return (
            "locked"
            if "locked" in str(error)
            else ""
            if "unable to open" in str(error)
            else str(error)
        )
    except sqlite3.DatabaseError as error:
        return str(error)
    return ""


def check_runs(uri: str) -> Iterator[Finding]:
    """Whether runs that say they are running are; those whose process has ended are closed."""
    database = find_database(uri)
    if database is not None and not database.exists():
        return
    client: Any = open_store(uri)
    with raise_sentences(uri):
        closed = [*owner.closed, *owner.close_stale(client)]
        running = owner.list_running(client)
    if closed:
        yield HEALED, f"{len(closed)} runs whose process had ended are closed as KILLED"
    unknown = [run for run in running if owner.has_ended(run.data.tags.get(owner.TAG, "")) is None]
    for run in unknown:
        where = run.data.tags.get(owner.TAG, "").partition("/")[0] or "a process that is not known"
        yield (
            WRONG,
            f"run '{run.info.run_name}' ({run.info.run_id}) says it is running on {where}, which"
            " cannot be told from here; where it is not, run tractexp doctor there, or delete the"
            " run in MLflow",
        )
    if not unknown:
        yield (
            SOUND,
            f"{len(running)} runs are running"
            if running
            else "no run says it is running that is not",
        )
