"""Which columns of a table are time, voltage, power, ...: as the user says, else by their names."""

import datetime as dt
import itertools
import operator
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from tractexp.errors import DATA, UserError, among, nearest, setting
from tractexp.filetypes.cells import is_plain_number
from tractexp.filetypes.clock import first_day, is_time
from tractexp.filetypes.columns import Role, fits, is_unit, meaning, order_of, role
from tractexp.filetypes.heading import TableHeading
from tractexp.filetypes.table import TableFile
from tractexp.recording.unit import amount

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
    choices = {_key(key): choice for key, choice in columns.items()}
    numbers = {
        key: _column_number(table, key, choice)
        for key, choice in choices.items()
        if choice is not None
    }
    options = _options(table, numbers)
    for key in choices.keys() - numbers.keys():  # left out
        options.pop(key, None)
    kind, keys = _kind(table, options, numbers)
    _check_ambiguity(table, options, keys, columns)
    chosen = {key: options[key][0] for key in keys}
    for key, one in chosen.items():
        # the user's unit goes before that in the header
        if (quantity := one.role.quantity) in units:
            chosen[key] = replace(one, role=replace(one.role, unit=str(units[quantity])))
    for one in chosen.values():
        _check_unit(table, one)
    days = _find_days(options, chosen["t"])
    notes = _notes(table, chosen, days, other_columns)
    return Mapped(kind, chosen, tuple(notes), _first_day(table, days))


def _find_days(options: Mapping[str, list[MappedColumn]], time: MappedColumn) -> list[MappedColumn]:
    """The first column of dates beside that of times; [] where there is none."""
    return [one for one in options.get("day", []) if one.number != time.number][:1]


def map_times(table: TableFile) -> Mapped:
    """Which columns of a table say when its rows were taken, and nothing else. Raises `UserError`
    where none does.
    """
    options = _options(table, {})
    if "t" not in options:
        raise UserError(_describe_missing_columns(table, options, {"times": ()}))
    columns = {key: options[key][0] for key in ("t", "frac") if key in options}
    days = _find_days(options, columns["t"])
    beside = tuple(one.number for one in days)
    return Mapped("waves", columns, (), _first_day(table, days), beside)


def map_voltage(table: TableFile) -> Mapped | None:
    """Which columns of a table hold times and the magnitude of a voltage, where there is nothing
    beside them but its frequency; else None.
    """
    options = _options(table, {})
    keys = _set(options, "U", ("U", "U1")) or _some(options, "U")
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


def check_mapping(columns: Mapping[str, Any], units: Mapping[str, str]) -> None:
    """Raise `UserError` for a key or a unit that there is not."""
    for name, mapping in {"columns": columns, "units": units}.items():
        if not isinstance(mapping, Mapping):
            key = setting(f"data.{name}")
            raise UserError(f"{key}={mapping!s:.60} must be a mapping, such as {key}={{U: ...}}")
    for key in columns:
        _key(key)
    for quantity, unit in units.items():
        if quantity not in QUANTITIES:
            raise UserError(
                f"{DATA.units} names '{quantity}'{among(quantity, QUANTITIES, 'Quantities')}"
            )
        if not is_unit(amount(str(unit))[1]):
            raise UserError(
                f"{DATA.units}: {quantity}={unit} is not a unit; one is e.g. kV, V, kA, A, MW, kW,"
                " Mvar, Hz, s, ms, deg, rad, pu"
            )
        if not fits(quantity, str(unit), exact=True):
            raise UserError(
                f"{DATA.units}: {quantity}={unit} is no unit of {quantity}; one is"
                f" {', '.join(OF[quantity])}"
            )


def _key(name: str) -> str:
    """A key as `KEYS` spells it: ua, Va and UA are Ua, V1_angle is U1_angle."""
    spellings = {key.lower(): key for key in (*KEYS, *ANGLES)}
    plain = str(name).lower()
    plain = "u" + plain[1:] if plain.startswith("v") else plain
    if plain not in spellings:
        raise UserError(
            f"{DATA.columns} names '{name}'{among(str(name), CONTRACT, 'Keys')}, or ua, ub, uc, ia,"
            " ib, ic"
        )
    return spellings[plain]


def _column_number(table: TableFile, key: str, choice: Any) -> int:
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
    fitting = itertools.compress(names, map(_suits, itertools.repeat(key), names, units))
    raise UserError(
        f"{DATA.columns}: {key}={choice}: {table.source} has no such"
        f" column{nearest(str(choice), fitting) or '.'} Columns: {', '.join(names)}"
    )


def _suits(key: str, name: str, unit: str) -> bool:
    """Whether a column may hold a key's quantity, for its name says no other."""
    named = role(name, unit)
    return named is None or named.quantity == Role(key).quantity


def _match_names(wanted: str, names: Sequence[str]) -> list[int]:
    """The numbers of the names that are the wanted one but for blanks and brackets."""
    squeezed = _squeeze_name(wanted)
    return [k for k, name in enumerate(names) if _squeeze_name(name) == squeezed]


def _squeeze_name(name: str) -> str:
    """A name without blanks and brackets, so that "U(kV)" and "U kV" match "U [kV]"."""
    return "".join(c for c in name if c.isalnum())


def _options(table: TableFile, numbers: Mapping[str, int]) -> dict[str, list[MappedColumn]]:
    """{key: the columns that could be it}; the user's choice, and a name that is the key itself,
    excludes others.
    """
    heading = table.heading
    names = _spell_out_names(heading.names)
    order = order_of(names, heading.units)
    options = {key: [_chosen_column(table, key, k, order)] for key, k in numbers.items()}
    others = find_other_columns(table, numbers.values())
    read = {k: role(names[k], heading.units[k], order) for k in others}
    roles = {k: one for k, one in read.items() if one}
    exact = set(CONTRACT).intersection(map(heading.names.__getitem__, roles))
    if "U" not in {*exact, *numbers}:
        exact.discard("U2")  # of U1, U2, U3
    renamed = _resolve_numbered_roles(roles)
    for k, one in roles.items():
        name = heading.names[k]
        key = name if name in exact else renamed.get(one.key, one.key)
        if key not in numbers and (key not in exact or name == key):
            options.setdefault(key, []).append(_named_column(k, name, key, one))
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
    return (meaning(unit) or ("",))[0] == quantity and not unit.lower().endswith("va")


def find_other_columns(table: TableFile, taken: Collection[int]) -> list[int]:
    """The numbers of the columns that have a name and are not taken."""
    return [k for k, name in enumerate(table.heading.names) if name and k not in taken]


def _named_column(number: int, name: str, key: str, by_name: Role) -> MappedColumn:
    """A column with the role that it has by its name, under a key: a whole U is not line to line
    for being called U, or U L1.
    """
    undecided = key == "U" and (name == "U" or by_name.key == "Ua")
    line = None if undecided else by_name.line
    return MappedColumn(number, name, replace(by_name, key=key, line=line))


def _chosen_column(table: TableFile, key: str, number: int, order: str) -> MappedColumn:
    """The column that the user chose for a key; its name says whether a voltage is line to line,
    and that of a phase is not unless it says so.
    """
    unit = table.heading.units[number]
    named = role(table.heading.names[number], unit, order)
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
    """What U1, U2, U3 are: the phases where there are three; P1 alone is P."""
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
    return phases | _of_one_load(keys)


def _of_one_load(keys: Collection[str]) -> dict[str, str]:
    """What U L1, P L1, Q L1 are where no L2 and L3 are beside them: the whole of a
    load called L1.
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
    days = [one for one in options.get("day", []) if _begins_with_time(table, one.number)]
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


def _begins_with_time(table: TableFile, number: int) -> bool:
    """Whether the first cell of a column is a time of day, with or without its date."""
    return any(is_time(row[number]) for row in table.sample[:1])


def _first_day(table: TableFile, days: Sequence[MappedColumn]) -> dt.date | None:
    """The date of the first row in a column of dates."""
    return next((first_day([row[one.number] for row in table.sample]) for one in days), None)


def _kind(
    table: TableFile, options: Mapping[str, Any], chosen: Iterable[str]
) -> tuple[str, list[str]]:
    """What the table holds, and the keys that make it up, t first; raises `UserError` for what is
    no such table.
    """
    kinds = _find_kinds(table, options)
    times = [key for key in ("t", "frac") if key in options]
    for kind, keys in kinds.items():
        if "t" not in options or not {*chosen} <= {"t", "frac", *keys}:
            continue
        if kind == "waves" and not _oscillates(table, options, keys):
            named = ", ".join(options[key][0].label for key in keys)
            raise UserError(
                f"{table.source}: the columns {named} hold magnitudes without angles, and there are"
                " none of P and Q: the load's power does not follow from them; add P and Q, or the"
                " angles"
            )
        return kind, [*times, *keys]
    raise UserError(_describe_missing_columns(table, options, kinds))


def _find_kinds(table: TableFile, options: Mapping[str, Any]) -> dict[str, list[str]]:
    """{kind that a table may be: the keys that make it up}, the likeliest first.

    Columns of one quantity alone, and columns beside powers, are waveforms only where they
    oscillate.
    """
    wave = _waveform(options)
    powers = _powers(options)
    swings = _oscillates(table, options, wave)
    if len({key[0] for key in wave}) == 1 and not swings:
        wave = []
    kinds = {"phasors": _phasors(options), "waves": wave, "powers": powers}
    if powers:
        kinds["powers"] = [*powers, *_telling_current(table, options, powers)]
        if not (swings and _has(options, "P")):
            kinds = {"powers": kinds["powers"], "phasors": kinds["phasors"]}
    return {kind: keys for kind, keys in kinds.items() if keys}


def _has(keys: Iterable[str], letter: str) -> bool:
    """Whether keys hold a quantity, as such or in all phases."""
    return letter in keys or all(letter + p in keys for p in PHASES)


def _set(keys: Iterable[str], letter: str, single: Sequence[str]) -> list[str]:
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


def _powers(options: Mapping[str, Any]) -> list[str]:
    """The keys of U, P and Q, and of what stands beside them; [] where one is missing."""
    U = _set(options, "U", ("U", "U1")) or _some(options, "U")
    P = _set(options, "P", ("P",))
    Q = _set(options, "Q", ("Q",))
    if not (U and P and Q):
        return []
    angle = [key for key in ("U_angle", "U1_angle") if key in options][:1]
    return [*U, *P, *Q, *(key for key in ("f", "U2") if key in options), *angle]


def _telling_current(
    table: TableFile, options: Mapping[str, list[MappedColumn]], powers: Sequence[str]
) -> list[str]:
    """The key of a current [kA] beside powers, which tells whether a voltage whose name does not is
    line to line; [] where there is none, or no need.
    """
    voltage = options[powers[0]][0]
    keys = [key for key in ("I", "Ia", "Ib", "Ic", "I1") if key in options]
    told = voltage.role.line is not None or voltage.name == voltage.role.key == "U"
    if told or not voltage.role.unit or not keys or len(options[keys[0]]) > 1:
        return []
    current = options[keys[0]][0]
    known = len(_sample_numbers(table, current.number)) == len(table.sample)
    return [keys[0]] if current.role.unit and known else []


def _some(keys: Iterable[str], letter: str) -> list[str]:
    """The one or two phases, else lines, that are there of one quantity."""
    keys = set(keys)
    groups = ([letter + p for p in marks if letter + p in keys] for marks in (PHASES, LINES))
    return next((group for group in groups if group), [])


def _phasors(options: Mapping[str, Any]) -> list[str]:
    """Magnitudes and angles of voltages and currents, and f; [] where those of one are missing."""
    voltages = _phasor_keys(options, "U")
    currents = _phasor_keys(options, "I")
    if not (voltages and currents):
        return []
    return [*voltages, *currents, *(key for key in ("f",) if key in options)]


def _phasor_keys(options: Mapping[str, Any], letter: str) -> list[str]:
    """Magnitudes and angles of one quantity: of three phases where they are there, else of the
    positive sequence, else of two phases (of U two lines), which say the third. [] for none.
    """
    pairs = itertools.combinations(LINES if letter == "U" else PHASES, 2)
    for ends in (PHASES, LINES, ("1",), ("",), *pairs):
        keys = [key for end in ends for key in (letter + end, f"{letter}{end}_angle")]
        if options.keys() >= {*keys}:
            return keys
    return []


def _waveform(options: Mapping[str, Any]) -> list[str]:
    """Voltages and currents that may be waveforms: both, or those of one kind where no power stands
    beside them.
    """
    U, I = (_set(options, letter, ()) or _one_phase(options, letter) for letter in "UI")
    one_kind = len(U or I) == 3 and not _has(options, "P") and not _has(options, "Q")
    return [*U, *I] if (U and I) or one_kind else []


def _one_phase(options: Mapping[str, Any], letter: str) -> list[str]:
    """The key of the one column there is of a quantity; [] where there is none."""
    return [key for key in (letter, f"{letter}a", f"{letter}1") if key in options][:1]


def _oscillates(
    table: TableFile, options: Mapping[str, list[MappedColumn]], keys: Sequence[str]
) -> bool:
    """Whether a voltage among the columns takes both signs, as a waveform does and a magnitude does
    not.

    Where there is no voltage, whether a current does.
    """
    ours = [key for key in keys if key[0] == "U"] or keys
    samples = [_sample_numbers(table, options[key][0].number) for key in ours]
    return any(min(values, default=0.0) < 0 < max(values, default=0.0) for values in samples)


def _sample_numbers(table: TableFile, number: int) -> list[float]:
    """The numbers among a column's cells in the first rows, with either decimal mark."""
    cells = [row[number] for row in table.sample if number < len(row)]
    return [float(str(cell).replace(",", ".")) for cell in filter(is_plain_number, cells)]


def _describe_missing_columns(
    table: TableFile, options: Mapping[str, Any], groups: Mapping[str, Any]
) -> str:
    """The sentence on what is missing of a table whose columns make up `groups`."""
    names = [table.label(k) for k in find_other_columns(table, ())]
    if not names:
        return (
            f"{table.source}: no line names the columns; add one, such as t,U,P,Q, or name them by"
            f" number, from 0: {DATA.columns}={{t: 0, U: 1, P: 2, Q: 3}}"
        )
    listed = f"the header line names {', '.join(names)}"
    if groups and "t" in options:
        return (
            f"{table.source}: what {DATA.columns} names makes no table of powers, phasors or"
            f" waveforms with the others; {listed}; name all that are needed: {DATA.columns}={{t:"
            f" ..., U: ..., P: ..., Q: ...}}"
        )
    missing = [] if "t" in options else ["t"]
    if not groups:
        missing += _list_missing_powers(options)
    return (
        f"{table.source}: column {', '.join(missing)} is missing; {listed};"
        f" {_suggest_columns(table, options, missing)}"
    )


def _suggest_columns(table: TableFile, options: Mapping[str, Any], missing: Sequence[str]) -> str:
    """The setting that says which columns the missing ones are, with those that may be meant."""
    meant = {key: name for key in missing if (name := _meant(table, options, key))}
    said = ", ".join(f"{key}: '{meant[key]}'" if key in meant else f"{key}: ..." for key in missing)
    which = f"if {', '.join(meant.values())} is meant, say so" if meant else "say which is which"
    return f"{which}: {DATA.columns}={{{said}}}"


def _list_missing_powers(options: Mapping[str, Any]) -> list[str]:
    """Which of U, P and Q no column holds."""
    there = {"U": bool(_set(options, "U", ("U", "U1")))}
    there |= {letter: _has(options, letter) for letter in "PQ"}
    return [key for key, is_there in there.items() if not is_there]


def _meant(table: TableFile, options: Mapping[str, list[MappedColumn]], key: str) -> str:
    """The one column that may be meant by a key that is missing: of its quantity by name, or that
    counts up as t does.

    "" where there is none or several: a name that only looks alike says nothing.
    """
    if key == "t":
        return _find_counting_column(table, options)
    names = [name for name in options if name[0] == key and "_" not in name]
    alike = {one.number: one.name for name in names for one in options[name]}
    return next(iter(alike.values())) if len(alike) == 1 else ""


def _find_counting_column(table: TableFile, options: Mapping[str, list[MappedColumn]]) -> str:
    """The one column without a role that counts up as t does; "" for none or several."""
    taken = {one.number for one in itertools.chain(*options.values())}
    free = [k for k in find_other_columns(table, taken) if _increases(table, k)]
    return table.label(free[0]) if len(free) == 1 else ""


def _increases(table: TableFile, number: int) -> bool:
    """Whether a column increases in every row of the sample, as times do."""
    rows = sum(number < len(row) for row in table.sample)
    values = _sample_numbers(table, number)
    return len(values) == rows > 1 and all(a < b for a, b in itertools.pairwise(values))


def _check_unit(table: TableFile, one: MappedColumn) -> None:
    """Raise `UserError` for a column whose unit is one of another quantity."""
    quantity = one.role.quantity
    if one.role.unit and is_unit(one.role.unit) and not fits(quantity, one.role.unit):
        raise UserError(
            f"{table.source}: column {one.label} is read as {one.role.key}, of which"
            f" {one.role.unit} is no unit; say another column, {DATA.columns}={{{one.role.key}:"
            f" ...}}, or the unit, {DATA.units}={{{quantity}: {OF.get(quantity, ('',))[0]}}}"
        )


def _notes(
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
