"""The data (.dat) of a COMTRADE record: binary rows as views of the file, text rows parsed block by
block.

Nothing is allocated before the size of the file has shown that the announced samples are there.
"""

import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tractexp.errors import UserError
from tractexp.filetypes.comtrade_fields import parse_number, quote_field
from tractexp.filetypes.comtrade_header import VALUE
from tractexp.filetypes.comtrade_lines import Header
from tractexp.filetypes.remarks import Remarks
from tractexp.storage import files

LACKING = 0.01  # of the announced samples: so many may be missing at the end, with a note
LARGE = 64 * 2**20  # bytes: a larger binary file stays on the disk and is mapped
BLOCK = 8 * 2**20  # bytes of text parsed at once
HUGE = 1e38  # of a value: FLOAT32 holds no greater
NONE = 0xFFFFFFFF  # a missing time stamp


@dataclass(frozen=True)
class ByteRange:
    """Part of a file: bytes `first` to `stop`, of which the first is in line `line`."""

    path: Path
    first: int
    stop: int
    line: int = 1

    @property
    def size(self) -> int:
        """How many bytes it has."""
        return self.stop - self.first

    def content(self, length: int | None = None) -> bytes:
        """Its bytes, or the first `length` of them."""
        with files.open_ordinary_file(self.path) as file:
            file.seek(self.first)
            return file.read(self.size if length is None else min(length, self.size))

    def numbers(self, kind: np.dtype, count: int | None = None) -> np.ndarray:
        """Its first `count` values of a kind, all by default; those of a large file on the disk are
        mapped.
        """
        count = self.size // kind.itemsize if count is None else count
        if self.size > LARGE and not files.is_packed(self.path):
            return np.memmap(self.path, kind, "r", self.first, (count,))
        return np.frombuffer(self.content(), kind, count)

    def ends_a_line(self) -> bool:
        """Whether its last line ends as the others do."""
        with files.open_ordinary_file(self.path) as file:
            file.seek(max(self.first, self.stop - 4096))
            return file.read(min(self.size, 4096)).rstrip(b" \t\0\x1a").endswith((b"\n", b"\r"))


@dataclass(frozen=True, eq=False)
class Samples:
    """Columns of N samples as the file holds them."""

    numbers: np.ndarray  # (N,)
    stamps: np.ndarray  # (N,) in units of the time multiplier; nan or NONE where missing
    analogs: list[np.ndarray]  # (N,) each
    words: np.ndarray  # (N, ceil(D/16)) 16 status channels each


def build_row_type(kind: str, analogs: int, digitals: int) -> np.dtype:
    """The structure of one binary sample: number, time stamp, analog values and words of 16
    states.
    """
    words = -(-digitals // 16)
    return np.dtype(
        [("n", "<u4"), ("t", "<u4"), ("a", VALUE[kind], (analogs,)), ("d", "<u2", (words,))]
    )


def read(place: ByteRange, header: Header, remarks: Remarks) -> Samples:
    """The samples that the header announces; raises `UserError` where they are not there or not of
    that kind.
    """
    text = (
        re.fullmatch(rb"[0-9+\-.,eE \t\r\n]*", place.content(4096)) is not None and place.size > 0
    )
    if header.kind != "ASCII" and text:
        remarks.add(
            f"{header.kind} announced, but {place.path.name} is text and read as ASCII",
            header.lines["kind"],
        )
        header.kind = "ASCII"
    if header.kind == "ASCII":
        if b"\0" in place.content(4096).rstrip(b"\0\x1a"):
            raise UserError(
                f"{place.path}: not text, but line {header.lines['kind']} of the configuration says"
                " ASCII; write BINARY, BINARY32 or FLOAT32 there"
            )
        return _read_text(place, header, remarks)
    return _read_binary(place, header, remarks)


def _read_binary(place: ByteRange, header: Header, remarks: Remarks) -> Samples:
    """The samples of a binary file, without a copy; bytes over and samples short are noted or
    refused.
    """
    one = build_row_type(header.kind, len(header.analogs), len(header.digitals))
    count_there = place.size // one.itemsize
    _check_count(
        place, header, remarks, count_there, header.samples * one.itemsize, place.size, "bytes"
    )
    over = place.size - count_there * one.itemsize
    if over > 2:  # a line end or Ctrl-Z behind the data says nothing
        remarks.add(
            f"{place.path.name} holds {over} bytes more than whole samples of {one.itemsize} bytes"
        )
    count = header.samples
    table = place.numbers(one, count)
    _check_sample_numbers(place, header, table["n"])
    return Samples(
        table["n"], table["t"], [table["a"][:, k] for k in range(len(header.analogs))], table["d"]
    )


def _check_count(
    place: ByteRange,
    header: Header,
    remarks: Remarks,
    present: int,
    wanted: int,
    there: int,
    unit: str,
) -> None:
    """Compare the samples present with those announced: a few too few shorten the record."""
    announced = header.samples
    if present > announced:
        remarks.add(
            f"{place.path.name} holds {present} samples, {announced} are announced; the rest is not"
            " used"
        )
    if present >= announced:
        return
    if present < 1 or announced - present > max(1, LACKING * announced):
        raise UserError(
            f"{place.path}: cut short: {announced} samples of {len(header.analogs)} analog and"
            f" {len(header.digitals)} status channels take {wanted} {unit}, and the file has"
            f" {there}; get the whole file, or correct the last sample in line"
            f" {header.lines['rates']} of the configuration"
        )
    remarks.add(
        f"{place.path.name} holds {present} of the {announced} samples announced; those are read"
    )
    rates = [(rate, stop) for rate, stop in header.rates if stop < present]
    header.rates = [*rates, (header.rates[len(rates)][0], present)]


def _check_sample_numbers(place: ByteRange, header: Header, numbers: np.ndarray) -> None:
    """Sample numbers that do not count up show that the rows are not where the header puts them."""
    steps = np.diff(numbers).view(np.int32)  # a counter that runs over goes on by one, too
    if not len(steps):
        return
    usual = int(np.median(steps))
    odd = np.append(steps != usual, [True, True])  # what ends the file may be short
    wild = np.flatnonzero(odd[:-2] & odd[1:-1] & odd[2:])
    if len(wild) or abs(usual) > 10_000:
        i = int(wild[0]) if len(wild) else 0
        raise UserError(
            f"{place.path}: sample {i + 2}: its number is {numbers[i + 1]} after {numbers[i]}: the"
            f" rows are not {header.kind} of {len(header.analogs)} analog and"
            f" {len(header.digitals)} status channels, or bytes were lost or added before it;"
            " correct the channels or the type of the data file in the configuration, or get the"
            " file again"
        )


def _read_text(place: ByteRange, header: Header, remarks: Remarks) -> Samples:
    """The samples of an ASCII file, line by line."""
    width = 2 + len(header.analogs) + len(header.digitals)
    wanted = header.samples
    if place.size < 2 * width - 1:
        raise UserError(
            f"{place.path}: cut short: there is no sample of {width} cells in its {place.size}"
            " bytes"
        )
    room = min(wanted, place.size // (2 * width - 1) + 1)
    head = np.empty((room, 2))
    table = np.empty((room, len(header.analogs)), order="F")
    words = np.zeros((room, -(-len(header.digitals) // 16)), np.uint16)
    filled = 0
    for cells in _read_blocks(place, width, remarks):
        block = cells[: room - filled]
        there = slice(filled, filled + len(block))
        head[there], table[there] = block[:, :2], block[:, 2 : 2 + len(header.analogs)]
        words[there] = pack(np.nan_to_num(block[:, 2 + len(header.analogs) :]) != 0)
        filled += len(cells)
    # the state of a status channel is one digit, and whole
    if not header.digitals and not place.ends_a_line():
        remarks.add(f"{place.path.name} ends without a line end: its last value may be cut short")
    _check_count(place, header, remarks, filled, wanted, filled, "lines")
    count = header.samples
    if np.isnan(table[:count]).any():
        remarks.add(
            f"{int(np.isnan(table[:count]).sum())} empty cells in {place.path.name}: no value there"
        )
    _note_steps(place, head[:count, 0], remarks)
    return Samples(
        head[:count, 0],
        head[:count, 1],
        [_narrow(column[:count]) for column in table.T],
        words[:count],
    )


def _read_blocks(place: ByteRange, width: int, remarks: Remarks) -> Iterator[np.ndarray]:
    """Cells (M, width) of one block of lines after the other; nan where a cell is empty."""
    line, carried, remaining = place.line, b"", place.size
    with files.open_ordinary_file(place.path) as file:
        file.seek(place.first)
        while remaining > 0:
            block = file.read(min(BLOCK, remaining))
            remaining = remaining - len(block) if block else 0
            cut = len(block) if remaining == 0 else block.rfind(b"\n") + 1
            lines = (carried + block[:cut]).replace(b"\0", b"").splitlines()
            carried = block[cut:]
            yield _read_cells(place, width, lines, line, remaining == 0, remarks)
            line += len(lines)


def _read_cells(
    place: ByteRange, width: int, lines: list[bytes], first: int, last: bool, remarks: Remarks
) -> np.ndarray:
    """Numbers (rows, width) of the lines of an ASCII file, of which the first is numbered
    `first`.
    """
    numbered = [
        (n, text) for n, line in enumerate(lines, first) if (text := line.strip(b" \t\x1a"))
    ]
    if len(numbered) < len(lines) - last:
        remarks.add(f"blank lines in {place.path.name} are passed over")
    rows = _check_width(place, width, numbered, last, remarks)
    if not rows:
        return np.empty((0, width))
    flat = _parse_numbers(b",".join(text for _, text in rows), len(rows) * width)
    if flat is None:  # empty cells, or something that is no number
        flat = np.array(
            [
                _parse_cell(place, n, k, cell)
                for n, text in rows
                for k, cell in enumerate(text.split(b","))
            ]
        )
    return flat.reshape(-1, width)


def _check_width(
    place: ByteRange, width: int, numbered: list[tuple[int, bytes]], last: bool, remarks: Remarks
) -> list[tuple[int, bytes]]:
    """The numbered lines without commas too many at their ends, and without the file's `last` line
    where it is cut. Raises `UserError` for one with other cells than `width`.
    """
    rows = []
    for n, text in numbered:
        if text.count(b",") != width - 1:
            text = text.rstrip(b", \t")
        if text.count(b",") == width - 1:
            rows.append((n, text))
            continue
        if last and n == numbered[-1][0] and rows:
            remarks.add(f"{place.path.name} ends within a line, which is not used", None)
            break
        raise UserError(
            f"{place.path}: line {n}: {text.count(b',') + 1} cells, but {width} are announced:"
            " number, time, and one for each channel; correct the line, or the numbers of channels"
            " in the configuration"
        )
    return rows


def _parse_numbers(text: bytes, count: int) -> np.ndarray | None:
    """The numbers of a line; None where it has another count, or what is no number."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            values = np.fromstring(text, sep=",")
        except (DeprecationWarning, ValueError):
            return None
    return values if len(values) == count and (np.abs(values) <= HUGE).all() else None


def _parse_cell(place: ByteRange, line: int, k: int, cell: bytes) -> float:
    """The number of a cell, nan where it is empty. Raises `UserError` with line and channel for
    anything else.
    """
    text = cell.decode("latin-1").strip()
    value = np.nan if not text or text.lower() == "nan" else parse_number(text)
    if value is None or abs(value) > HUGE:
        what = ("sample number", "time stamp")[k] if k < 2 else f"channel {k - 1}"
        raise UserError(
            f"{place.path}: line {line}: {what} {quote_field(text)} is not a number, up to 1e38;"
            " correct it, or leave the cell empty for a missing value"
        )
    return value


def _note_steps(place: ByteRange, numbers: np.ndarray, remarks: Remarks) -> None:
    """Note a missing or double sample, which moves all after it; nothing is mended."""
    steps = np.diff(numbers)
    odd = np.flatnonzero(steps != np.median(steps)) if len(steps) else []
    if len(odd) and len(odd) < 0.5 * len(steps):
        i = int(odd[0])
        remarks.add(
            f"{place.path.name}: sample number {numbers[i + 1]:g} follows {numbers[i]:g}: a sample"
            " may be missing or double there, and times after it off by a step"
        )


def _narrow(column: np.ndarray) -> np.ndarray:
    """Whole numbers as integers of the fewest bytes; the values stay what they are."""
    if np.isnan(column).any() or (column != np.trunc(column)).any():
        return column.copy()
    least = column.min()
    greatest = column.max()
    for kind in (np.int16, np.int32):
        if np.iinfo(kind).min <= least and greatest <= np.iinfo(kind).max:
            return column.astype(kind)
    return column.copy()


def pack(states: np.ndarray) -> np.ndarray:
    """Pack states into words of 16 bits.

    Parameters
    ----------
    states : (N, D) bools
        Of D status channels.

    Returns
    -------
    (N, ceil(D/16)) ints
        The first channel is in the lowest bit.

    Examples
    --------
    >>> pack(np.array([[True, False, True]])).tolist()
    [[5]]
    """
    count = -(-states.shape[1] // 16)
    padded = np.zeros((len(states), 16 * count), bool)
    padded[:, : states.shape[1]] = states
    return np.packbits(padded, axis=1, bitorder="little").view("<u2").reshape(len(states), count)
