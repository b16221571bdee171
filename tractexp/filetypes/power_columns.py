"""U, P and Q of a table that has columns of powers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from tractexp.errors import DATA, UserError
from tractexp.filetypes.column_key import PHASES
from tractexp.filetypes.column_options import MappedColumn
from tractexp.filetypes.column_unit import PER_UNIT, find_factor
from tractexp.filetypes.direct_table import check_alternating
from tractexp.filetypes.mapping import Mapped
from tractexp.filetypes.moments import compute_times
from tractexp.filetypes.row_quality import find_bad_rows, find_filled_rows
from tractexp.filetypes.table import TableFile
from tractexp.record.angle import unwrap_angle
from tractexp.recording.nominal_voltage import is_between_phases
from tractexp.recording.unit import SECONDARY_LINES

ANGLES = frozenset(("U_angle", "U1_angle"))  # of the voltage, beside powers
BESIDE = ANGLES | {"U2"}
LARGEST_TURN_STEP = 1.15  # of a turn: an angle steps by less from row to row, wrapped or not
AGREES = 0.05  # of the apparent power, within which it is the product of voltage and current


@dataclass(frozen=True, eq=False)
class Powers:
    """Columns (N,) by the names of a record; U, P, Q, U2 in kV (line to line), MW, Mvar where
    `absolute` says so.
    """

    columns: dict[str, np.ndarray]
    absolute: dict[str, bool | None]  # of U and of P; None where no unit says
    notes: tuple[str, ...]
    frequency: float = 50.0  # Hz, nominal: as f shows it, else as declared
    start: datetime | None = None  # the moment of t = 0, where the file says it


def read_powers(table: TableFile, mapping: Mapped, kilovolts: bool) -> Powers:
    """The powers of a table with columns of U, P and Q: U the mean of its phases, P and Q their
    sums, with the time and, where the table has them, f, U2 and the voltage's angle.

    `kilovolts` says that a voltage without a unit is in kV. Raises `UserError` for cells that are
    no numbers, and for ambiguous units.
    """
    _check_power_units(table, mapping)
    values, start, said = read_columns(table, mapping)
    columns = {"t": values["t"]}
    notes = [*mapping.notes, *said]
    keys = {
        letter: [key for key in values if key[0] == letter and key not in BESIDE]
        for letter in "UPQI"
    }
    for letter in "UPQ":
        columns[letter], merged = _merge_phases(values, keys[letter])
        notes += merged
    columns |= {key: values[key] for key in ("f", "U2") if key in values}
    for key in ANGLES & values.keys():
        columns["U_angle"], note = _unwrap_angle(mapping.columns[key], values[key])
        notes.append(note)
    absolute = {
        "U": has_absolute_unit(mapping, keys["U"][0]),
        "P": has_absolute_unit(mapping, keys["P"][0]),
    }
    current = values[keys["I"][0]] if keys["I"] else None
    result = Powers(columns, absolute, (*table.notes, *notes), start=start)
    return _settle_voltage(table.source, result, mapping.columns[keys["U"][0]], current, kilovolts)


def _merge_phases(
    values: Mapping[str, np.ndarray], keys: Sequence[str]
) -> tuple[np.ndarray, list[str]]:
    """(the mean (N,) of the columns of U, or the sum of those of P or Q; a note where there are
    several).
    """
    if len(keys) == 1:
        return values[keys[0]], []
    letter = keys[0][0]
    names = ", ".join(keys)
    total = np.add.reduce([values[key] for key in keys])
    if letter == "U":
        return total / len(keys), [f"U is the mean of {names}"]
    return total, [f"{letter} is the sum of {names}"]


def _settle_voltage(
    source: str, result: Powers, one: MappedColumn, current: np.ndarray | None, kilovolts: bool
) -> Powers:
    """The powers with U of column `one` line to line where it is in kV; raises `UserError` for a
    direct voltage.
    """
    absolute = result.absolute["U"]
    columns = result.columns
    if not (absolute or (absolute is None and kilovolts)):
        return result
    notes = check_alternating(source, one.name, columns, kilovolts) if absolute else []
    notes += take_line_voltage(columns, one, current)
    if absolute and not kilovolts:
        notes += _describe_secondary_size(columns)
    return replace(result, notes=(*result.notes, *notes))


def _unwrap_angle(one: MappedColumn, values: np.ndarray) -> tuple[np.ndarray, str]:
    """An angle (N,) in rad, not wrapped, and what is said of it.

    Without a unit it is in degrees where it steps by more than a turn in rad, else in rad.
    """
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    by_degrees = float(steps.max(initial=0.0)) > LARGEST_TURN_STEP * 2 * np.pi
    scale = find_factor(one.role.unit) if one.role.unit else np.pi / 180 if by_degrees else 1.0
    unit = one.role.unit or (
        "deg, for in rad it would step by more than a turn" if by_degrees else "rad"
    )
    note = f"{one.label} drives the model: the voltage's angle, {unit}"
    return unwrap_angle(scale * values), note


def _check_power_units(table: TableFile, mapping: Mapped) -> None:
    """Raise `UserError` where some columns of P and Q have a unit and others none: it could be a
    thousand times off.
    """
    ours = {key: one for key, one in mapping.columns.items() if key[0] in "PQ"}
    bare = [one for one in ours.values() if not one.role.unit.strip()]
    if bare and len(bare) < len(ours):
        units = ", ".join(f"{letter}: {unit}" for letter, unit in (("P", "MW"), ("Q", "Mvar")))
        raise UserError(
            f"{table.source}: {bare[0].label} has no unit, and other columns of P and Q have one;"
            f" say them, e.g. {DATA.units}={{{units}}}"
        )


def take_line_voltage(
    columns: dict[str, np.ndarray], one: MappedColumn, current: np.ndarray | None
) -> list[str]:
    """Make U of column `one` line to line where it is a phase's; what it was taken for, and why
    where its name does not say it.
    """
    line, why, key = one.role.line, "", one.role.key
    if line:
        return []
    if line is None:
        line, why = _guess_line(columns, key, current)
    if line:
        return [f"{key} taken as line-to-line voltage{why}"]
    for name in {"U", "U2"} & set(columns):
        columns[name] = columns[name] * np.sqrt(3)
    return [f"{key} taken as a phase voltage{why}: times sqrt(3) it is line to line"]


def _guess_line(
    columns: Mapping[str, np.ndarray], key: str, current: np.ndarray | None
) -> tuple[bool, str]:
    """(whether a voltage [kV] whose name does not say it is line to line, why): by the powers,
    else by its size.
    """
    product = None if current is None else _is_line_voltage_by_power(columns, current)
    if product is not None:
        return product, ", for P and Q are the product of it and the current then"
    level = float(np.nanmedian(columns["U"]))
    if key[1:] not in PHASES:
        return True, ""
    if is_between_phases(level):
        return True, f", for {level:.4g} kV is near a nominal voltage, and times sqrt(3) near none"
    return False, ""


def _describe_secondary_size(columns: Mapping[str, np.ndarray]) -> list[str]:
    """A sentence on a line voltage [kV] that only secondaries of transformers have; [] where none
    is.
    """
    level = float(np.nanmedian(columns["U"]))
    if not SECONDARY_LINES[0] <= level <= SECONDARY_LINES[1]:
        return []
    return [
        f"{1000 * level:.4g} V between phases is a transformer's secondary by its size: P and Q are"
        f" then no MW; what one of the table's units is on the primary side: {DATA.units}={{U: '1.1"
        " kV', P: '0.132 MW', Q: '0.132 Mvar'}"
    ]


def _is_line_voltage_by_power(
    columns: Mapping[str, np.ndarray], current: np.ndarray
) -> bool | None:
    """Whether a voltage is line to line by S = sqrt(3) U I, where that or S = 3 U I holds; else
    None.
    """
    size = np.hypot(columns["P"], columns["Q"])
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = size / (np.abs(columns["U"]) * np.abs(current))
    ratio = float(np.median(ratio[np.isfinite(ratio)])) if np.isfinite(ratio).any() else 0.0
    fits = {line: abs(ratio / by - 1) < AGREES for line, by in ((True, np.sqrt(3)), (False, 3.0))}
    return next((line for line, good in fits.items() if good), None)


def has_absolute_unit(mapping: Mapped, key: str) -> bool | None:
    """Whether a column is in V, A, W or the like; None where it names no unit."""
    unit = mapping.columns[key].role.unit.strip().lower()
    return None if not unit else unit not in PER_UNIT


def read_columns(
    table: TableFile, mapping: Mapped
) -> tuple[dict[str, np.ndarray], datetime | None, tuple[str, ...]]:
    """The values (N,) by key, in s, kV, MW, Hz, and angles as they are; the moment of t = 0, and
    notes on the times.
    """
    kinds = {"t": "time", "frac": "number"}
    cells = table.read({one.number: kinds.get(key, "gaps") for key, one in mapping.columns.items()})
    values = {key: cells[one.number].values for key, one in mapping.columns.items()}
    lost, lost_said = find_filled_rows([values[key] for key in values.keys() - {"t", "frac"}])
    values |= {
        key: values[key] * by
        for key, one in mapping.columns.items()
        if not key.endswith("_angle")
        and key not in ("t", "frac")
        and (by := find_factor(one.role.unit)) != 1
    }
    values.pop("frac", None)
    read = compute_times(table, mapping, cells)
    values["t"] = read.t
    bad, said = find_bad_rows(table, len(read.t))
    for key in values.keys() - {"t"}:
        values[key] = np.where(bad | lost, np.nan, values[key])
    return values, read.start, (*read.notes, *said, *lost_said)
