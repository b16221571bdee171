"""A recording of waveforms from the columns of a table."""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from tractexp.errors import DATA, UserError
from tractexp.filetypes.cells import is_plain_number
from tractexp.filetypes.column_key import LINES, PHASES
from tractexp.filetypes.column_options import find_other_columns
from tractexp.filetypes.columns import find_role
from tractexp.filetypes.comtrade_samples import HUGE
from tractexp.filetypes.mapping import Mapped
from tractexp.filetypes.moments import compute_times
from tractexp.filetypes.table import TableColumn, TableFile
from tractexp.record.gap import (
    find_lost_rows,
    find_short_gaps,
    insert_missing,
    insert_times,
    limit_wave_gap,
)
from tractexp.record.record import LARGEST_JITTER
from tractexp.recording.recording import Channel, Recording, Segment
from tractexp.recording.unit import convert_to_units

SEGMENT_GAP_STEPS = 1.5  # usual steps: a longer one parts two segments


def recording(table: TableFile, mapping: Mapped, nominal: float) -> Recording:
    """The waveforms of a table: every column of numbers is a channel; gaps in time part segments.

    Raises `UserError` for a table of something else, and for times that are not even within a
    segment.
    """
    if mapping.kind != "waves":
        raise UserError(
            f"{table.source} holds {mapping.kind}, not waveforms; read it as such: data=csv"
            f" data.path={table.source}"
        )
    keys = {one.number: key for key, one in mapping.columns.items()}
    times = [number for number in keys if keys[number] in ("t", "frac")]
    named = find_other_columns(table, times)
    numbers = {k: "gaps" for k in named if _is_sampled(_find_numbers(table, k))}
    _refuse_other_rates(table, sorted(keys.keys() - {*numbers, *times}))
    kinds = dict.fromkeys(times, "number") | {mapping.columns["t"].number: "time"}
    cells = table.read({**kinds, **numbers})
    _refuse_wild(table, {k: cells[k] for k in numbers})
    read = compute_times(table, mapping, cells)
    steps = np.diff(read.t)
    rate = 1 / max(float(np.median(steps)), 1e-12) if len(steps) else 0.0
    lost = find_lost_rows(read.t, limit_wave_gap(rate, nominal))
    segments, odd = _find_segments(table, insert_times(read.t, lost))
    channels = [
        _build_channel(table, mapping, k, insert_missing(cells[k].values, lost), keys.get(k, ""))
        for k in numbers
    ]
    notes = [*table.notes, *read.notes, *odd]
    return convert_to_units(
        Recording(table.source, channels, segments, nominal, start=read.start, notes=notes), {}, {}
    )


def _refuse_wild(table: TableFile, cells: Mapping[int, TableColumn]) -> None:
    """Raise `UserError` for a value that no instrument shows."""
    for k, column in cells.items():
        wild = np.abs(column.values) > HUGE
        if wild.any():
            i = int(np.argmax(wild))
            raise table.refuse(
                i,
                k,
                f"{column.values[i]:g} is not a value up to {HUGE:g}; leave the row out, or correct"
                " it",
            )


def _find_numbers(table: TableFile, number: int) -> list[bool]:
    """Which of a column's first cells are numbers."""
    return [number < len(row) and is_plain_number(row[number]) for row in table.sample[:20]]


def _is_sampled(numbers: Sequence[bool]) -> bool:
    """Whether a column whose first cells are numbers or not has one in each row, but for single
    ones.
    """
    lacking = ~np.array(numbers, dtype=bool)
    return not lacking.any() or len(find_short_gaps(lacking)) == np.count_nonzero(lacking)


def _refuse_other_rates(table: TableFile, numbers: Sequence[int]) -> None:
    """Raise `UserError` for a column of samples that has a number in some rows only."""
    for number in numbers:
        there = _find_numbers(table, number)
        if any(there):
            raise UserError(
                f"{table.source}: column {table.label(number)} has a number in {sum(there)} of its"
                f" first {len(there)} rows only; voltage and current of one record are sampled at"
                " the same times: keep the rows that have all of them, or interpolate what was"
                " sampled more slowly"
            )


def _build_channel(
    table: TableFile, mapping: Mapped, number: int, values: np.ndarray, key: str
) -> Channel:
    """A column as a channel; its key says what it measures, else its name."""
    name = table.label(number)
    unit = table.heading.units[number]
    meaning = find_role(name, unit)
    key = key or (meaning.key if meaning else "")
    unit = mapping.columns[key].role.unit if key in mapping.columns else unit
    quantity = (
        {"U": "voltage", "I": "current"}.get(key[:1], "") if not key.endswith("_angle") else "angle"
    )
    phase = key[1:].upper() if key[1:] in (*PHASES, *LINES) else ""
    phase = phase[::-1] if meaning and meaning.backward else phase
    return Channel(name, values, unit, quantity, phase)


def _find_segments(table: TableFile, t: np.ndarray) -> tuple[list[Segment], list[str]]:
    """Runs of even sampling; a note on jitter and on gaps."""
    _check_times(table, t)
    steps = np.diff(t)
    usual = float(np.median(steps))
    breaks = [0, *(np.flatnonzero(steps > SEGMENT_GAP_STEPS * usual) + 1).tolist(), len(t)]
    segments = []
    widest = 0.0
    for first, stop in itertools.pairwise(breaks):
        if stop - first < 3:
            continue
        grid = np.linspace(t[first], t[stop - 1], stop - first)
        step = float(grid[1] - grid[0])
        off = np.abs(t[first:stop] - grid) / step
        if off.max() > 0.5:
            i = first + int(off.argmax())
            raise UserError(
                f"{table.source}: {table.place(i)}: sampling is not uniform: t = {t[i]:.9g} s is"
                f" {off.max():.2g} steps off the uniform grid; waveforms must be sampled evenly"
            )
        widest = max(widest, float(off.max()))
        segments.append(Segment(first, stop, 1 / step, float(t[first] - t[0])))
    notes = []
    if widest > LARGEST_JITTER:
        notes.append(
            f"times up to {100 * widest:.2g} % of a step off a uniform grid: taken as even"
        )
    if len(segments) > 1:
        notes.append(
            f"{len(segments) - 1} gaps in time, the first at {table.place(breaks[1])}: each part is"
            " read by itself"
        )
    return segments, notes


def _check_times(table: TableFile, t: np.ndarray) -> None:
    """Raise `UserError` for times (N,) [s] that are too few, are no numbers, or do not increase."""
    if not np.isfinite(t).all():
        i = int(np.argmin(np.isfinite(t)))
        raise UserError(f"{table.source}: {table.place(i)}: t = {t[i]} is not a finite number")
    if len(t) < 3:
        raise UserError(f"{table.source}: only {len(t)} rows; waveforms need more")
    still = np.diff(t) <= 0
    if still.any():
        i = int(np.argmax(still)) + 1
        raise UserError(
            f"{table.source}: {table.place(i)}: time does not increase: t = {t[i]:.9g} s after"
            f" {t[i - 1]:.9g} s; give the unit of time ({DATA.units}={{t: ms}}), or more digits"
        )
