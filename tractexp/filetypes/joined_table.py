"""One table of the files of one event: their columns beside one time."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import timedelta
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.errors import UserError
from tractexp.filetypes.columns import find_role
from tractexp.filetypes.heading import TableHeading
from tractexp.filetypes.mapping import map_times
from tractexp.filetypes.moments import TableTimes, compute_times
from tractexp.filetypes.table import TableColumn, TableFile
from tractexp.recording.event_files import SampledFile, align, move_samples, tell_apart

Place = tuple[int, int]  # the number of a part, and of a column in it

EVEN = 0.1  # of a step, and of all steps: what differs more is uneven


class JoinedTable(TableFile):
    """The columns of several tables at the instants that all have, by the times of the first."""

    def __init__(self, parts: Sequence[TableFile], paths: Sequence[str]) -> None:
        """Raises `UserError` for other rates, and for times that do not overlap."""
        self.parts, self.source = parts, parts[0].source
        read = list(map(_find_times, parts))
        every = list(map(itemgetter(0), read))
        used = list(map(itemgetter(1), read))
        self.aligned = align(list(map(_describe_samples, parts, every)))
        first = self.aligned.first[0]
        count = self.aligned.count
        times = every[0]
        t = times.t[first : first + count]
        for part, own, begin in zip(parts, every, self.aligned.first, strict=True):
            _check_rows(part, own.t[begin:][:count], t, parts[0].source)
        if times.start is not None:
            self.start, t = times.start + timedelta(seconds=float(t[0] - times.t[0])), t - t[0]
        self.t, self.frequency = t, parts[0].frequency
        self.columns, names, said = _collect_columns(parts, used, tell_apart(paths))
        self.heading = TableHeading(
            ("t", *(name for name, _ in names)), ("s", *(unit for _, unit in names)), 0, 0
        )
        rows = zip(*(part.sample for part in parts), strict=False)
        self.sample = [
            [float(moment), *(_get_cell(row[k], number) for k, number in self.columns)]
            for moment, row in zip(t, rows, strict=False)
        ]
        notes = [
            f"{Path(path).name}: {note}"
            for path, part in zip(paths, parts, strict=True)
            for note in part.notes
        ]
        self.notes = (*self.aligned.notes, *said, *dict.fromkeys(notes))

    def read(self, wanted: Mapping[int, str]) -> dict[int, TableColumn]:
        """The wanted columns {number: kind} of all parts, at the times of the joined table."""
        read: dict[int, TableColumn] = {0: TableColumn(self.t)} if 0 in wanted else {}
        for k, part in enumerate(self.parts):
            own = {self.columns[n - 1][1]: n for n in wanted if n and self.columns[n - 1][0] == k}
            cells = part.read({number: wanted[n] for number, n in own.items()}) if own else {}
            for number, n in own.items():
                values = move_samples(
                    cells[number].values,
                    self.aligned.first[k],
                    self.aligned.count,
                    self.aligned.late[k],
                )
                read[n] = replace(cells[number], values=values)
        return read

    def cells(self, number: int) -> Sequence[Any]:
        """The cells of a column as its part has them, within the times that all share."""
        if not number:
            return self.t.tolist()
        part, own = self.columns[number - 1]
        first = self.aligned.first[part]
        return self.parts[part].cells(own)[first : first + self.aligned.count]

    def place(self, row: int) -> str:
        """Where a row stands in the first part."""
        return self.parts[0].place(row + self.aligned.first[0])


def _get_cell(row: Sequence[object], number: int) -> object:
    """A row's cell; "" where the row is shorter."""
    return row[number] if number < len(row) else ""


def _find_times(part: TableFile) -> tuple[TableTimes, set[int]]:
    """When the rows of a table were taken, and the columns that say it."""
    mapping = map_times(part)
    numbers = {one.number for one in mapping.columns.values()}
    kinds = {number: "number" for number in numbers} | {mapping.columns["t"].number: "time"}
    return compute_times(part, mapping, part.read(kinds)), numbers | set(mapping.beside)


def _describe_samples(part: TableFile, times: TableTimes) -> SampledFile:
    """Rate, count and begin of a part. Raises `UserError` for too few rows, or times that do not
    increase.
    """
    if len(times.t) < 3:
        raise UserError(f"{part.source}: only {len(times.t)} rows; a part of an event needs more")
    steps = np.diff(times.t)
    usual = float(np.median(steps))
    even = np.mean(np.abs(steps - usual) < EVEN * usual) > 1 - EVEN  # but for rows that are lost
    step = usual if even else float(steps.mean())
    if not step > 0:
        raise UserError(f"{part.source}: its times do not increase, so nothing can be joined to it")
    return SampledFile(part.source, 1 / step, len(times.t), float(times.t[0]), times.start)


def _check_rows(part: TableFile, own: np.ndarray, t: np.ndarray, other: str) -> None:
    """Raise `UserError` where rows (N,) [s] of a table are not at the times of the first one's."""
    off = np.abs((own - own[0]) - (t - t[0]))
    if off.max() > 0.5 * float(np.median(np.diff(t))):
        row = int(np.argmax(off > 0.5 * float(np.median(np.diff(t)))))
        raise UserError(
            f"{part.source}: row {row + 1} of those that it has in common with {other} is"
            f" {own[row] - own[0]:.6g} s after the first, and there {t[row] - t[0]:.6g} s: rows are"
            " missing or double in one of them; export both with all rows, or interpolate"
        )


def _list_columns(
    parts: Sequence[TableFile], times: Sequence[set[int]]
) -> Iterator[tuple[int, int, str, str]]:
    """(part, number, name, unit) of each column but times."""
    for k, part in enumerate(parts):
        for number, name in enumerate(part.heading.names):
            if number not in times[k]:
                yield k, number, name.strip(), part.heading.units[number]


def _collect_columns(
    parts: Sequence[TableFile], times: Sequence[set[int]], told: Sequence[str]
) -> tuple[list[tuple[int, int]], list[tuple[str, str]], list[str]]:
    """(part, number) of each column but times, its name and unit, and notes on those left out.

    A name that several files have, or that says nothing, is made of what the files' names say.
    """
    every = list(_list_columns(parts, times))
    columns, names, notes = [], [], []
    for k, number, name, unit in every:
        alike = [one for one in every if one[0] != k and one[2].lower() == name.lower()]
        if any(one[0] < k and _hold_same_cells(parts, one[:2], (k, number)) for one in alike):
            notes.append(f"column '{name}' of {parts[k].source} is that of an earlier file")
            continue
        columns.append((k, number))
        names.append((_tell(name, unit, told[k], bool(alike)), unit))
    return columns, names, notes


def _hold_same_cells(parts: Sequence[TableFile], one: Place, other: Place) -> bool:
    """Whether two columns hold the same cells, and not one value alone, as dead channels do."""
    (j, a), (k, b) = one, other
    if any(
        _get_cell(x, a) != _get_cell(y, b)
        for x, y in zip(parts[j].sample, parts[k].sample, strict=False)
    ):
        return False
    first = list(parts[j].cells(a))
    second = list(parts[k].cells(b))
    return first == second and any(cell != first[0] for cell in first)


def _tell(name: str, unit: str, told: str, is_shared: bool) -> str:
    """A column's name, with what its file's name says where others have it or it says nothing; that
    alone where it says all.
    """
    own = find_role(name, unit)
    if own and not is_shared:
        return name
    if not own and find_role(told, unit):
        return told
    options = [f"{name} {told}", f"{told} {name}", told]
    known = [(option, one) for option in options if (one := find_role(option, unit))]
    with_phase = [option for option, one in known if len(one.key) > 1]
    return next(iter((*with_phase, *(option for option, _ in known))), f"{name} {told}".strip())
