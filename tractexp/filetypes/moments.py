"""The times of a table in seconds since its first row, and when that was.

A column of times is a clock's, seconds or another unit, days as spreadsheets count them, seconds
since 1970, or whole seconds with their fraction in a second column (SOC and FRACSEC of IEEE
C37.118).
"""

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from tractexp.errors import DATA, UserError
from tractexp.filetypes.column_unit import find_factor
from tractexp.filetypes.mapping import Mapped
from tractexp.filetypes.table import TableColumn, TableFile

EPOCH = 1e6  # s: times beyond it are counted from the first
LATEST = 2.6e9  # s since 1970, of a record: 2052
EARLIEST = 3e8  # s since 1970, of a record: 1979
# {unit of times: how many times larger than s they are at least}
SINCE_1970 = {"ms": 1.0, "us": 1e3, "ns": 1e6}
ZERO_DAY = dt.datetime(1899, 12, 30)  # of spreadsheets
SERIAL_DAYS = (20_000.0, 80_000.0)  # days of a spreadsheet: 1954 to 2119
# {since when days are counted: by how many they are more than those of spreadsheets}
DAYS_SINCE = {"1899": 0.0, "the year 0": 693_960.0}
# {since when tenths of a microsecond are counted: s to 1970}
TICKS_SINCE = {"1601": 11_644_473_600.0, "the year 1": 62_135_596_800.0}
TICK_SECONDS = 1e-7  # s
# Hz: what is sampled faster by its times has them in days
FASTEST = {"powers": 2e3, "phasors": 2e3, "waves": 1e6}
SECONDS_A_DAY = 86400.0  # s
# a fraction of a second is counted in 24 bits, above which stands the quality of the clock
COUNTED = 1 << 24


@dataclass(frozen=True)
class TableTimes:
    """Times (N,) [s], the moment of t = 0 where it is known, and notes on how they were read."""

    t: np.ndarray
    start: dt.datetime | None
    notes: tuple[str, ...]


def compute_times(
    table: TableFile, mapping: Mapped, cells: Mapping[int, TableColumn]
) -> TableTimes:
    """The times of a table, of which `cells` are the columns that were read.

    Without a unit, numbers too large for seconds since 1970 are its milli-, micro- or nanoseconds.
    Raises `UserError` where the digits of times in days are too few.
    """
    one = mapping.columns["t"]
    time = cells[one.number]
    if time.clock:
        result = _read_clock_times(table, mapping, time)
    elif time.start is None and len(time.values):
        result = _read_numeric_times(table, time.values, one.role.unit, FASTEST[mapping.kind])
    else:
        result = TableTimes(time.values, None, ())
    if "frac" in mapping.columns:
        result = _add_fractions(
            table, mapping, result, cells[mapping.columns["frac"].number].values
        )
    if result.start is None and table.start is not None:
        result = replace(result, start=table.start + dt.timedelta(seconds=float(result.t[0])))
    return result


def _read_clock_times(table: TableFile, mapping: Mapped, time: TableColumn) -> TableTimes:
    """Times of day, with the date that they have or that stands in a column of its own."""
    start = time.start
    if start is None and mapping.day is not None:
        start = _find_midnight(mapping.day) + dt.timedelta(seconds=time.begin)
    said = [f"{table.place(row)}: {words}" for row, words in time.remarks]
    if start is not None:
        said.append(f"t counted from {start.isoformat()}, the first row")
    return TableTimes(time.values, start, tuple(said))


def _find_midnight(day: dt.date) -> dt.datetime:
    """The first moment of a day."""
    return dt.datetime.combine(day, dt.time())


def _read_numeric_times(
    table: TableFile, values: np.ndarray, unit: str, fastest: float
) -> TableTimes:
    """Times that are numbers."""
    first = float(values[0])
    if not unit and (counted := _read_days(table, values, fastest) or _read_ticks(values, fastest)):
        return counted
    since = next(
        (u for u, by in SINCE_1970.items() if by * LATEST < abs(first) <= 1e3 * by * LATEST), ""
    )
    if not unit and since:
        note = (
            f"t is in {since} since 1970 by its size: counted from {first:.0f} {since}, the first"
            " row"
        )
        return TableTimes(
            (values - first) * find_factor(since),
            _convert_seconds(first * find_factor(since)),
            (note,),
        )
    t = values * find_factor(unit)
    if abs(t[0]) > EPOCH:
        note = f"t counted from {t[0]:.6f} s, the first row"
        return TableTimes(t - t[0], _convert_seconds(float(t[0])), (note,))
    return TableTimes(t, None, ())


def _convert_seconds(seconds: float) -> dt.datetime | None:
    """The moment, in UTC, so many seconds after 1970; None where no record is so old or so new."""
    if not EARLIEST <= seconds <= LATEST:
        return None
    return dt.datetime(1970, 1, 1) + dt.timedelta(seconds=seconds)


def _read_ticks(values: np.ndarray, fastest: float) -> TableTimes | None:
    """Times in tenths of a microsecond, as Windows and .NET count them; None for others."""
    first = float(values[0])
    span = float(values[-1] - values[0])
    for since, before in TICKS_SINCE.items():
        begun = first * TICK_SECONDS - before
        if EARLIEST <= begun <= LATEST and span * TICK_SECONDS * fastest >= len(values) - 1:
            said = f"t is in tenths of a microsecond since {since} by its size: counted from"
            note = f"{said} {first:.0f}, the first row"
            return TableTimes((values - first) * TICK_SECONDS, _convert_seconds(begun), (note,))
    return None


def _read_days(table: TableFile, values: np.ndarray, fastest: float) -> TableTimes | None:
    """Times in days, as spreadsheets and MATLAB count them; None where they are none."""
    span = float(values[-1] - values[0])
    steps = len(values) - 1
    if not 0 < span * fastest < steps:
        return None
    for since, more in DAYS_SINCE.items():
        if SERIAL_DAYS[0] <= values[0] - more <= SERIAL_DAYS[1]:
            return _count_from_days(table, values - more, since)
    return None


def _count_from_days(table: TableFile, values: np.ndarray, since: str) -> TableTimes:
    """Times in days since a year, by now counted as those of spreadsheets are."""
    t = (values - values[0]) * SECONDS_A_DAY
    steps = np.diff(t)
    if (steps <= 0).any():
        i = int(np.argmax(steps <= 0)) + 1
        raise UserError(
            f"{table.source}: {table.place(i)}: times are days since {since}, of too few digits:"
            f" {values[i]:.12g} follows {values[i - 1]:.12g}; ten decimals give 10 microseconds:"
            " show them in the sheet, or the time as hh:mm:ss.000, and save again"
        )
    start = ZERO_DAY + dt.timedelta(days=float(values[0]))
    return TableTimes(
        t, start, (f"t is in days since {since} by its size: counted from {start.isoformat()}",)
    )


def _add_fractions(
    table: TableFile, mapping: Mapped, whole: TableTimes, fractions: np.ndarray
) -> TableTimes:
    """Whole seconds with the fractions of another column."""
    label = mapping.columns["frac"].label
    if (whole.t != np.round(whole.t)).any():
        return replace(
            whole, notes=(*whole.notes, f"{label} not used: the times have fractions of seconds")
        )
    by, said = _find_unit(mapping.columns["frac"].role.unit, whole.t, fractions)
    if (
        by > 0
        and fractions.max(initial=0.0) >= COUNTED
        and (fractions == np.round(fractions)).all()
    ):
        fractions = np.mod(fractions, COUNTED)
        by, said = _find_unit("", whole.t, fractions)
    if not by > 0 or fractions.min(initial=0.0) < 0 or fractions.max(initial=0.0) * by >= 1 + 1e-9:
        raise UserError(
            f"{table.source}: {label} holds no fractions of the seconds beside it: up to"
            f" {fractions.max():g}; leave it out, {DATA.columns}={{frac: null}}, or say its unit in"
            " its heading: ms, us or ns"
        )
    t = whole.t + fractions * by
    start = whole.start and whole.start + dt.timedelta(seconds=float(t[0] - whole.t[0]))
    note = f"t is the seconds and the fractions in {label}, {said}"
    counted_from_first = whole.start is not None
    return TableTimes(t - t[0] if counted_from_first else t, start, (*whole.notes, note))


def _find_unit(unit: str, seconds: np.ndarray, fractions: np.ndarray) -> tuple[float, str]:
    """(seconds that one of the fractions is, what says so): their unit, or by how much they fall in
    a new second.
    """
    if unit:
        return find_factor(unit), f"which are in {unit}"
    most = float(fractions.max(initial=0.0))
    if most < 1:
        return 1.0, "which are below 1"
    steps = np.diff(fractions)
    turns = np.diff(seconds)
    within = steps[turns == 0]
    across = np.flatnonzero(turns == 1)
    if len(within) and len(across):
        whole = float(np.median(within)) - float(np.median(steps[across]))
    else:
        whole = 10.0 ** np.ceil(np.log10(most + 1))
    if not whole > 0:
        return 0.0, ""
    return 1 / whole, f"of which a second has {whole:.9g}"
