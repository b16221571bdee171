"""The text of an SEL event report: settings, names of columns, rows with their checksums."""

import csv
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tractexp.errors import UserError
from tractexp.filetypes.comtrade_fields import parse_number, quote_field
from tractexp.filetypes.comtrade_samples import HUGE
from tractexp.filetypes.remarks import Remarks

HEAD = 2000  # lines: the names of the columns stand among them


@dataclass
class EventReport:
    """Rows of the file by their meaning."""

    about: dict[str, str] = field(default_factory=dict)  # names over values: FID, date, summary
    columns: list[str] = field(default_factory=list)
    rows: list[tuple[int, list[str]]] = field(default_factory=list)  # line, cells of a sample
    settings: str = ""


def compute_checksum(text: str) -> str:
    """The checksum of a row up to its last comma: the sum of its bytes, as four hexadecimal digits.

    Examples
    --------
    >>> compute_checksum("AB")
    '0083'
    """
    return f"{sum(text.encode('latin-1', 'replace')) & 0xFFFF:04X}"


def read_report(path: Path, text: str, remarks: Remarks) -> EventReport:
    """The report of a file's text: settings, names of columns, rows of numbers; rows whose checksum
    fails are noted.
    """
    body, _, rest = re.sub(r"[\x02\x03\x1a\0]", "", text).partition('"SETTINGS"')
    report = EventReport(settings=rest.partition("\n")[2].strip())
    names: list[str] = []
    sums: list[bool] = []  # whether each row has its checksum
    for line, row in _join_quoted_rows(body):
        if line > HEAD and not report.columns:
            break
        cells, checked = _split_row(row, line, remarks)
        if not report.columns:
            names = _read_summary(report, names, list(map(str.strip, cells)), line, remarks)
            continue
        if not cells or cells[0].strip() == "FID":
            remarks.add("a second report in the file is not read", line)
            break
        report.rows.append((line, cells))
        sums.append(checked)
    if sums[-2:] == [True, False] and all(sums[:-1]):
        remarks.add("the file ends within a line, which is not used", report.rows.pop()[0])
    if not report.rows:
        raise UserError(
            f"{path}: no compressed event report: there is no row of column names with TRIG and"
            " samples below it; get it from the relay with the command CEV, or its COMTRADE file"
        )
    return report


def _split_row(row: str, line: int, remarks: Remarks) -> tuple[list[str], bool]:
    """(the cells of a row without its checksum, whether it has one); a remark where that does not
    fit.
    """
    try:
        cells = next(csv.reader([row], strict=False), [])
    except csv.Error:  # a cell without end
        cells = [row]
    if len(cells) < 2 or not re.fullmatch(r"[0-9A-Fa-f]{4}", cells[-1].strip()):
        return cells, False
    if compute_checksum(row[: row.rindex(",") + 1]) != cells[-1].strip().upper():
        remarks.add("the checksum does not fit: the line was altered, or damaged on its way", line)
    return cells[:-1], True


def _read_summary(
    report: EventReport, names: list[str], cells: list[str], line: int, remarks: Remarks
) -> list[str]:
    """Take in a row above the samples: their columns, or values below `names`. The names that the
    next row has values of; [] for none.
    """
    if "TRIG" in cells:
        report.columns = cells
    elif names:
        report.about |= zip(names, cells, strict=False)
    elif report.about or "FID" in cells:
        return cells
    else:
        remarks.add("text before the report is passed over", line)
    return []


def _join_quoted_rows(body: str) -> list[tuple[int, str]]:
    """Rows with the number of their first line; one with an open quotation goes on in the next
    line.
    """
    rows: list[tuple[int, str]] = []
    held, start = "", 0
    for line, text in enumerate(re.split(r"\r\n|\n|\r", body), 1):
        held, start = (held + text, start) if held else (text, line)
        if held.count('"') % 2 and len(held) < 100_000:
            continue
        if held.strip():
            rows.append((start, held.strip()))
        held = ""
    return rows if not held.strip() else [*rows, (start, held.strip())]


def read_samples(
    path: Path, report: EventReport, remarks: Remarks
) -> tuple[np.ndarray, list[str], list[str]]:
    """Values (N, columns), marks and hexadecimal words of the samples."""
    at = report.columns.index("TRIG")
    wanted = len(report.columns)
    values, marks, words = [], [], []
    for k, (line, cells) in enumerate(report.rows):
        if len(cells) not in (wanted, wanted - 1):
            if k and k == len(report.rows) - 1:
                remarks.add("the file ends within a line, which is not used", line)
                break
            raise UserError(
                f"{path}: line {line}: {len(cells)} cells, but {wanted} columns are named; correct"
                " the line, or get the file from the relay again"
            )
        values.append(
            [
                _parse_value(path, line, name, cell)
                for name, cell in zip(report.columns[:at], cells, strict=False)
            ]
        )
        marks.append(cells[at])
        words.append(cells[at + 1].strip() if len(cells) > at + 1 else "")
    return np.array(values, float).reshape(len(values), at), marks, words


def _parse_value(path: Path, line: int, name: str, cell: str) -> float:
    """The number of a cell; nan where the relay wrote none. Raises `UserError` for anything
    else.
    """
    value = parse_number(cell) if cell.strip() else float("nan")
    if value is None and (name == "*" or not set(cell.strip()) - {"$", "*", "-"}):
        return float("nan")  # so the relay writes a missing value
    if value is None or abs(value) > HUGE:
        raise UserError(
            f"{path}: line {line}: {name or 'column'} {quote_field(cell)} is not a number, up to"
            " 1e38; correct it"
        )
    return value


def find_marked_row(marks: list[str], signs: str) -> int | None:
    """The first row with the first of some signs that a row has; None where none has."""
    rows = (i for sign in signs for i, mark in enumerate(marks) if sign in mark)
    return next(rows, None)
