"""The keys of columns, such as U, Pa and I1_angle, and the columns that a user chooses for them."""

import itertools
import operator
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from tractexp.errors import DATA, UserError, list_allowed, name_setting, suggest_nearest
from tractexp.filetypes.column_unit import fits, is_unit
from tractexp.filetypes.columns import Role, find_role
from tractexp.filetypes.table import TableFile
from tractexp.recording.unit import parse_amount

CONTRACT = ("t", "U", "P", "Q", "f", "U2", "U_angle")
PHASES = ("a", "b", "c")
LINES = ("ab", "bc", "ca")
PHASE_VOLTAGES = ("Ua", "Ub", "Uc")
KEYS = (
    *(key for key in CONTRACT if key != "U_angle"),
    "dfdt",
    "frac",
    "I",
    *(x + p for x in "UI" for p in (*PHASES, *LINES, "1", "2", "0") if x + p != "U2"),
    *(x + p for x in "PQ" for p in PHASES),
)
ANGLES = tuple(f"{key}_angle" for key in KEYS if key[0] in "UI")
OF: Mapping[str, tuple[str, ...]] = {  # {quantity as data.units names it: units of it}
    "t": ("s", "ms", "us", "ns"),
    "U": ("kV", "V", "pu"),
    "I": ("kA", "A", "pu"),
    "P": ("MW", "kW", "W", "pu"),
    "Q": ("Mvar", "kvar", "var", "pu"),
    "f": ("Hz", "mHz", "pu"),
    "angle": ("deg", "rad"),
}
QUANTITIES = tuple(OF)


def check_mapping(columns: Mapping[str, Any], units: Mapping[str, str]) -> None:
    """Raise `UserError` for a key or a unit that there is not."""
    for name, mapping in {"columns": columns, "units": units}.items():
        if not isinstance(mapping, Mapping):
            key = name_setting(f"data.{name}")
            raise UserError(f"{key}={mapping!s:.60} must be a mapping, such as {key}={{U: ...}}")
    for key in columns:
        spell_key(key)
    for quantity, unit in units.items():
        if quantity not in QUANTITIES:
            raise UserError(
                f"{DATA.units} names '{quantity}'{list_allowed(quantity, QUANTITIES, 'Quantities')}"
            )
        if not is_unit(parse_amount(str(unit))[1]):
            raise UserError(
                f"{DATA.units}: {quantity}={unit} is not a unit; one is e.g. kV, V, kA, A, MW, kW,"
                " Mvar, Hz, s, ms, deg, rad, pu"
            )
        if not fits(quantity, str(unit), exact=True):
            raise UserError(
                f"{DATA.units}: {quantity}={unit} is no unit of {quantity}; one is"
                f" {', '.join(OF[quantity])}"
            )


def spell_key(name: str) -> str:
    """A key as `KEYS` spells it: ua, Va and UA are Ua, V1_angle is U1_angle."""
    spellings = {key.lower(): key for key in (*KEYS, *ANGLES)}
    plain = str(name).lower()
    plain = "u" + plain[1:] if plain.startswith("v") else plain
    if plain not in spellings:
        raise UserError(
            f"{DATA.columns} names '{name}'"
            f"{list_allowed(str(name), CONTRACT, 'Keys')}, or ua, ub, uc, ia, ib, ic"
        )
    return spellings[plain]


def find_column(table: TableFile, key: str, choice: Any) -> int:
    """The number of a column chosen by name, with or without its unit, or by number; raises
    `UserError` for one that is not there, or several times.
    """
    names = [name.strip() for name in table.heading.names]
    units = table.heading.units
    if not isinstance(choice, int | str):
        raise UserError(
            f"{DATA.columns}: {key} must be the name of a column of {table.source}, or its number"
        )
    if isinstance(choice, int) or (str(choice).isdigit() and str(choice) not in names):
        if int(choice) not in range(len(names)):
            raise UserError(
                f"{DATA.columns}: {key}={choice}: {table.source} has {len(names)} columns, counted"
                " from 0"
            )
        return int(choice)
    with_units = list(map(operator.add, names, units))
    matches = _match_names(str(choice), names) or _match_names(str(choice), with_units)
    if len(matches) == 1:
        return matches[0]
    if matches:
        raise UserError(
            f"{DATA.columns}: {key}={choice}: {table.source} has that column {len(matches)} times;"
            f" give its number, one of {', '.join(map(str, matches))}"
        )
    fitting = itertools.compress(
        names, map(_may_hold_quantity, itertools.repeat(key), names, units)
    )
    raise UserError(
        f"{DATA.columns}: {key}={choice}: {table.source} has no such"
        f" column{suggest_nearest(str(choice), fitting) or '.'} Columns: {', '.join(names)}"
    )


def _may_hold_quantity(key: str, name: str, unit: str) -> bool:
    """Whether a column may hold a key's quantity, for its name says no other."""
    named = find_role(name, unit)
    return named is None or named.quantity == Role(key).quantity


def _match_names(wanted: str, names: Sequence[str]) -> list[int]:
    """The numbers of the names that are the wanted one but for blanks and brackets."""
    squeezed = _squeeze_name(wanted)
    return [k for k, name in enumerate(names) if _squeeze_name(name) == squeezed]


def _squeeze_name(name: str) -> str:
    """A name without blanks and brackets, so that "U(kV)" and "U kV" match "U [kV]"."""
    return "".join(c for c in name if c.isalnum())


def has_quantity(keys: Iterable[str], letter: str) -> bool:
    """Whether keys hold a quantity, as such or in all phases."""
    return letter in keys or all(letter + p in keys for p in PHASES)


def list_quantity_keys(keys: Iterable[str], letter: str, single: Sequence[str]) -> list[str]:
    """The keys that give one quantity: one column, or three phases, or three lines."""
    keys = set(keys)
    for group in (
        *([one] for one in single),
        [letter + p for p in PHASES],
        [letter + p for p in LINES],
    ):
        if keys.issuperset(group):
            return [*group]
    return []


def list_single_phases(keys: Iterable[str], letter: str) -> list[str]:
    """The one or two phases, else lines, that are there of one quantity."""
    keys = set(keys)
    groups = ([letter + p for p in marks if letter + p in keys] for marks in (PHASES, LINES))
    return next((group for group in groups if group), [])
