"""Which files are records: below a folder, and in a .zip."""

import os
import re
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from tractexp.configuration.plugin import discover
from tractexp.errors import DATA, UserError
from tractexp.record import Reader, list_endings
from tractexp.record.foreign import is_record
from tractexp.storage import files

BEGINNING = 65536  # bytes
CELL = re.compile(rb"[\s,;\"]+")
BINARY = (b"PAR1", b"PK\x03\x04", b"\xd0\xcf\x11\xe0")  # how Parquet files and workbooks begin
NUMBERS = 3  # in a row of a table among words, at least; two make a row that holds nothing else
RUN = ".hydra"  # a folder that holds it is that of a run: what lies there was written by us


def find_records(folder: Path) -> Iterator[Path]:
    """The records below a folder, in order of name, each .zip as one; of a .zip, those in it.

    Hidden files are left out, and those of runs below the folder.

    Raises `UserError` where there is no such folder.
    """
    if files.is_archive(folder):
        yield from find_packed(folder)
        return
    if folder.is_file():
        raise UserError(f"{DATA.path}={folder} is a file; give the folder it lies in")
    if not folder.is_dir():
        raise UserError(f"{DATA.path}={folder} is no folder that is there")
    readable = list_endings()
    for place, below, names in os.walk(folder):
        # a converted file may still be opened by its own path
        if RUN in below and Path(place) != folder:
            below.clear()
            continue
        below[:] = sorted(name for name in below if not name.startswith("."))
        beside = {name.lower() for name in names}
        for path in (Path(place, name) for name in sorted(names)):
            seen = not path.name.startswith(".")
            if seen and (files.is_archive(path) or _is_wanted(path, readable, beside)):
                yield path


def find_packed(archive: Path) -> list[Path]:
    """The records in a .zip, in order of name. Raises `UserError` for one that cannot be read, or
    holds another archive.
    """
    inside, readable = files.list_packed(archive), list_endings()
    for path in inside:
        if path.suffix.lower() == archive.suffix.lower():
            within = path.relative_to(archive)
            raise UserError(
                f"{archive} holds another archive, '{within}': extract it, and give a file of it"
            )
    beside = {
        path.parent: {p.name.lower() for p in inside if p.parent == path.parent} for path in inside
    }
    return [path for path in inside if _is_wanted(path, readable, beside[path.parent])]


def _is_wanted(path: Path, readable: Collection[str], beside: Collection[str]) -> bool:
    """Whether a file is looked at: it can be read, or is a record of another format; what belongs
    to one is not.
    """
    ending = path.suffix.lower()
    if ending not in readable:
        return is_record(path)
    every: list[Any] = list(discover()[Reader.group].values())
    parts = next((cls.parts for cls in every if ending in cls.parts), None)
    if parts is None:
        return not _holds_prose(path)
    before = parts[: parts.index(ending)]  # of the parts of one record the first is read
    return not any(path.with_suffix(each).name.lower() in beside for each in before)


def _holds_prose(path: Path) -> bool:
    """Whether a text that would be read as a table holds words: not one row of numbers at its
    beginning.
    """
    try:
        head = files.read(path, BEGINNING)
    except (UserError, FileNotFoundError):
        return False  # its reader will say why it cannot be read
    if head.startswith(BINARY):
        return False
    return not any(_holds_numbers(line) for line in head.replace(b"\0", b"").splitlines())


def _holds_numbers(line: bytes) -> bool:
    """Whether a line is a row of numbers."""
    cells = [cell for cell in CELL.split(line) if cell]
    count = sum(cell[:1] in b"+-.0123456789" and _is_number(cell) for cell in cells)
    return count >= NUMBERS or 2 == count == len(cells)


def _is_number(cell: bytes) -> bool:
    """Whether a cell is a number."""
    try:
        float(cell)
    except ValueError:
        return False
    return True
