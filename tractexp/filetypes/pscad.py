"""Results of PSCAD/EMTDC: `.out` files of a title and columns of numbers, named by the `.inf` file
of their case.

A file has the time and at most ten channels; a case of more has `case_01.out`, `case_02.out` and so
on.

Source: PSCAD's manual, EMTDC output files.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from tractexp.errors import UserError
from tractexp.filetypes.heading import TableHeading
from tractexp.filetypes.table import TableColumn, TableFile, TableForm
from tractexp.filetypes.table_text import TextTable, open_text
from tractexp.filetypes.text import decode
from tractexp.storage import files

ENDING = ".out"
LARGEST = 4 * 2**20  # bytes of names
_CHANNEL = re.compile(r"^[ \t]*PGB\((\d{1,6})\)(.*)$", re.MULTILINE)
_FIELD = re.compile(r'(\w+)="([^"]*)"')
_NUMBERED = re.compile(r"(.+?)_(\d{2,4})")
_PHASE = re.compile(r"(.*?)_?abc:([123])|(.*?):([123])", re.IGNORECASE)  # of a vector: Vabc:1, V:2


class Results(TableFile):
    """The channels of a case, from all of its files, beside one time."""

    def __init__(self, source: str, parts: list[TextTable], names: list[tuple[str, str]]) -> None:
        """`names` are those of the channels with their units. Raises `UserError` where they are not
        as many.
        """
        self.source, self.parts = source, parts
        channels = [(part, k) for part in parts for k in range(1, part.width)]
        self.columns = [(parts[0], 0), *channels]  # whose time is that of all
        if len(names) != len(channels):
            raise UserError(
                f"{source}: its .inf file names {len(names)} channels, and the .out files have"
                f" {len(channels)}; keep those of one run in a folder"
            )
        self.heading = TableHeading(
            ("t", *(name for name, _ in names)), ("s", *(unit for _, unit in names)), 0, 0
        )
        rows = zip(*(part.sample for part in parts), strict=False)
        self.sample = [[row[0][0], *(cell for cells in row for cell in cells[1:])] for row in rows]
        self.notes = (
            *parts[0].notes,
            f"channels named by the .inf file, of {len(parts)} .out file(s)",
        )

    def read(self, wanted: Mapping[int, str]) -> dict[int, TableColumn]:
        """The wanted columns {number: kind}, each from the file that has it; the first file has the
        time.
        """
        cells: dict[int, TableColumn] = {}
        for part in self.parts:
            own = {k: self.columns[k][1] for k in wanted if self.columns[k][0] is part}
            kinds = {number: wanted[k] for k, number in own.items()}
            columns = part.read({**kinds, 0: "time"})
            cells |= {k: columns[number] for k, number in own.items()}
        lengths = {len(one.values) for one in cells.values()}
        if len(lengths) > 1:
            counts = " and ".join(map(str, sorted(lengths)))
            raise UserError(
                f"{self.source}: its .out files have {counts} rows: they are not of one run"
            )
        return cells

    def cells(self, number: int) -> Sequence[str]:
        """The cells of a column, as its file has them."""
        part, own = self.columns[number]
        return part.cells(own)

    def place(self, row: int) -> str:
        """Where a row stands in the first file."""
        return self.parts[0].place(row)


def table(path: Path, form: TableForm) -> Results:
    """The results that a `.out` file is part of; raises `UserError` where no `.inf` file names its
    channels.
    """
    files.check_there(path)
    number = _NUMBERED.fullmatch(path.stem)
    case = number[1] if number else path.stem
    beside = files.list_folder(path.parent)
    names = next((each for each in beside if each.name.lower() == f"{case}.inf".lower()), None)
    if names is None:
        raise UserError(
            f"{path} is a simulator's output without names: PSCAD writes them to {case}.inf beside"
            " it, which is not there; export that of another simulator as .csv"
        )
    parts = [_read_columns(each, form) for each in beside if each == path or _is_part(each, number)]
    return Results(str(path), parts, _read_names(names, form.encoding))


def _is_part(path: Path, number: re.Match[str] | None) -> bool:
    """Whether a file holds channels of the case that another numbered one is of."""
    own = _NUMBERED.fullmatch(path.stem) if path.suffix.lower() == ENDING else None
    return own is not None and number is not None and own[1] == number[1]


def _read_columns(path: Path, form: TableForm) -> TextTable:
    """The columns of one file, below its title."""
    _, _, body = files.read(path).partition(b"\n")
    return open_text(str(path), b"\n" + body, TableForm(decimal=".", encoding=form.encoding))


def _read_names(path: Path, encoding: str | None) -> list[tuple[str, str]]:
    """(name, unit) of each channel, by their numbers."""
    text, _ = decode(files.read(path, LARGEST), str(path), encoding)
    every: dict[int, tuple[str, str]] = {}
    for match in _CHANNEL.finditer(text):
        fields = dict(_FIELD.findall(match[2]))
        every[int(match[1])] = (
            _name(fields.get("Desc", "").strip()),
            fields.get("Units", "").strip(),
        )
    return [every[number] for number in sorted(every)]


def _name(text: str) -> str:
    """A channel's name; an element of a vector by its phase: Va of Vabc:1."""
    match = _PHASE.fullmatch(text)
    return (
        text
        if match is None
        else f"{match[1] or match[3] or ''}{'abc'[int(match[2] or match[4]) - 1]}"
    )
