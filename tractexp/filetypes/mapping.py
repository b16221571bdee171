"""Which columns of a table are time, voltage, power, ...: as the user says, else by their names."""

import datetime as dt
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from tractexp.errors import DATA, UserError
from tractexp.filetypes.column_key import (
    OF,
    find_column,
    list_quantity_keys,
    list_single_phases,
    spell_key,
)
from tractexp.filetypes.column_options import MappedColumn, find_options, read_first_day
from tractexp.filetypes.column_unit import fits, is_unit
from tractexp.filetypes.missing_column import describe_missing_columns
from tractexp.filetypes.table import TableFile
from tractexp.filetypes.table_kind import find_kind


@dataclass(frozen=True)
class Mapped:
    """The columns of a table by key, and what kind of table they make."""

    kind: str  # powers, phasors, waves
    columns: Mapping[str, MappedColumn]
    notes: tuple[str, ...]
    day: dt.date | None = None  # of the first row, where dates stand in a column of their own
    beside: tuple[int, ...] = ()  # the columns of such dates


def map_columns(
    table: TableFile,
    columns: Mapping[str, Any],
    units: Mapping[str, str],
    other_columns: Collection[str] = (),
) -> Mapped:
    """What the columns of a table are, by the user's `columns` {key: name, number from 0, or None
    to leave it out}, `units` {quantity: unit}.

    No note mentions `other_columns`, which serve elsewhere. Raises `UserError` for a chosen column
    that is not there, for one that is missing, and where several columns fit one key.
    """
    choices = {spell_key(key): choice for key, choice in columns.items()}
    numbers = {
        key: find_column(table, key, choice)
        for key, choice in choices.items()
        if choice is not None
    }
    options = find_options(table, numbers)
    for key in choices.keys() - numbers.keys():  # left out
        options.pop(key, None)
    kind, keys = find_kind(table, options, numbers)
    _check_ambiguity(table, options, keys, columns)
    chosen = {key: options[key][0] for key in keys}
    for key, one in chosen.items():
        # the user's unit goes before that in the header
        if (quantity := one.role.quantity) in units:
            chosen[key] = replace(one, role=replace(one.role, unit=str(units[quantity])))
    for one in chosen.values():
        _check_unit(table, one)
    days = _find_days(options, chosen["t"])
    notes = _note_columns(table, chosen, days, other_columns)
    return Mapped(kind, chosen, tuple(notes), read_first_day(table, days))


def _find_days(options: Mapping[str, list[MappedColumn]], time: MappedColumn) -> list[MappedColumn]:
    """The first column of dates beside that of times; [] where there is none."""
    return [one for one in options.get("day", []) if one.number != time.number][:1]


def map_times(table: TableFile) -> Mapped:
    """Which columns of a table say when its rows were taken, and nothing else. Raises `UserError`
    where none does.
    """
    options = find_options(table, {})
    if "t" not in options:
        raise UserError(describe_missing_columns(table, options, {"times": ()}))
    columns = {key: options[key][0] for key in ("t", "frac") if key in options}
    days = _find_days(options, columns["t"])
    beside = tuple(one.number for one in days)
    return Mapped("waves", columns, (), read_first_day(table, days), beside)


def map_voltage(table: TableFile) -> Mapped | None:
    """Which columns of a table hold times and the magnitude of a voltage, where there is nothing
    beside them but its frequency; else None.
    """
    options = find_options(table, {})
    keys = list_quantity_keys(options, "U", ("U", "U1")) or list_single_phases(options, "U")
    known = {*keys, "t", "frac", "day", "f", "dfdt", "U2"}
    named = sum(bool(name) for name in table.heading.names)
    alone = {*options} <= known and all(len(several) == 1 for several in options.values())
    if not (alone and keys and "t" in options and named == len(options)):
        return None
    times = map_times(table)
    return replace(
        times, kind="powers", columns={**times.columns, **{key: options[key][0] for key in keys}}
    )


def _check_ambiguity(
    table: TableFile,
    options: Mapping[str, list[MappedColumn]],
    keys: Sequence[str],
    given: Mapping[str, Any],
) -> None:
    """Raise `UserError` where several columns fit a key, with one setting that answers for all such
    keys at once.

    It holds what was `given` already, so that no answer takes back the one before.
    """
    several = [key for key in keys if len(options[key]) > 1]
    if not several:
        return
    listed = ", ".join(one.label for one in options[several[0]])
    given_answers = {key: _answer(choice) for key, choice in given.items()}
    answers = given_answers | {key: _name_column(table, options[key][0]) for key in several}
    said = ", ".join(f"{key}: {answers[key]}" for key in dict.fromkeys((*several, *given)))
    raise UserError(
        f"{table.source}: {several[0]} could be any of the columns {listed}; say which, e.g."
        f" {DATA.columns}={{{said}}}"
    )


def _name_column(table: TableFile, one: MappedColumn) -> str:
    """A column as it is typed: its name in quotes, or its number where others have that name."""
    names = [name.strip() for name in table.heading.names]
    return f"'{one.name}'" if names.count(one.name.strip()) == 1 else str(one.number)


def _answer(choice: Any) -> str:
    """A choice of a column as it is typed."""
    if choice is None:
        return "null"
    return str(choice) if str(choice).isdigit() else f"'{choice}'"


def _check_unit(table: TableFile, one: MappedColumn) -> None:
    """Raise `UserError` for a column whose unit is one of another quantity."""
    quantity = one.role.quantity
    if one.role.unit and is_unit(one.role.unit) and not fits(quantity, one.role.unit):
        raise UserError(
            f"{table.source}: column {one.label} is read as {one.role.key}, of which"
            f" {one.role.unit} is no unit; say another column, {DATA.columns}={{{one.role.key}:"
            f" ...}}, or the unit, {DATA.units}={{{quantity}: {OF.get(quantity, ('',))[0]}}}"
        )


def _note_columns(
    table: TableFile,
    chosen: Mapping[str, MappedColumn],
    days: Sequence[MappedColumn],
    other_columns: Collection[str],
) -> list[str]:
    """Notes on the role of each column, where names alone do not say it, and on unused columns."""
    notes = []
    used = {one.number for one in (*chosen.values(), *days)}
    if any(key != one.name or table.heading.units[one.number] for key, one in chosen.items()):
        notes.append("columns: " + ", ".join(f"{key} = {one.label}" for key, one in chosen.items()))
    served = {"", *other_columns}
    spare = [
        name for k, name in enumerate(table.heading.names) if k not in used and name not in served
    ]
    return [*notes, f"columns not used: {', '.join(spare)}"] if spare else notes
