"""Cells of a table as times by a clock, whatever way they are written.

2024-03-31T01:59:59.900+01:00 31.03.2024 14:00:07,250 03/01/2024 10:15:30.25 PM 23:59:60.5
14:00:07.25 20240331T015959.9 Sun Mar 31 01:59:59 2024

Clocks are set back and forth, in autumn and spring and otherwise, and have leap seconds; dates are
written day before month, and month before day. What one cell leaves open, the column decides.
"""

import datetime as dt
import functools
import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.filetypes.cells import BadCell, quote_cell

DAYS = (
    "%Y-%m-%d",
    "%Y/%m/%d",
    "%Y.%m.%d",
    "%Y%m%d",
    "%d.%m.%Y",
    "%d/%m/%Y",
    "%m/%d/%Y",
    "%d-%m-%Y",
    "%m-%d-%Y",
    "%d.%m.%y",
    "%d/%m/%y",
    "%m/%d/%y",
    "%d-%b-%Y",
    "%d %b %Y",
    "%b %d, %Y",
    "%d-%b-%y",
    "%Y年%m月%d日",
)
CLOCK = re.compile(
    r"\s*(?:(?P<day>\S.*?)[T\s]+)?(?:(?P<h>\d{1,2}):)?(?P<m>\d{1,2}):"
    r"(?P<s>\d{1,2}(?:[.,]\d*|(?<=:\d\d:\d\d):\d{3})?)"
    r"(?:\s*(?P<half>[AaPp])\.?[Mm]\.?)?\s*(?P<zone>Z|UTC|GMT|[+-]\d{2}:?\d{2}|[+-]\d{2})?\s*"
)
# times that are written otherwise, and how `CLOCK` knows them: the basic form of ISO 8601, that of
# C's asctime, hours with their units, and those after the day of a year that IRIG counts
REWRITTEN = (
    (re.compile(r"\s*(\d{8}T\d\d)(\d\d)(\d\d(?:[.,]\d+)?\S*)\s*"), r"\1:\2:\3"),
    (re.compile(r"\s*[A-Z][a-z]{2} ([A-Z][a-z]{2}) +(\d+) ([\d:.]+) (\d{4})\s*"), r"\1 \2, \4 \3"),
    (
        re.compile(r"\s*(.*?)\s*(\d\d?)[时時h](\d\d?)[分m](\d\d?(?:[.,]\d+)?)[秒s]?\s*"),
        r"\1 \2:\3:\4",
    ),
    (re.compile(r"\s*\d{3}:(\d\d:\d\d:\d\d(?:[.,]\d+)?)\s*"), r"\1"),
)
DAY, HOUR = 86400.0, 3600.0  # s
SWAPPED = 3.0  # steps: rows that go back by no more may have been exchanged
# s: by more no clock is set back; rows that go farther back are of another record
SET_BACK = 2 * HOUR
LATEST_SUMMER = 4.0  # hour of the day after which no clock is set forth for the summer


@dataclass(frozen=True)
class ClockTimes:
    """Times (N,) [s] since the first cell, `start`, its date and time where cells have dates, and
    what was mended.

    `remarks` are (row from 0, words) of what a column left open or a clock did.
    """

    values: np.ndarray
    start: dt.datetime | None = None
    remarks: tuple[tuple[int, str], ...] = ()
    begin: float = 0.0  # s of the day of the first


@dataclass(frozen=True)
class _Moment:
    """One cell: the text of its day, or the day; the second of it; whether AM or PM is written, and
    the zone that is.
    """

    day: str | dt.date | None
    second: float
    half: bool = False
    zone: str = ""
    leap: bool = False  # a second of which the minute has 61


def is_time(cell: Any) -> bool:
    """Whether a cell is a time of day or a date with one."""
    return isinstance(cell, dt.datetime | dt.time) or (
        isinstance(cell, str) and _match_clock(cell) is not None
    )


def is_date(cell: Any) -> bool:
    """Whether a cell is a day without a time."""
    if not isinstance(cell, str):
        return isinstance(cell, dt.date)
    return any(_parse_day(cell.strip(), form) is not None for form in DAYS)


def find_first_day(cells: Sequence[Any]) -> dt.date | None:
    """The day of the first of some cells that are dates, read as all of them can be; None where
    they are none.
    """
    try:
        texts = [cell.strip() if isinstance(cell, str) else cell for cell in cells]
        return _resolve_dates(texts, american=False)[0][texts[0]]
    except (BadCell, IndexError, KeyError, TypeError):
        return None


def parse_times(cells: Sequence[Any]) -> ClockTimes:
    """The times of cells. Those without a date run on past midnight, those without hours past the
    full hour; leap seconds, and jumps of a clock that was set, are taken out.

    Raises `BadCell` for what is no time.
    """
    if not len(cells):
        return ClockTimes(np.empty(0))
    moments = [_parse_moment(cell, row) for row, cell in enumerate(cells)]
    _check_dates(moments, cells)
    clock = np.array([one.second for one in moments])
    if moments[0].day is not None:
        seconds, start, remarks = _add_days(moments, clock)
    else:
        seconds, start, remarks = _unwrap_clock(clock, cells[0]), None, []
    seconds = seconds + _count_leap_seconds(moments)
    has_zone = any(one.zone for one in moments)
    seconds, jumps = _take_out_jumps(seconds, np.full(len(cells), np.inf) if has_zone else clock)
    if _parse_offset(zone := moments[0].zone):
        remarks.append((0, f"times are told in UTC, and the file's are those of UTC{zone}"))
    return ClockTimes(seconds - seconds[0], start, (*remarks, *jumps), moments[0].second)


def _unwrap_clock(clock: np.ndarray, first: Any) -> np.ndarray:
    """Seconds (N,) that run on where a clock begins anew: each day, or each hour where the `first`
    cell has no hours.
    """
    turn = HOUR if isinstance(first, str) and first.count(":") == 1 else DAY
    return clock + turn * np.cumsum(np.diff(clock, prepend=clock[0]) < -turn / 2)


def _count_leap_seconds(moments: Sequence[_Moment]) -> np.ndarray:
    """How many leap seconds (N,) are over by each moment."""
    leap = np.array([one.leap for one in moments])
    return np.cumsum(np.concatenate(([False], leap[:-1] & ~leap[1:])))


def _check_dates(moments: Sequence[_Moment], cells: Sequence[Any]) -> None:
    """Raise `BadCell` where some cells have a date and others none."""
    dated = moments[0].day is not None
    for row, one in enumerate(moments):
        if (one.day is not None) != dated:
            lack = "lacks" if dated else "has"
            raise BadCell(row, f"{quote_cell(cells[row])} {lack} a date, unlike the first row")


def _add_days(
    moments: Sequence[_Moment], clock: np.ndarray
) -> tuple[np.ndarray, dt.datetime, list[tuple[int, str]]]:
    """(seconds (N,) since the midnight before the first moment, the first moment, what is said of
    dates that can be read in several ways); `clock` (N,) are the seconds of the day.
    """
    days, remarks = _resolve_dates([one.day for one in moments], any(one.half for one in moments))
    dates = [days[one.day] for one in moments]
    since = np.array([(date - dates[0]).days * DAY for date in dates])
    start = dt.datetime.combine(dates[0], dt.time()) + dt.timedelta(seconds=clock[0])
    return clock + since, start, remarks


def _take_out_jumps(
    seconds: np.ndarray, local: np.ndarray
) -> tuple[np.ndarray, list[tuple[int, str]]]:
    """Times (N,) [s] without the jumps of a clock that was set, and what is said of each.

    `local` (N,) are the seconds of the day by which an hour that is left out in spring is known;
    infinite for times of a zone, which leave out none.
    """
    steps = np.diff(seconds)
    remarks = list[tuple[int, str]]()
    usual = float(np.median(steps)) if len(steps) else 0.0
    if usual <= 0:
        return seconds, []
    shifts = np.zeros(len(seconds))
    back = list[float]()
    for k in np.flatnonzero((steps < 0) | (steps > 2 * usual)):
        jump = float(steps[k]) - usual
        forth = _match_jump(jump, usual, [*back, HOUR] if local[k] / HOUR < LATEST_SUMMER else back)
        if -SET_BACK <= jump < -SWAPPED * usual:
            back.append(-jump)
            way = "back"
        elif jump > 0 and forth:
            back = [each for each in back if each != forth]
            way = "forth"
        else:
            continue
        said = f"the clock was set {way} by {abs(jump):.6g} s here: times run on"
        remarks.append((int(k) + 1, said))
        shifts[k + 1] = -jump
    return seconds + np.cumsum(shifts), remarks


def _match_jump(jump: float, usual: float, expected: Sequence[float]) -> float:
    """The first of the times [s] by which a clock is expected to be set forth that a jump is, but
    for a usual step; 0 for none.
    """
    return next((each for each in expected if abs(each - jump) <= usual), 0.0)


def _parse_moment(cell: Any, row: int) -> _Moment:
    """The moment in a cell, with a zone that of UTC; raises `BadCell`."""
    moment = _read_text(cell, row) if isinstance(cell, str) else _read_object(cell)
    if moment is None:
        raise BadCell(
            row, f"{quote_cell(cell)} is no time, such as 12:00:00.25 or 2024-03-31T12:00:00.25"
        )
    return moment


def _read_object(cell: Any) -> _Moment | None:
    """The moment in a cell that is no text, a date's its midnight; None where it is no time."""
    if isinstance(cell, dt.datetime | dt.time):
        second = cell.hour * 3600 + cell.minute * 60 + cell.second + cell.microsecond * 1e-6
        return _Moment(cell.date() if isinstance(cell, dt.datetime) else None, second)
    return _Moment(cell, 0.0) if isinstance(cell, dt.date) else None


def _match_clock(cell: str) -> re.Match[str] | None:
    """The parts of a text that is a time; None of one that is none."""
    if (match := CLOCK.fullmatch(cell)) is not None:
        return match
    for pattern, usual in REWRITTEN:
        if pattern.fullmatch(cell):
            return CLOCK.fullmatch(pattern.sub(usual, cell))
    return None


def _read_text(cell: str, row: int) -> _Moment | None:
    """The moment in a text; None where it is no time. Raises `BadCell` for one with a wrong
    part.
    """
    match = _match_clock(cell)
    if match is None:
        return None
    hours = int(match["h"] or 0)
    minutes = int(match["m"])
    second = float(match["s"].replace(",", ".").replace(":", "."))
    if hours > 24 or minutes > 59 or second >= 61:
        raise BadCell(row, f"{quote_cell(cell)} is no time of a day")
    if match["half"]:
        hours = hours % 12 + 12 * (match["half"] in "Pp")
    day = (match["day"] or "").strip() or None
    if day and not is_date(day):
        raise BadCell(row, f"{quote_cell(day)} is no date; write it as 2024-03-31")
    total = hours * 3600 + minutes * 60 + second - _parse_offset(match["zone"])
    return _Moment(day, total, bool(match["half"]), match["zone"] or "", second >= 60)


def _parse_offset(zone: str | None) -> float:
    """Seconds by which a zone is ahead of UTC."""
    if not zone or zone in ("Z", "UTC", "GMT"):
        return 0.0
    digits = zone[1:].replace(":", "").ljust(4, "0")
    return (1 if zone[0] == "+" else -1) * (int(digits[:2]) * 3600 + int(digits[2:]) * 60)


def _resolve_dates(
    days: Sequence[Any], american: bool
) -> tuple[dict[Any, dt.date], list[tuple[int, str]]]:
    """{day as written: the day}, all read in one way, and what is said where several ways would do.

    Raises `BadCell` where no way reads all.
    """
    rows = {day: row for row, day in reversed([*enumerate(days)])}
    known: dict[Any, dt.date] = {day: day for day in rows if isinstance(day, dt.date)}
    texts = [day for day in reversed(rows) if isinstance(day, str)]
    if not texts:
        return known, []
    ways = _read_in_each_way(texts)
    if not ways:
        odd = next(itertools.filterfalse(is_date, texts), texts[-1])
        raise BadCell(
            rows[odd],
            f"{quote_cell(odd)} is no date, or not written as those before; write it as 2024-03-31",
        )
    form, why = _choose_way(ways, american)
    known |= zip(texts, ways[form], strict=True)
    if len(ways) == 1:
        return known, []
    how = "month before day" if form.startswith("%m") else "day before month"
    said = (
        f"'{texts[0]}' is read as {known[texts[0]]:%d %B %Y}, {how}, {why}; dates as 2024-03-31"
        " leave nothing open"
    )
    return known, [(rows[texts[0]], said)]


def _read_in_each_way(texts: Sequence[str]) -> dict[str, list[dt.date]]:
    """{way of writing: the days that texts name so}, of the ways that read all, each reading
    once.
    """
    ways: dict[str, list[dt.date]] = {}
    for form in DAYS:
        dates = [day for text in texts if (day := _parse_day(text, form)) is not None]
        if len(dates) == len(texts) and dates not in ways.values():
            ways[form] = dates
    return ways


def _choose_way(ways: Mapping[str, Sequence[dt.date]], american: bool) -> tuple[str, str]:
    """(the way in which dates are read, why): that in which the days run on best; where that
    leaves it open, month before day where the times have AM or PM (`american`), else day before
    month.
    """
    spans = {
        form: sum(abs((b - a).days) for a, b in itertools.pairwise(dates))
        for form, dates in ways.items()
    }
    likely = [form for form in ways if spans[form] == min(spans.values())]
    if len(likely) == 1:
        return likely[0], "as the days run on"
    if not american:
        return likely[0], "as is usual"
    return max(likely, key=lambda form: form.startswith("%m")), "as with AM and PM"


@functools.lru_cache(maxsize=4096)
def _parse_day(text: str, form: str) -> dt.date | None:
    """The day that a text names in one way of writing; None for no day."""
    try:
        return dt.datetime.strptime(text, form).date()
    except ValueError:
        return None
