"""The columns of a table that each key could be, by their names and units."""

import datetime as dt
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from tractexp.filetypes.clock import find_first_day, is_time
from tractexp.filetypes.column_key import CONTRACT, PHASE_VOLTAGES, PHASES
from tractexp.filetypes.column_unit import find_meaning
from tractexp.filetypes.columns import Role, find_role, order_of
from tractexp.filetypes.heading import TableHeading
from tractexp.filetypes.table import TableFile

MEAN = re.compile(
    r"(?<![a-z])(?:avg|average|mean|mittel|mittelwert|moy)(?![a-z])|平均", re.IGNORECASE
)
EXTREME = re.compile(r"(?<![a-z])(?:min|max|minimum|maximum)(?![a-z])|最[大小]", re.IGNORECASE)
BY_UNIT_ALONE = {"U": "voltage", "I": "current", "P": "power", "Q": "reactive"}


@dataclass(frozen=True)
class MappedColumn:
    """A column and what it is."""

    number: int
    name: str
    role: Role

    @property
    def label(self) -> str:
        """The column's name in quotes, with its unit."""
        return f"'{self.name}'" + (f" [{self.role.unit}]" if self.role.unit else "")


def find_options(table: TableFile, numbers: Mapping[str, int]) -> dict[str, list[MappedColumn]]:
    """{key: the columns that could be it}; the user's choice, and a name that is the key itself,
    excludes others.
    """
    heading = table.heading
    names = _spell_out_names(heading.names)
    order = order_of(names, heading.units)
    options = {key: [_find_chosen_column(table, key, k, order)] for key, k in numbers.items()}
    others = find_other_columns(table, numbers.values())
    read = {k: find_role(names[k], heading.units[k], order) for k in others}
    roles = {k: one for k, one in read.items() if one}
    exact = set(CONTRACT).intersection(map(heading.names.__getitem__, roles))
    if "U" not in {*exact, *numbers}:
        exact.discard("U2")  # of U1, U2, U3
    renamed = _resolve_numbered_roles(roles)
    for k, one in roles.items():
        name = heading.names[k]
        key = name if name in exact else renamed.get(one.key, one.key)
        if key not in numbers and (key not in exact or name == key):
            options.setdefault(key, []).append(_map_named_column(k, name, key, one))
    unnamed = [k for k in others if k not in roles]
    return _find_time_columns(table, _add_by_unit(heading, unnamed, _prefer_means(options)))


def _prefer_means(options: dict[str, list[MappedColumn]]) -> dict[str, list[MappedColumn]]:
    """The options, of the least, mean and largest value of a quantity the mean."""
    preferred = dict(options)
    for key, several in options.items():
        means = [one for one in several if MEAN.search(one.name)]
        rest = [one for one in several if one not in means]
        if len(means) == 1 and all(EXTREME.search(one.name) for one in rest):
            preferred[key] = means
    return preferred


def _add_by_unit(
    heading: TableHeading, unnamed: Sequence[int], options: dict[str, list[MappedColumn]]
) -> dict[str, list[MappedColumn]]:
    """The options with the columns whose names say nothing, in whatever language, and whose units
    say voltage, P or Q: where no column is called so, and one alone has such a unit. Three voltages
    and three currents are those of the phases.
    """
    fitting = {
        key: [k for k in unnamed if _is_measured_in(heading.units[k], quantity)]
        for key, quantity in BY_UNIT_ALONE.items()
        if not any(other[0] == key for other in options)
    }
    phases = [len(fitting.get(key, ())) for key in "UI"] == [3, 3]
    for key, numbers in fitting.items():
        keys = [key + p for p in PHASES] if phases and key in "UI" else [key]
        if len(keys) == len(numbers):
            for one, k in zip(keys, numbers, strict=True):
                options[one] = [MappedColumn(k, heading.names[k], Role(one, heading.units[k]))]
    return options


def _is_measured_in(unit: str, quantity: str) -> bool:
    """Whether a unit is one of a quantity; those of apparent power are none."""
    return (find_meaning(unit) or ("",))[0] == quantity and not unit.lower().endswith("va")


def find_other_columns(table: TableFile, taken: Collection[int]) -> list[int]:
    """The numbers of the columns that have a name and are not taken."""
    return [k for k, name in enumerate(table.heading.names) if name and k not in taken]


def _map_named_column(number: int, name: str, key: str, by_name: Role) -> MappedColumn:
    """A column with the role that it has by its name, under a key: a whole U is not line to line
    for being called U, or U L1.
    """
    undecided = key == "U" and (name == "U" or by_name.key == "Ua")
    line = None if undecided else by_name.line
    return MappedColumn(number, name, replace(by_name, key=key, line=line))


def _find_chosen_column(table: TableFile, key: str, number: int, order: str) -> MappedColumn:
    """The column that the user chose for a key.

    A phase voltage counts as phase to ground unless its name says line to line.
    """
    unit = table.heading.units[number]
    named = find_role(table.heading.names[number], unit, order)
    line = named.line if named else None
    if line is None and named and named.key in PHASE_VOLTAGES:
        line = False
    return MappedColumn(number, table.label(number), Role(key, unit, line))


def _spell_out_names(names: Sequence[str]) -> Sequence[str]:
    """The names with those of a micro-PMU, L1MAG and C1ANG, as they are meant: voltage and current
    of a phase.
    """
    parts = [
        re.fullmatch(r"([LC])([123])_?(MAG|ANG)", name.strip(), re.IGNORECASE) for name in names
    ]
    if {match[1].upper() for match in parts if match} != {"L", "C"}:
        return names
    letters = {"L": "V", "C": "I"}
    return [
        f"{letters[m[1].upper()]}{m[2]} {m[3].lower()}" if m else name
        for m, name in zip(parts, names, strict=True)
    ]


def _resolve_numbered_roles(roles: Mapping[int, Role]) -> dict[str, str]:
    """The keys of U1, U2, U3: the phases where there are three; P1 alone is P."""
    keys = {one.key for one in roles.values()}
    phases = {}
    for letter in "UIPQ":
        for ending in ("", "_angle"):
            numbered = [f"{letter}{n}{ending}" for n in (1, 2, 3)]
            if keys.issuperset(numbered):
                phases |= {
                    old: f"{letter}{p}{ending}" for old, p in zip(numbered, PHASES, strict=True)
                }
            elif letter in "PQ" and numbered[0] in keys:
                phases[numbered[0]] = letter
    return phases | _are_of_one_load(keys)


def _are_of_one_load(keys: Collection[str]) -> dict[str, str]:
    """The keys of U L1, P L1, Q L1 where no L2 and L3 are beside them: the whole of a load called
    L1.
    """
    if not {"Pa", "Qa"} <= set(keys) or {"P", "Q", "Pb", "Pc", "Qb", "Qc"} & set(keys):
        return {}
    voltage = {"Ua": "U"} if not {"U", "U1", "Ub", "Uc"} & set(keys) else {}
    return {"Pa": "P", "Qa": "Q", **voltage}


def _find_time_columns(
    table: TableFile, options: dict[str, list[MappedColumn]]
) -> dict[str, list[MappedColumn]]:
    """Time from a column of dates with times, or of whole seconds beside fractions, where there is
    no other.

    Of a date and a time, the time; fractions alone are none of a known second.
    """
    days = [one for one in options.get("day", []) if _does_begin_with_time(table, one.number)]
    seconds = options.pop("soc", [])
    if seconds and ("t" not in options or "frac" in options):
        options["t"] = seconds
    elif "t" not in options and days:
        options["t"] = days
        del options["day"]
    if "t" not in options:
        options.pop("frac", None)
        return options
    options["t"] = [replace(one, role=replace(one.role, key="t")) for one in options["t"]]
    return options


def _does_begin_with_time(table: TableFile, number: int) -> bool:
    """Whether the first cell of a column is a time of day, with or without its date."""
    return any(is_time(row[number]) for row in table.sample[:1])


def read_first_day(table: TableFile, days: Sequence[MappedColumn]) -> dt.date | None:
    """The date of the first row in a column of dates."""
    return next((find_first_day([row[one.number] for row in table.sample]) for one in days), None)
