"""Cells of a table as numbers and as times, whatever way they are written.

1.25   -1,25   1.0D-3   nan   #N/A   -         2024-03-31T01:59:59.900+01:00   31.03.2024 14:00:07,250   14:00:07.25
"""

import datetime as dt
import functools
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

# What programs write where there is no value
GAPS = frozenset((
    "", "-", "--", "---", "nan", "na", "n/a", "#n/a", "#na", "#nv", "#value!", "#num!", "#div/0!", "#ref!", "null",
    "none", "nil", "missing", "no data", "nodata", "bad", "*", "?", "1.#qnan", "-1.#ind", "1.#ind",
))  # fmt: skip
DAYS = (
    "%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%Y%m%d", "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y",
    "%d.%m.%y", "%m/%d/%y", "%d-%b-%Y", "%d %b %Y", "%Y年%m月%d日",
)  # fmt: skip
CLOCK = re.compile(
    r"\s*(?:(?P<day>\S.*?)[T\s]+)?(?:(?P<h>\d{1,2}):)?(?P<m>\d{1,2}):(?P<s>\d{1,2}(?:[.,]\d*)?)"
    r"(?:\s*(?P<half>[AaPp])[Mm])?\s*(?P<zone>Z|UTC|GMT|[+-]\d{2}:?\d{2}|[+-]\d{2})?\s*"
)
DAY, HOUR = 86400.0, 3600.0  # s


class BadCell(Exception):
    """Cell `row` of a column is no number or no time; `why` ends the sentence that the place begins."""

    def __init__(self, row: int, why: str) -> None:
        super().__init__(row, why)
        self.row, self.why = row, why


def is_gap(cell: Any) -> bool:
    """Whether a cell stands for a missing value."""
    return cell is None or (isinstance(cell, str) and cell.strip().lower() in GAPS)


def is_number(cell: Any, decimal: str = ".") -> bool:
    """Whether a cell is a number, written with that decimal mark."""
    try:
        _number(cell, decimal)
    except ValueError:
        return False
    return True


def is_time(cell: Any) -> bool:
    """Whether a cell is a time of day or a date with one."""
    return isinstance(cell, dt.datetime | dt.time) or (isinstance(cell, str) and CLOCK.fullmatch(cell) is not None)


def is_date(cell: Any) -> bool:
    """Whether a cell is a day without a time."""
    return isinstance(cell, dt.date) if not isinstance(cell, str) else _day(cell.strip()) is not None


def numbers(cells: Sequence[Any], decimal: str = ".", gaps: bool = False) -> np.ndarray:
    """The numbers (N,) of cells, nan for a gap where `gaps` are allowed; raises `BadCell` for what is neither."""
    values = np.empty(len(cells))
    for row, cell in enumerate(cells):
        try:
            values[row] = _number(cell, decimal)
        except ValueError:
            if not is_gap(cell):
                raise BadCell(row, f"{_quoted(cell)} is not a number{_comma(str(cell), decimal)}") from None
            if not gaps:
                what = f"{_quoted(cell)} stands for no value" if cell and str(cell).strip() else "the cell is empty"
                raise BadCell(row, f"{what}; only P and Q may have gaps") from None
            values[row] = np.nan
    return values


def _quoted(cell: Any) -> str:
    """A cell in a message: of a list, of bytes or of a long text its beginning."""
    return f"'{cell!s:.40}'"


def _number(cell: Any, decimal: str) -> float:
    """The number that a cell is; raises `ValueError`."""
    if isinstance(cell, int | float) and not isinstance(cell, bool):
        return float(cell)
    if not isinstance(cell, str) or "_" in cell:
        raise ValueError
    text = cell.strip()
    if decimal == "," and "." not in text:
        text = text.replace(",", ".")
    try:
        return float(text)
    except ValueError:
        return float(text.replace("−", "-").replace("D", "e").replace("d", "e"))


def _comma(cell: str, decimal: str) -> str:
    """A remark on a decimal mark that is not the one of the file."""
    other = {".": ",", ",": "."}[decimal]
    return f" (decimals are written with '{decimal}' in this file)" if is_number(cell, other) else ""


def times(cells: Sequence[Any]) -> tuple[np.ndarray, dt.datetime | None]:
    """Times (N,) [s] since the first cell, and its date and time, where the cells name the day.

    Times of day run on past midnight, those without hours past the full hour. Raises `BadCell` for what is no time.
    """
    seconds_of_rows, start = np.empty(len(cells)), None
    if not len(cells):
        return seconds_of_rows, start
    first, begin = _moment(cells[0], 0)
    for row, cell in enumerate(cells):
        day, seconds = _moment(cell, row)
        seconds_of_rows[row] = seconds
        if (day is None) != (first is None):
            raise BadCell(row, f"{_quoted(cell)} {'lacks' if day is None else 'has'} a date, unlike the first row")
        if day is not None and first is not None:
            seconds_of_rows[row] += (day - first).days * DAY
    if first is not None:
        start = dt.datetime.combine(first, dt.time()) + dt.timedelta(seconds=begin)
    else:
        turn = HOUR if isinstance(cells[0], str) and cells[0].count(":") == 1 else DAY
        seconds_of_rows += turn * np.cumsum(np.diff(seconds_of_rows, prepend=seconds_of_rows[0]) < -turn / 2)
    return seconds_of_rows - seconds_of_rows[0], start


def _moment(cell: Any, row: int) -> tuple[dt.date | None, float]:
    """Day and second of the day; with a zone, those of UTC."""
    if isinstance(cell, dt.datetime | dt.time):
        seconds = cell.hour * 3600 + cell.minute * 60 + cell.second + cell.microsecond * 1e-6
        return (cell.date() if isinstance(cell, dt.datetime) else None), seconds
    if isinstance(cell, dt.date):
        return cell, 0.0  # a sheet's midnight
    match = CLOCK.fullmatch(cell) if isinstance(cell, str) else None
    if match is None:
        raise BadCell(row, f"{_quoted(cell)} is no time, such as 12:00:00.25 or 2024-03-31T12:00:00.25")
    day = _day(match["day"]) if match["day"] else None
    if match["day"] and day is None:
        raise BadCell(row, f"{_quoted(match['day'])} is no date; write it as 2024-03-31")
    hours, minutes, seconds = int(match["h"] or 0), int(match["m"]), float(match["s"].replace(",", "."))
    if hours > 24 or minutes > 59 or seconds >= 61:
        raise BadCell(row, f"{_quoted(cell)} is no time of a day")
    if match["half"]:
        hours = hours % 12 + 12 * (match["half"] in "Pp")
    return day, hours * 3600 + minutes * 60 + seconds - _offset(match["zone"])


def _offset(zone: str | None) -> float:
    """Seconds by which a zone is ahead of UTC."""
    if zone is None or zone in ("Z", "UTC", "GMT"):
        return 0.0
    digits = zone[1:].replace(":", "").ljust(4, "0")
    return (1 if zone[0] == "+" else -1) * (int(digits[:2]) * 3600 + int(digits[2:]) * 60)


@functools.lru_cache(maxsize=4096)
def _day(text: str) -> dt.date | None:
    """The day that a text names, day before month where both would do; None for no day."""
    for form in DAYS:
        try:
            return dt.datetime.strptime(text.strip(), form).date()
        except ValueError:
            continue
    return None
