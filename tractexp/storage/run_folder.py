"""The folder of one run: an earlier whole run stays in it until a newer one is whole, whatever ends
the process.

A run writes into a folder of its own within, named after its process. When that is whole it is
renamed to `WHOLE`: this one move is the moment at which the newer run counts. Its files then take
their places one by one, `RESULTS` last, and what is left of the earlier run goes at the end. Who is
killed meanwhile leaves `WHOLE`, and the next command that looks at the folder goes on with it. A
lock keeps two runs from one folder.
"""

import contextlib
import os
import shutil
import socket
import time
import uuid
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TypeAlias

from tractexp.errors import UserError
from tractexp.storage import files, locks

CONFIGURATION, RESULT = ".hydra", "result.json"
WHOLE, NEXT, LOCK, GOES = (
    ".tractexp.whole",
    ".tractexp.next",
    ".tractexp.next.lock",
    ".tractexp.goes",
)
KINDS = (
    "discrepancy",
    "generalise",
    "linear_network",
    "posterior",
    "plan",
    "profile",
    "survey",
    "station",
    "benchmark",
    "comparison",
    "paper",
)
RESULTS = (
    "history.csv",
    "interrupted.json",
    "report.html",
    "sheet.html",
    "sheet.docx",
    "posterior.npz",
    "unexplained.csv",
    "survey.csv",
    "survey.parquet",
    "paper.md",
    "mlflow.json",
    *(f"{kind}{ending}" for kind in KINDS for ending in (".json", ".html")),
    RESULT,
)
Write: TypeAlias = Callable[[Path], list[Path]]


class RunFolder:
    """The folder in which this process writes a run; make it by `run_folder`."""

    def __init__(self, folder: Path, configuration: Mapping[str, str], read: frozenset[Path]):
        """`configuration` is what lies beside the results, {name of a file: text}; `read` are files
        the run needs.
        """
        self.folder, self.read = folder, read
        self.next = folder / f"{NEXT}.{os.getpid()}.{uuid.uuid4().hex[:8]}"
        earlier = any((folder / name).exists() for name in (CONFIGURATION, *RESULTS))
        self.begun_empty = not earlier
        for name, content in configuration.items():
            place = self.next if earlier else folder
            files.write(place / CONFIGURATION / name, content, lasting=False)

    def place(self, write: Write) -> list[Path]:
        """Let `write` fill a folder with results, and give them their places; their paths.

        Raises `UserError` where that is impossible: the earlier run is there then, or the newer one
        is whole and the next command goes on. Where there is no earlier run a result is kept
        without what should have followed it.
        """
        self.next.mkdir(exist_ok=True)
        try:
            paths = [self.folder / path.relative_to(self.next) for path in write(self.next)]
        except BaseException:
            if self.begun_empty and (self.next / RESULT).is_file():
                self._commit()
            raise
        self._commit()
        return paths

    def conclude(self) -> None:
        """Settle the folder of a task that writes files for others, but no result: results that are
        there keep their own.
        """
        if self.next.exists() and not any((self.folder / name).exists() for name in RESULTS):
            self._commit()

    def forget(self) -> None:
        """Remove the folder of a run that was refused or stopped, where it came about for it and
        holds no result.
        """
        shutil.rmtree(self.next, ignore_errors=True)
        if self.begun_empty and {path.name for path in self.folder.iterdir()} <= {
            CONFIGURATION,
            LOCK,
        }:
            shutil.rmtree(self.folder, ignore_errors=True)

    def _commit(self) -> None:
        """Say which results of an earlier run go, then move the new ones in."""
        new = {path.name for path in self.next.iterdir()}
        keeps = {path.name for path in self.read if path.parent == self.folder.absolute()}
        goes = [name for name in RESULTS if CONFIGURATION in new and name not in new | keeps]
        if goes:
            files.write(self.next / GOES, "\n".join(goes))
        files.move(self.next, self.folder / WHOLE)
        _settle(self.folder)


@contextlib.contextmanager
def run_folder(
    folder: Path, configuration: Mapping[str, str], read: frozenset[Path]
) -> Iterator[RunFolder]:
    """The folder for one run of this process alone. Raises `UserError` where another one is at work
    there.

    What an ended process left is mended first; what this one leaves is removed at the end.
    """
    with hold(folder):
        _settle(folder)
        for left in folder.glob(f"{NEXT}.*"):
            if left.is_dir() and not left.is_symlink():
                shutil.rmtree(left, ignore_errors=True)
        run = RunFolder(folder, configuration, read)
        try:
            yield run
        except BaseException:
            run.forget()
            raise
        finally:
            shutil.rmtree(run.next, ignore_errors=True)


def settle(folder: Path) -> bool:
    """Give the files of a run that is whole their places, where a process was ended before it had;
    whether it was so.

    Raises `UserError` where they cannot be moved, or a process is about it.
    """
    if not (folder / WHOLE).is_dir():
        return False
    with hold(folder):
        return _settle(folder)


def find_run(folder: Path) -> Path | None:
    """The folder of the run whose files lie in a folder: itself, but where they have not their
    places yet; None where that run is not whole.
    """
    if folder.name.startswith(f"{NEXT}."):
        return None
    return folder.parent if folder.name == WHOLE else folder


def find_holder(folder: Path) -> str:
    """Which other process is at work in a folder; "" where none is."""
    holder = locks.read_claim(folder / LOCK)
    return "" if holder.startswith(_describe_process()) else holder


def _describe_process() -> str:
    """This process, for whoever finds its lock."""
    return f"process {os.getpid()} on {socket.gethostname()}, "


@contextlib.contextmanager
def hold(folder: Path) -> Iterator[None]:
    """Hold a folder, created where there is none, for this process alone. Raises `UserError` where
    another does.
    """
    since = time.strftime("%Y-%m-%d %H:%M:%S")
    try:
        with locks.claim_file(folder / LOCK, f"{_describe_process()}since {since}"):
            yield
    finally:
        with contextlib.suppress(OSError):  # where it is not empty
            folder.rmdir()


def _settle(folder: Path) -> bool:
    """Settle a folder that is held. That of somebody else may hold anything by the name of `WHOLE`.

    So nothing is moved by a link, from elsewhere or to there.
    """
    whole = folder / WHOLE
    if whole.is_symlink() or not whole.is_dir():
        return False
    for path in _sort_files(whole):
        target = folder / path.relative_to(whole)
        if not (
            files.is_inside(path, whole)
            and target.parent.resolve().is_relative_to(folder.resolve())
        ):
            raise UserError(f"{target} would be moved by a link out of {folder}; remove {whole}")
        target.parent.mkdir(parents=True, exist_ok=True)
        files.move(path, target)
    for name in _list_removed(whole):
        (folder / name).unlink(missing_ok=True)
    shutil.rmtree(whole, ignore_errors=True)
    return True


def _sort_files(whole: Path) -> list[Path]:
    """The files of a run in the order in which they are moved: what says that it is whole last."""
    order = {name: k for k, name in enumerate((CONFIGURATION, *RESULTS))}
    paths = [path for path in whole.rglob("*") if not path.is_dir() and path.name != GOES]
    return sorted(paths, key=lambda path: order.get(path.relative_to(whole).parts[0], -1))


def _list_removed(whole: Path) -> list[str]:
    """The results of an earlier run that the one in `whole` has none of."""
    if not (whole / GOES).is_file():
        return []
    names = files.read_text(whole / GOES, files.CONFIGURATION).split("\n")
    return [name for name in names if name in RESULTS]
