"""Tables written as text: encoding, delimiter, decimal mark and heading are detected; NumPy reads
the numbers.

Where NumPy's reader refuses (times of day, words for gaps, quoted cells, a bad cell), the same rows
are read cell by cell, which is slower and names the place.
"""

import csv
import io
import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from operator import itemgetter
from typing import Any

import numpy as np

from tractexp.errors import UserError
from tractexp.filetypes.cells import (
    BadCell,
    find_group_mark,
    find_rising_group_mark,
    is_number,
    pick_group_mark,
)
from tractexp.filetypes.clock import is_time
from tractexp.filetypes.column_unit import split_unit
from tractexp.filetypes.heading import TableHeading, find_heading, is_value
from tractexp.filetypes.table import TableColumn, TableFile, TableForm, parse_column
from tractexp.filetypes.text import MARKS, decode
from tractexp.text.wording import count_noun

HEAD = 1 << 18  # bytes in which the heading is looked for
SAMPLE = 400  # lines of them, at most
LONGEST = 1 << 20  # bytes of a line
LINE_END = b"\n"
FEWEST_WHOLE = 3  # rows that a file keeps where its last line is left out
BLOCK = 20_000  # rows read cell by cell at a time
# a comma may be a decimal mark, a space stand within a name: they come last
DELIMITERS = (";", "\t", "|", ",", " ")
HEADER_MARK = re.compile(r"^\s*(%|//|!)+")  # before the names, as in a comment of another language
REMARK = re.compile(r"(^|\s)#(?!(N/?A|NV|VALUE!|NUM!|DIV/0!|REF!)\b).*", re.IGNORECASE)


class TextTable(TableFile):
    """A text file with rows of cells."""

    def __init__(
        self, source: str, data: bytes, form: TableForm, notes: Sequence[str] = ()
    ) -> None:
        """`data` is UTF-8. Raises `UserError` where it holds no table."""
        self.source, self.data = source, data
        lines = _list_lines(data[:HEAD], whole=len(data) <= HEAD)
        if not lines:
            raise UserError(
                f"{source}: the file is empty; it must start with a line naming the columns t,U,P,Q"
            )
        self.delimiter = _find_delimiter([text for _, text in lines])
        rows = [_cut_cells(text, self.delimiter) for _, text in lines]
        header = (
            None
            if form.header is None
            else next((k for k, (n, _) in enumerate(lines) if n >= form.header), 0)
        )
        self.heading = self._heading(rows, header)
        self.sample = rows[self.heading.first :]
        self.decimal, self.group = _detect_marks(self.sample, form.decimal)
        self.line = lines[self.heading.first][0]  # of the first row of values, from 1
        self.width = len(self.sample[0])
        self._lines: np.ndarray | None = None  # of the rows, where they were read cell by cell
        grouped = [
            f"digits are taken as grouped by '{self.group}', decimals marked by '{self.decimal}'"
        ]
        self.notes = (*notes, *(grouped if self.group else []))
        self._drop_cut_line()
        self._check_width()

    def _heading(self, rows: Sequence[Sequence[str]], header: int | None) -> TableHeading:
        """The heading; the last remark above the values where names stand in a comment, as NumPy
        writes them.
        """
        result = find_heading(rows, self.source, header)
        if result.line is not None or result.first:
            return result
        remarks = re.findall(rb"^\s*[#%]+[ \t]*(.*?)\r?$", self.data[:HEAD], re.MULTILINE)
        for remark in reversed(remarks):
            cells = _cut_cells(remark.decode(errors="replace"), self.delimiter)
            if len(cells) == len(rows[0]) and not any(map(is_number, cells)):
                names, units = zip(*map(split_unit, cells), strict=True)
                return TableHeading(names, units, 0, 0)
        return result

    def _check_width(self) -> None:
        """Refuse rows of more cells than names, for cells and names cannot be matched."""
        named = len([name for name in self.heading.names if name])
        spare = [cell for cell in self.sample[0][len(self.heading.names) :] if cell]
        # at decimal commas, as it seems
        split = self.width > named + 1 and self.width >= 1.5 * named
        if self.heading.line is not None and (spare or split):
            raise UserError(
                f"{self.source}: line {self.line} has {self.width} cells where the header line"
                f" names {named} columns"
                + (
                    "; if the decimal mark is a comma, save the file with another delimiter, such"
                    " as a semicolon"
                    if self.delimiter == ","
                    else ""
                )
            )

    def _drop_cut_line(self) -> None:
        """Note a last line that may be cut within its last number, half of which would be read as
        the value.

        It is whole where the file ends with a line end, or where its last cell has as many decimals
        as all others; it is left out where that has fewer than any other.
        """
        head, line_end, last = self.data.rpartition(b"\n")
        rows = head.count(b"\n") + 1 - self.line
        if not line_end or not last.strip() or rows < FEWEST_WHOLE:
            return
        before = head.split(b"\n")[self.line - 1 :] if rows < SAMPLE else head[-HEAD:].split(b"\n")
        decimals, others = self._count_last_decimals(last, before[-SAMPLE:])
        if decimals > 0 and others <= {decimals}:
            return
        said = (
            f"line {self.data.count(LINE_END) + 1}, the last one, has no line end and may be cut"
            " short"
        )
        if others and decimals < min(others):
            said += ": it is not used"
            self.data = head + line_end
        self.notes += (said,)

    def _count_last_decimals(self, last: bytes, before: Sequence[bytes]) -> tuple[int, set[int]]:
        """(decimals of the last cell of a line, those of the lines before with as many cells)."""
        cells, *others = [
            _cut_cells(text.decode(errors="replace"), self.delimiter) for text in (last, *before)
        ]
        counts = {
            _count_decimals(row[-1], self.decimal) for row in others if len(row) == len(cells)
        }
        return _count_decimals(cells[-1], self.decimal), counts

    def cells(self, number: int) -> list[str]:
        """The cells of a column."""
        return [row[number] for _, row in self._rows(number)]

    def place(self, row: int) -> str:
        """ "line 12" of the file; comments and blank lines count."""
        if self._lines is not None and row < len(self._lines):
            return f"line {self._lines[row]}"
        body = ((n, text) for n, text in enumerate(io.BytesIO(self.data), 1) if n >= self.line)
        rows = (n for n, text in body if text.partition(b"#")[0].strip())
        return f"line {next((n for k, n in enumerate(rows) if k == row), row)}"

    def read(self, wanted: Mapping[int, str]) -> dict[int, TableColumn]:
        """The wanted columns {number: kind}: all at once where they are plain numbers, else cell by
        cell.
        """
        clocks = [n for n, kind in wanted.items() if kind == "time" and self._is_clock(n)]
        columns = None if clocks or self.group else self._read_at_once(list(wanted))
        return self._read_cell_by_cell(wanted, clocks) if columns is None else columns

    def _is_clock(self, number: int) -> bool:
        """Whether a column holds times of the day."""
        cell = self.sample[0][number]
        return is_time(cell) and not is_number(cell, self.decimal)

    def _body(self) -> bytes:
        """The rows of values."""
        return self.data.split(b"\n", self.line - 1)[-1]

    def _read_at_once(self, wanted: Sequence[int]) -> dict[int, TableColumn] | None:
        """The columns, by NumPy's reader; None where it refuses, or rows differ in length."""
        if max(wanted) >= self.width:
            return None
        body = self._body()
        cells = body.count(self.delimiter.encode())
        if self.decimal == ",":
            body = body.replace(b",", b".")
        spaced = self.delimiter == " "
        delimiter, columns = (None, None) if spaced else (self.delimiter, wanted)
        text = io.TextIOWrapper(io.BytesIO(body), "utf-8")
        try:
            matrix = np.loadtxt(text, delimiter=delimiter, usecols=columns, ndmin=2)
        except (ValueError, OverflowError):
            return None
        if not len(matrix) or not (spaced or cells == len(matrix) * (self.width - 1)):
            return None
        if spaced:
            matrix = matrix[:, list(wanted)]
        return {number: TableColumn(matrix[:, k].copy()) for k, number in enumerate(wanted)}

    def _read_cell_by_cell(
        self, wanted: Mapping[int, str], clocks: Sequence[int]
    ) -> dict[int, TableColumn]:
        """The columns `wanted` {number: kind}, read in blocks of rows so that no file stands in
        memory as texts; those of `clocks`, which are times of the day, as a whole, for a time is
        read by what came before. Raises `UserError` naming line, column and cell.
        """
        texts: dict[int, list[str]] = {n: [] for n in clocks}
        kinds = {n: wanted[n] for n in wanted.keys() - texts.keys()}
        parts: dict[int, list[np.ndarray]] = {n: [np.empty(0)] for n in kinds}
        numbered = self._lines = np.empty(0, int)
        rows = self._rows(max(wanted))
        while block := list(itertools.islice(rows, BLOCK)):
            block_rows = list(map(itemgetter(1), block))
            first = len(numbered)
            numbered = self._lines = np.append(numbered, list(map(itemgetter(0), block)))
            for n, values in self._read_block(block_rows, kinds, first).items():
                parts[n].append(values)
            for n, cells in texts.items():
                cells += [row[n] for row in block_rows]
        columns = {n: TableColumn(np.concatenate(values)) for n, values in parts.items()}
        return columns | {n: self._read_clock(n, cells) for n, cells in texts.items()}

    def _read_block(
        self, rows: Sequence[Sequence[str]], kinds: Mapping[int, str], before: int
    ) -> dict[int, np.ndarray]:
        """The values (M,) of columns {number: kind} in rows that come after so many; raises
        `UserError` for the first cell of all that is none.
        """
        values = {}
        bad = list[tuple[int, int, str]]()
        for n, kind in kinds.items():
            try:
                values[n] = parse_column(
                    [row[n] for row in rows], kind, self.decimal, self.group
                ).values
            except BadCell as one:
                bad.append((before + one.row, n, one.why))
        if bad:
            raise self.refuse(*min(bad))
        return values

    def _read_clock(self, number: int, cells: Sequence[str]) -> TableColumn:
        """A column of times of day; raises `UserError` for a cell that is none."""
        try:
            return parse_column(cells, "time", self.decimal)
        except BadCell as one:
            raise self.refuse(one.row, number, one.why) from None

    def _rows(self, last: int) -> Iterator[tuple[int, list[str]]]:
        """The rows of cells with their lines; a last row that is cut short is skipped,
        with a note.
        """
        short: tuple[int, int] | None = None
        for line, row in _parse_rows(self._body(), self.delimiter, self.source, self.line):
            if short is not None:
                raise self._describe_ragged_line(*short)
            if len(row) <= last:
                short = (line, len(row))
                continue
            if len(row) > self.width and any(cell.strip() for cell in row[self.width :]):
                raise self._describe_ragged_line(line, len(row))
            yield line, row
        if short is not None:
            self.notes += (f"line {short[0]}, the last one, is cut short and not used",)

    def _describe_ragged_line(self, line: int, cells: int) -> UserError:
        """The error of a line with more or fewer cells than the others, or than the names."""
        named = len(self.heading.names)
        if cells == self.width != named:
            return UserError(
                f"{self.source}: the header line names {named} columns, and line {line} has"
                f" {count_noun(cells, 'cell')}: put a name that holds '{self.delimiter}' in quotes"
            )
        return UserError(
            f"{self.source}: line {line} has {count_noun(cells, 'cell')} where the others have"
            f" {self.width}; a gap in P or Q is written nan"
        )


def open_text(path: str, data: bytes, form: TableForm) -> TextTable:
    """A text file as a table; raises `UserError` for one that is not text, or holds no table."""
    text, codec = decode(data, path, form.encoding or _detect_unmarked_utf16(data))
    plain = codec.startswith("utf-8")
    data = (data if plain else text.encode()).removeprefix(b"\xef\xbb\xbf")
    del text
    data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if (nul := data.find(0)) >= 0:
        raise UserError(
            f"{path}: byte {nul + 1} is zero: this is no text; give a table as CSV, Parquet or"
            " Excel"
        )
    _check_lines(path, data)
    return TextTable(path, data, form, [] if plain else [f"read as {codec} text"])


def _check_lines(path: str, data: bytes) -> None:
    """Raise `UserError` for a line that is too long for a row."""
    begin = 0
    while begin + LONGEST < len(data):
        last = data.rfind(LINE_END, begin, begin + LONGEST + 1)
        if last < 0:
            end = data.find(LINE_END, begin)
            line = data.count(LINE_END, 0, begin) + 1
            length = (len(data) if end < 0 else end) - begin
            raise UserError(
                f"{path}: line {line} has {length:,} characters; a row of a table has at most"
                f" {LONGEST:,}"
            )
        begin = last + 1


def _detect_unmarked_utf16(data: bytes) -> str | None:
    """The UTF-16 of a text without a byte order mark: every other byte is zero."""
    for first, codec in ((1, "utf-16-le"), (0, "utf-16-be")):
        half = data[first:400:2]
        if not data.startswith(tuple(MARKS)) and len(half) > 10 and half.count(0) > 0.9 * len(half):
            return codec
    return None


def _list_lines(head: bytes, whole: bool) -> list[tuple[int, str]]:
    """The first lines that hold more than a remark, with their numbers from 1."""
    lines = head.decode(errors="replace").split("\n")
    lines = lines if whole else lines[:-1]
    bare = ((n, HEADER_MARK.sub("", REMARK.sub("", line))) for n, line in enumerate(lines, 1))
    return [(n, text) for n, text in bare if text.strip()][:SAMPLE]


def _find_delimiter(lines: Sequence[str]) -> str:
    """The mark that cuts most of the last lines into equally many values, two or more."""
    tail = lines[len(lines) // 2 :][-50:]

    def alike(mark: str) -> tuple[float, int]:
        rows = [_cut_cells(line, mark) for line in tail]
        width = max(set(map(len, rows)), key=[len(row) for row in rows].count)
        share = sum(len(row) == width for row in rows) / len(rows) if width > 1 else 0.0
        valued = any(sum(map(is_value, row)) >= 2 for row in rows)
        return (share if valued else share / 10), -DELIMITERS.index(mark)

    best = max(DELIMITERS, key=alike)
    return best if alike(best)[0] > 0 else ","


def _count_decimals(cell: str, mark: str) -> int:
    """How many characters stand behind a number's decimal mark, with its exponent; 0 where there is
    none.
    """
    return len(cell.strip().partition(mark)[2])


def _detect_marks(sample: Sequence[Sequence[str]], decimal: str) -> tuple[str, str]:
    """(decimal mark, the given one where there is one; mark between groups of digits, "" for
    none).
    """
    rising = "" if decimal else find_rising_group_mark(sample)
    if rising:
        return {".": ",", ",": "."}[rising], rising
    decimal = decimal or _find_decimal(sample)
    return decimal, find_group_mark(sample, decimal)


def _find_decimal(sample: Sequence[Sequence[str]]) -> str:
    """The decimal mark: a comma where more cells have one than a point."""
    cells = [cell for row in sample for cell in row]
    commas = sum(
        (is_number(cell, ",") and "," in cell) or pick_group_mark(cell, ",") == "."
        for cell in cells
    )
    points = sum(
        (is_number(cell) and "." in cell) or pick_group_mark(cell, ".") == "," for cell in cells
    )
    return "," if commas > points else "."


def _cut_cells(line: str, delimiter: str) -> list[str]:
    """The cells of one line, bare."""
    if delimiter == " ":
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        return [
            cell.strip()
            for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
        ]
    except csv.Error:
        return [cell.strip().strip('"') for cell in line.split(delimiter)]


def _parse_rows(
    body: bytes, delimiter: str, source: str, begin: int
) -> Iterator[tuple[int, list[str]]]:
    """The rows of values with their lines, without blank lines and remarks."""
    text = io.TextIOWrapper(io.BytesIO(body), "utf-8")
    lines: Any = (REMARK.sub("", line) if "#" in line else line for line in text)
    if delimiter == " ":
        yield from ((begin + k, row) for k, line in enumerate(lines) if (row := line.split()))
        return
    reader = csv.reader(lines, delimiter=delimiter, skipinitialspace=True, strict=True)
    try:
        for row in reader:
            if any(map(str.strip, row)):
                yield begin + reader.line_num - 1, row
    except csv.Error as error:
        line = begin + reader.line_num - 1
        raise UserError(
            f"{source}: line {line}: the cells cannot be separated; is a quote not closed?"
        ) from error
