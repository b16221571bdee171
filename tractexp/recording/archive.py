"""A folder of recordings: which of its files are read, and its events by name."""

import functools
import os
import re
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from tractexp.errors import DATA, UserError, nearest
from tractexp.files import read
from tractexp.plugin import discover
from tractexp.record import Reader, Record, endings, reader_of
from tractexp.record.foreign import is_record
from tractexp.recording.overview import LoadEvent, Sight, View, view_of
from tractexp.recording.reader import WaveformReader
from tractexp.wording import count_noun

NAMED = re.compile(r"(?P<file>.+?)(?:#(?P<load>\d+)(?:\.(?P<dip>\d+))?)?")
BEGINNING = 65536  # bytes
CELL = re.compile(rb"[\s,;\"]+")
BINARY = (b"PAR1", b"PK\x03\x04", b"\xd0\xcf\x11\xe0")  # how Parquet files and workbooks begin
NUMBERS = 3  # in a row of a table, at least
RUN = ".hydra"  # a folder that holds it is that of a run: what lies there was written by us


def files(folder: Path) -> Iterator[Path]:
    """The records below a folder, in order of name; without hidden files and those of runs below
    it.

    Raises `UserError` where there is no such folder.
    """
    if not folder.is_dir():
        kind = (
            "a file; give the folder it lies in" if folder.exists() else "no folder that is there"
        )
        raise UserError(f"{DATA.path}={folder} is {kind}")
    readable = endings()
    for place, below, names in os.walk(folder):
        # a converted file may still be opened by its own path
        if RUN in below and Path(place) != folder:
            below.clear()
            continue
        below[:] = sorted(name for name in below if not name.startswith("."))
        beside = {name.lower() for name in names}
        for name in sorted(names):
            if not name.startswith(".") and _is_wanted(Path(place, name), readable, beside):
                yield Path(place, name)


def _is_wanted(path: Path, readable: Collection[str], beside: Collection[str]) -> bool:
    """Whether a file is looked at: it can be read, or is a record of another format; what belongs
    to one is not.
    """
    if path.suffix.lower() not in readable:
        return is_record(path)
    ending = path.suffix.lower()
    every: list[Any] = list(discover()[Reader.group].values())
    parts = next((cls.parts for cls in every if ending in cls.parts), None)
    if parts is None:
        return issubclass(reader_of(str(path)), WaveformReader) or not _prose(path)
    before = parts[: parts.index(ending)]  # of the parts of one record the first is read
    return not any(path.with_suffix(each).name.lower() in beside for each in before)


def _prose(path: Path) -> bool:
    """Whether a text that would be read as a table holds words: not one row of numbers at its
    beginning.
    """
    try:
        head = read(path, BEGINNING)
    except (UserError, FileNotFoundError):
        return False  # its reader will say why it cannot be read
    if head.startswith(BINARY):
        return False
    return not any(_numbers(line) >= NUMBERS for line in head.replace(b"\0", b"").splitlines())


def _numbers(line: bytes) -> int:
    """How many cells of a line are numbers."""
    return sum(
        cell[:1] in b"+-.0123456789" and _is_number(cell) for cell in CELL.split(line) if cell
    )


def _is_number(cell: bytes) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def look_at_file(path: Path) -> View:
    """A file of an archive, looked at by the reader of its ending. Raises `UserError` where it
    cannot be read.
    """
    cls = reader_of(str(path))
    return view_of(str(path), {"name": cls.name, **cls.of(str(path))})


def event_name(file: str, load: int, event: LoadEvent) -> str:
    """What an event is called within its archive: FILE#LOAD.DIP, both counted from 1."""
    return f"{file}#{load}" + ("" if event.dip is None else f".{event.dip}")


def records(folder: Path, names: list[str], where: str) -> list[Record]:
    """The records of events by name; `where` is the setting in messages.

    FILE#LOAD.DIP is dip DIP of load LOAD as `look` numbers them, FILE#LOAD the first event of the
    load that is worth fitting, FILE that of the first load. Raises `UserError` for what is not
    there or cannot be fitted.
    """
    see = functools.cache(look_at_file)
    return [_record(folder, name, where, see) for name in names]


def _record(
    folder: Path, name: str, where: str, see: "functools._lru_cache_wrapper[View]"
) -> Record:
    parts = NAMED.fullmatch(name)
    path, load, dip = folder / name, 1, None
    if not path.is_file() and parts is not None:
        path, load = folder / parts["file"], int(parts["load"] or 1)
        dip = int(parts["dip"]) if parts["dip"] else None
    if not path.is_file():
        there = [str(p.relative_to(folder)) for p in files(folder)]
        raise UserError(
            f"{where}: there is no file '{path.relative_to(folder)}' in"
            f" {folder}{nearest(name, there)}"
        )
    view = see(path)
    if not 1 <= load <= len(view.sights):
        loads = count_noun(len(view.sights), "load")
        raise UserError(
            f"{where}: {name}: {path} shows {loads}, and there is no load {load}; the first is 1"
        )
    event = _select(view.sights[load - 1], dip, f"{where}: {name}")
    assert event.event is not None
    record = event.event.record
    return Record(
        **{**vars(record), "name": event_name(path.relative_to(folder).as_posix(), load, event)}
    )


def _select(shown: Sight, dip: int | None, where: str) -> LoadEvent:
    matches = [s for s in shown.events if (s.worth if dip is None else s.dip == dip)]
    if not matches or matches[0].event is None:
        reasons = [f"dip {s.dip}: {s.why}" for s in shown.events if s.dip is not None] or [
            "nothing happened to it"
        ]
        which = (
            "an event that is worth fitting" if dip is None else f"a dip {dip} that can be fitted"
        )
        raise UserError(f"{where}: the load '{shown.name}' has not {which} ({'; '.join(reasons)})")
    return matches[0]
