"""Tables of any shape: text, Parquet, Excel. What columns they have, and the numbers in those that
are wanted.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from types import ModuleType
from typing import Any, Self

import numpy as np

from tractexp.errors import DATA, UserError, check_choice, list_allowed, suggest_nearest
from tractexp.filetypes.cells import BadCell, find_group_mark, is_number, parse_numbers
from tractexp.filetypes.clock import is_time, parse_times
from tractexp.filetypes.column_unit import split_unit
from tractexp.filetypes.heading import TableHeading, check_column_count, find_heading
from tractexp.filetypes.reading_process import BadFile, ReadingProcess
from tractexp.storage import files
from tractexp.storage.files import locate_file

SPREADSHEETS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")  # how .xlsx, .ods and .xls begin
PARQUET = b"PAR1"
ENDINGS = (".csv", ".txt", ".tsv", ".parquet", ".pq", ".xlsx", ".xls", ".xlsb", ".ods", ".out")
# values of a table: a few bytes of a Parquet file may stand for millions
MOST_TABLE_VALUES = 200_000_000
FOREIGN = {  # how files begin that are no table, whatever they are called
    b"%PDF": "a PDF file",
    b"\x89PNG": "a picture",
    b"\x1f\x8b": "compressed; unpack it first",
    b"{": "JSON",
    b"\x89HDF": "an HDF5 file",
    b"SQLite": "a database",
    b"<": "XML or HTML; save the table as CSV",
    b"MATLAB": "a MATLAB file",
}


@dataclass(frozen=True)
class TableForm:
    """The user's settings of a table's format; what is not set is detected."""

    decimal: str = ""  # "." or ","
    header: int | None = None  # line of the names, from 1
    sheet: str | int | None = None  # of a workbook: name, or number from 1
    encoding: str | None = None
    join: tuple[str, ...] = ()  # further files of the same event

    def check(self) -> None:
        """Raise `UserError` for a decimal mark that is none, or a heading before line 1."""
        check_choice("data.decimal", self.decimal, ("", ".", ","))
        if self.header is not None and self.header < 1:
            raise UserError(f"{DATA.header}={self.header} is no line; lines are counted from 1")


@dataclass(frozen=True, eq=False)
class TableColumn:
    """The values (N,) of one column; of times, s since the first, with its date where the cells
    have one.
    """

    values: np.ndarray
    start: datetime | None = None
    clock: bool = False  # times of day or dates, not seconds
    begin: float = 0.0  # of a clock's times: the second of the day of the first
    # (row from 0, words) of what was mended in a clock's times
    remarks: tuple[tuple[int, str], ...] = ()


class TableFile(ABC):
    """An open file with columns: names and units are there, the numbers are read on demand."""

    source: str
    heading: TableHeading
    sample: Sequence[Sequence[Any]]  # the first rows of cells
    notes: tuple[str, ...] = ()
    start: datetime | None = None  # of t = 0, where the file says it beside its columns
    frequency: float | None = None  # Hz, nominal, where it does

    @abstractmethod
    def read(self, wanted: Mapping[int, str]) -> dict[int, TableColumn]:
        """Columns by number; `wanted` says of each "time", "number" or "gaps" (a number that may be
        missing).

        Raises `UserError` naming the place and the cell.
        """

    @abstractmethod
    def cells(self, number: int) -> Sequence[Any]:
        """The cells (N,) of a column as they stand in the file."""

    @abstractmethod
    def place(self, row: int) -> str:
        """Where a row of values, from 0, stands in the file: "line 17"."""

    def numbers(self, names: Sequence[str]) -> dict[str, np.ndarray]:
        """The columns (N,) of some names; raises `UserError` for one that is not there."""
        if missing := [name for name in names if name not in self.heading.names]:
            raise UserError(
                f"{self.source}: its sidecar names a column '{missing[0]}', which is not there"
            )
        wanted = {name: self.heading.names.index(name) for name in names}
        cells = self.read(dict.fromkeys(wanted.values(), "gaps")) if wanted else {}
        return {name: cells[number].values for name, number in wanted.items()}

    def label(self, number: int) -> str:
        """A column's name in messages."""
        return self.heading.names[number] or f"{number} (from 0)"

    def refuse(self, row: int, number: int, why: str) -> UserError:
        """The error that a cell is, with its place and column."""
        return UserError(f"{self.source}: {self.place(row)}, column {self.label(number)}: {why}")


@dataclass(eq=False)
class Rows(TableFile):
    """A table whose cells are at hand as Python's objects: a sheet, or columns of a
    Parquet file.
    """

    source: str
    heading: TableHeading
    columns: Callable[[int], Sequence[Any]]  # the cells of a column
    sample: Sequence[Sequence[Any]]
    first: int  # number of the first row of values, from 1
    word: str = "row"
    notes: tuple[str, ...] = field(default=())

    @classmethod
    def from_columns(
        cls,
        path: Path,
        columns: Sequence[tuple[str, str, np.ndarray]],
        first: int,
        notes: tuple[str, ...],
    ) -> Self:
        """A table of an instrument's samples, (name, unit, values) each column, the first one
        numbered `first`.
        """
        names, units, cells = zip(*columns, strict=True)
        sample = [list(row) for row in zip(*(c[:200].tolist() for c in cells), strict=True)]
        return cls(
            str(path),
            TableHeading(names, units, 0, 0),
            cells.__getitem__,
            sample,
            first,
            "sample",
            notes,
        )

    def cells(self, number: int) -> Sequence[Any]:
        """The cells of a column."""
        return self.columns(number)

    def place(self, row: int) -> str:
        """ "row 12", as the program counts that shows the table."""
        return f"{self.word} {self.first + row}"

    def read(self, wanted: Mapping[int, str]) -> dict[int, TableColumn]:
        """The wanted columns {number: kind}. Raises `UserError` with the place of a cell that
        cannot be read.
        """
        columns = {}
        for number, kind in wanted.items():
            try:
                columns[number] = parse_column(
                    self.columns(number), kind, ".", find_group_mark(self.sample, ".")
                )
            except BadCell as bad:
                raise self.refuse(bad.row, number, bad.why) from None
        return columns


def parse_column(cells: Sequence[Any], kind: str, decimal: str, group: str = "") -> TableColumn:
    """Cells as what is wanted of them; raises `BadCell`."""
    if isinstance(cells, np.ndarray) and cells.dtype.kind == "f":
        return TableColumn(cells)
    if kind == "time" and any(_is_clock(cell, decimal) for cell in cells[:1]):
        read = parse_times(cells)
        return TableColumn(read.values, read.start, True, read.begin, read.remarks)
    return TableColumn(parse_numbers(cells, decimal, kind == "gaps", group))


def _is_clock(cell: Any, decimal: str) -> bool:
    """Whether a cell of times is a clock's, or was meant as one: it has hours with a colon."""
    return not is_number(cell, decimal) and (is_time(cell) or ":" in str(cell))


def find_instrument(path: Path | str) -> ModuleType | None:
    """The module of the instrument whose file it is, by its beginning or ending; None for another
    file.

    It has `holds_waveforms`, and `table` for what else the instrument was set to record.
    """
    from tractexp.filetypes import cev, comtrade_table, pqdif

    return next((each for each in (pqdif, cev, comtrade_table) if each.recognizes(path)), None)


def open_table(path: str, form: TableForm, whole: bool = True) -> TableFile:
    """Open a table by what the file holds, whatever its ending; raises `UserError` for what is no
    table.

    Of a text not `whole` only the beginning is read: enough to know its columns.
    """
    from tractexp.filetypes import pscad
    from tractexp.filetypes.table_text import HEAD, open_text

    if form.join:
        from tractexp.filetypes.joined_table import JoinedTable

        alone = replace(form, join=())
        paths = (path, *form.join)
        return JoinedTable([open_table(one, alone) for one in paths], paths)

    if instrument := find_instrument(locate_file(path)):
        return instrument.table(locate_file(path), form.encoding)
    if Path(path).suffix.lower() == pscad.ENDING:
        return pscad.table(locate_file(path), form)
    data = read_content(path, None if whole else HEAD, whole=(PARQUET, *SPREADSHEETS))
    if data.startswith(PARQUET):
        return _read_parquet(path, data)
    if data.startswith(SPREADSHEETS):
        return _read_sheet(path, data, form)
    for mark, kind in FOREIGN.items():
        if data.startswith(mark):
            raise UserError(f"{path}: this is no table but {kind}")
    return open_text(path, data, form)


def read_content(path: str, limit: int | None = None, whole: tuple[bytes, ...] = ()) -> bytes:
    """The bytes of a file, or of one inside an installed package (`pkg://package/file.csv`); whole
    lines to a limit, but for files that begin as `whole` do.

    Raises `UserError` where it is not there.
    """
    file = locate_file(path)
    if not files.is_there(file):
        raise UserError(_describe_missing(path, file))
    data = files.read(file, limit)
    if limit is None or len(data) < limit:
        return data
    return files.read(file) if data.startswith(whole) else data[: data.rfind(b"\n") + 1] or data


def _describe_missing(path: str, file: Path) -> str:
    """The sentence on a file that is not there, with what to give in its place."""
    if file.is_dir():
        return f"{path} is a folder, not a file; give a file in it, or task=survey data.path={path}"
    folder = file.parent
    if not (folder.is_dir() or files.is_archive(folder)):
        hint = "; that folder does not exist"
    else:
        names = [item.name for item in files.list_folder(folder) if not item.is_dir()]
        hint = suggest_nearest(file.name, names)
    return f"{path}: there is no such file in {folder}{hint}"


def _read_parquet(path: str, data: bytes) -> TableFile:
    """A Parquet file as a table. Raises `UserError` for one that is damaged or too large."""
    try:
        with ReadingProcess("columns", data) as file:
            width, rows = file.content
            check_column_count(width, path)
            if (values := rows * width) > MOST_TABLE_VALUES:
                raise UserError(
                    f"{path}: {values:,} values are more than the {MOST_TABLE_VALUES:,} that can be"
                    " read; give a part of it"
                )
            named = file.read()
    except BadFile as bad:
        why = str(bad) or "not a whole Parquet file; write it again"
        raise UserError(f"{path}: {why}, or give the table as CSV") from bad
    columns = [cells for _, cells in named]
    parted = [split_unit(name) for name, _ in named]
    head = TableHeading(tuple(name for name, _ in parted), tuple(unit for _, unit in parted), 0, 0)
    sample = [list(row) for row in zip(*(c[:200] for c in columns), strict=False)]
    return Rows(path, head, columns.__getitem__, sample, first=1)


def _read_sheet(path: str, data: bytes, form: TableForm) -> TableFile:
    """One sheet of a workbook: the chosen one, else the first with rows of numbers."""
    try:
        with ReadingProcess("workbook", data) as book:
            return _choose_sheet(path, book, form)
    except BadFile as bad:
        why = str(bad) or "not a workbook that can be read; save it as .xlsx"
        raise UserError(f"{path}: {why}, or the sheet as CSV") from bad


def _choose_sheet(path: str, book: ReadingProcess, form: TableForm) -> TableFile:
    """The sheet that is named, else the first that can be read as a table."""
    names = book.content
    if form.sheet is not None:
        return _read_rows(path, book, _find_sheet_name(path, names, form.sheet), form)
    refused: list[UserError] = []
    for name in names:
        try:
            rows = _read_rows(path, book, name, form)
        except UserError as error:
            refused.append(error)
            continue
        others = [other for other in names if other != name]
        rows.notes = (
            (f"sheet '{name}' read, not {', '.join(others)} (data.sheet=NAME chooses)",)
            if others
            else ()
        )
        return rows
    raise refused[0] if refused else UserError(f"{path}: the workbook has no sheets")


def _find_sheet_name(path: str, names: Sequence[str], sheet: str | int) -> str:
    """The name of a sheet, given by its name or number. Raises `UserError` with those there are."""
    if str(sheet) in names:
        return str(sheet)
    if str(sheet).isdigit() and 1 <= int(sheet) <= len(names):
        return names[int(sheet) - 1]
    raise UserError(
        f"{DATA.sheet}={sheet}: {path} has no such sheet{list_allowed(sheet, names, 'Sheets')}"
    )


def _read_rows(path: str, book: ReadingProcess, name: str, form: TableForm) -> Rows:
    """A sheet as a table. Raises `UserError` where it cannot be read."""
    try:
        rows = book.read(name)
    except BadFile as bad:
        if str(bad):
            raise
        raise UserError(f"{path}: sheet '{name}' cannot be read; save it as CSV") from bad
    source = f"{path}: sheet '{name}'"
    filled = [i for i, row in enumerate(rows) if any(map(_is_filled, row))]
    if not filled:
        raise UserError(
            f"{source} is empty; it must have a line naming the columns, such as t, U, P, Q"
        )
    header = None if form.header is None else int(np.searchsorted(filled, form.header - 1))
    head = find_heading([_trim_row(rows[i]) for i in filled[:200]], source, header)
    body = filled[head.first :]
    last = body[-1] + 1
    return Rows(
        source,
        head,
        lambda number: [rows[i][number] for i in range(body[0], last)],
        [rows[i] for i in body[:200]],
        first=body[0] + 1,
    )


def _trim_row(row: Sequence[Any]) -> list[Any]:
    """A row without the empty cells at its end."""
    filled = [k for k, cell in enumerate(row) if _is_filled(cell)]
    return list(row[: filled[-1] + 1])


def _is_filled(cell: Any) -> bool:
    """Whether anything stands in a cell of a sheet."""
    return cell not in ("", None)
