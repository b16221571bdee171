"""Which columns of a table are time, voltage, power, ...: as the user says, else as their names tell."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from tractexp.errors import UserError, among, nearest
from tractexp.filetypes.cells import is_number, is_time
from tractexp.filetypes.columns import Role, is_unit, role
from tractexp.filetypes.table import Table

CONTRACT = ("t", "U", "P", "Q", "f", "U2")
PHASES = ("a", "b", "c")
LINES = ("ab", "bc", "ca")
KEYS = (
    *CONTRACT, "dfdt", "I", *(x + p for x in "UI" for p in (*PHASES, *LINES, "1", "2", "0") if x + p != "U2"),
    *(x + p for x in "PQ" for p in PHASES),
)  # fmt: skip
ANGLES = tuple(f"{key}_angle" for key in KEYS if key[0] in "UI")
QUANTITIES = ("t", "U", "I", "P", "Q", "f", "angle")  # as data.units names them


@dataclass(frozen=True)
class Chosen:
    """A column and what it is."""

    number: int
    name: str
    role: Role

    @property
    def told(self) -> str:
        return f"'{self.name}'" + (f" [{self.role.unit}]" if self.role.unit else "")


@dataclass(frozen=True)
class Mapped:
    """The columns of a table by key, and what kind of table they make."""

    kind: str  # powers, phasors, waves
    columns: Mapping[str, Chosen]
    notes: tuple[str, ...]


def mapped(table: Table, columns: Mapping[str, Any], units: Mapping[str, str], known: Collection[str] = ()) -> Mapped:
    """What the columns of a table are; `columns` {key: name or number from 0} and `units` {quantity: unit} are given.

    Columns `known` are used otherwise, so that nothing need be said of them.

    Raises `UserError` for a column that is asked for and not there, for one that is lacking, and for several that
    could be meant.
    """
    given = {_key(key): _given(table, key, asked) for key, asked in columns.items()}
    options = _options(table, given)
    kind, keys = _kind(table, options, given)
    chosen: dict[str, Chosen] = {}
    for key in keys:
        if len(options[key]) > 1:
            listed = ", ".join(one.told for one in options[key])
            raise UserError(
                f"{table.source}: {key} could be any of the columns {listed}; say which, e.g. "
                f"data.columns={{{key}: '{options[key][0].name}'}}"
            )
        chosen[key] = options[key][0]
    chosen = {key: _with_unit(one, units) for key, one in chosen.items()}
    return Mapped(kind, chosen, tuple(_notes(table, chosen, known)))


def check_mapping(columns: Mapping[str, Any], units: Mapping[str, str]) -> None:
    """Raise `UserError` for a key or a unit that there is not."""
    for name, given in {"columns": columns, "units": units}.items():
        if not isinstance(given, Mapping):
            raise UserError(f"data.{name}={given!s:.60} must be a mapping, such as data.{name}={{U: ...}}")
    for key in columns:
        _key(key)
    for quantity, unit in units.items():
        if quantity not in QUANTITIES:
            raise UserError(f"data.units names '{quantity}'{among(quantity, QUANTITIES, 'Quantities')}")
        if not is_unit(str(unit)):
            raise UserError(
                f"data.units: {quantity}={unit} is no unit that is known; e.g. kV, V, kA, A, MW, kW, Mvar, Hz, s, ms, "
                "deg, rad, pu"
            )


def _key(asked: str) -> str:
    """A key as `KEYS` spells it: ua, Va and UA are Ua, V1_angle is U1_angle."""
    known = {key.lower(): key for key in (*KEYS, *ANGLES)}
    plain = str(asked).lower()
    plain = "u" + plain[1:] if plain.startswith("v") else plain
    if plain not in known:
        raise UserError(f"data.columns names '{asked}'{among(str(asked), CONTRACT, 'Keys')}, or ua, ub, uc, ia, ib, ic")
    return known[plain]


def _given(table: Table, key: str, asked: Any) -> int:
    """The number of a column asked for by name, with or without its unit, or by number."""
    names = [name.strip() for name in table.heading.names]
    units = table.heading.units
    if isinstance(asked, int) or (str(asked).isdigit() and str(asked) not in names):
        if not 0 <= int(asked) < len(names):
            raise UserError(f"data.columns: {key}={asked}: {table.source} has {len(names)} columns, counted from 0")
        return int(asked)
    wanted = _squeezed(str(asked))
    found = [k for k, name in enumerate(names) if _squeezed(name) == wanted]
    found = found or [k for k, name in enumerate(names) if _squeezed(name + units[k]) == wanted]
    if not found:
        raise UserError(
            f"data.columns: {key}={asked}: {table.source} has no such column{among(str(asked), names, 'Columns')}"
        )
    if len(found) > 1:
        raise UserError(
            f"data.columns: {key}={asked}: {table.source} has that column {len(found)} times; give its number, one of "
            f"{', '.join(map(str, found))}"
        )
    return found[0]


def _squeezed(name: str) -> str:
    """A name without blanks and brackets, so that "U [kV]" is found as "U(kV)" or "U kV" too."""
    return "".join(c for c in name if c.isalnum())


def _options(table: Table, given: Mapping[str, int]) -> dict[str, list[Chosen]]:
    """{key: the columns that could be it}; what is given, and a name that is the key itself, excludes others."""
    heading, options = table.heading, {}
    for key, number in given.items():
        told = role(heading.names[number], heading.units[number])
        line = told.line if told and told.quantity == "U" else None
        options[key] = [Chosen(number, table.label(number), Role(key, heading.units[number], line))]
    free = [k for k in range(len(heading.names)) if k not in given.values() and heading.names[k]]
    roles = {k: made for k in free if (made := role(heading.names[k], heading.units[k]))}
    exact = {key for key in CONTRACT if key in [heading.names[k] for k in free]}
    if "U" not in exact and "U" not in given:
        exact.discard("U2")  # of U1, U2, U3
    renamed = _numbered(roles)
    for k, made in roles.items():
        name = heading.names[k]
        key = name if name in exact else renamed.get(made.key, made.key)
        if key in given or (key in exact and name != key):
            continue
        line = None if key == "U" and name == "U" else made.line
        options.setdefault(key, []).append(Chosen(k, name, replace(made, key=key, line=line)))
    return _timed(table, options)


def _numbered(roles: Mapping[int, Role]) -> dict[str, str]:
    """What U1, U2, U3 are: the phases where there are three; P1 alone is P."""
    keys, made = {one.key for one in roles.values()}, {}
    for letter in "UIPQ":
        for ending in ("", "_angle"):
            numbered = [f"{letter}{n}{ending}" for n in (1, 2, 3)]
            if keys.issuperset(numbered):
                made |= {old: f"{letter}{p}{ending}" for old, p in zip(numbered, PHASES, strict=True)}
            elif letter in "PQ" and numbered[0] in keys:
                made[numbered[0]] = letter
    return made


def _timed(table: Table, options: dict[str, list[Chosen]]) -> dict[str, list[Chosen]]:
    """Time told by a column of dates with times, where there is no other; of a date and a time, the time."""
    days = [one for one in options.pop("day", []) if any(is_time(row[one.number]) for row in table.sample[:1])]
    if "t" not in options and days:
        options["t"] = [replace(one, role=replace(one.role, key="t")) for one in days]
    return options


def _kind(table: Table, options: Mapping[str, Any], given: Iterable[str]) -> tuple[str, list[str]]:
    """What the table holds, and the keys that make it up, t first; raises `UserError` for what is no such table."""
    keys, asked = set(options), set(given)
    made: dict[str, list[str]] = {}
    wave = _waveform(options)
    if wave and (not _powers(options) or (_has(keys, "P") and _oscillates(table, options, wave))):
        made["waves"] = wave
    if powers := _powers(options):
        made["powers"] = powers
    if phasors := _phasors(options):
        made["phasors"] = phasors
    order = [kind for kind in ("phasors", "waves", "powers") if kind in made]
    if "powers" in made and not ("waves" in made and _oscillates(table, options, wave)):
        order.remove("powers")
        order.insert(0, "powers")
    for kind in order:
        if asked <= {"t", *made[kind]} and "t" in keys:
            if kind == "waves" and not _oscillates(table, options, wave):
                raise UserError(
                    f"{table.source}: the columns {_named(options, wave)} hold magnitudes without angles, and "
                    "there are none of P and Q: the load's power cannot be told from them; add P and Q, or the angles"
                )
            return kind, ["t", *made[kind]]
    raise UserError(_lacking(table, options, made))


def _has(keys: Iterable[str], letter: str) -> bool:
    return letter in keys or all(letter + p in keys for p in PHASES)


def _set(keys: Iterable[str], letter: str, single: Sequence[str]) -> list[str]:
    """The keys that give one quantity: one column, or three phases, or three lines."""
    keys = set(keys)
    for group in (*([one] for one in single), [letter + p for p in PHASES], [letter + p for p in LINES]):
        if keys.issuperset(group):
            return [*group]
    return []


def _powers(options: Mapping[str, Any]) -> list[str]:
    U = _set(options, "U", ("U", "U1"))
    P, Q = _set(options, "P", ("P",)), _set(options, "Q", ("Q",))
    return [*U, *P, *Q, *(key for key in ("f", "U2") if key in options)] if U and P and Q else []


def _phasors(options: Mapping[str, Any]) -> list[str]:
    """Magnitudes and angles: of three phases where they are there, else of the positive sequence."""
    made: list[str] = []
    for letter in "UI":
        groups = [[letter + p for p in PHASES], [letter + p for p in LINES], [f"{letter}1"], [letter]]
        whole = [g for g in groups if all(k in options and f"{k}_angle" in options for k in g)]
        if not whole:
            return []
        made += [key for k in whole[0] for key in (k, f"{k}_angle")]
    return [*made, *(key for key in ("f",) if key in options)]


def _waveform(options: Mapping[str, Any]) -> list[str]:
    U, I = (_set(options, letter, ()) or [k for k in (letter, letter + "a", letter + "1") if k in options][:1]
            for letter in "UI")  # fmt: skip
    return [*U, *I] if U and I else []


def _oscillates(table: Table, options: Mapping[str, list[Chosen]], keys: Sequence[str]) -> bool:
    """Whether a voltage among the columns takes both signs, as a waveform does and a magnitude does not."""
    for key in (key for key in keys if key[0] == "U"):
        cells = [row[options[key][0].number] for row in table.sample if options[key][0].number < len(row)]
        values = [float(str(cell).replace(",", ".")) for cell in cells if is_number(cell) or is_number(cell, ",")]
        if values and min(values) < 0 < max(values):
            return True
    return False


def _named(options: Mapping[str, list[Chosen]], keys: Iterable[str]) -> str:
    return ", ".join(options[key][0].told for key in keys)


def _lacking(table: Table, options: Mapping[str, Any], made: Mapping[str, Any]) -> str:
    """The sentence on what is missing."""
    names = [table.label(k) for k in range(len(table.heading.names)) if table.heading.names[k]]
    if not names:
        return (
            f"{table.source}: no line names the columns; add one, such as t,U,P,Q, or name them by number, from 0: "
            "data.columns={t: 0, U: 1, P: 2, Q: 3}"
        )
    if made:
        missing = [key for key in ("t",) if key not in options] or ["what data.columns names"]
    else:
        missing = [key for key in ("t", "P", "Q") if not _has(options, key)]
        missing[len(missing) and missing[0] == "t" : 0] = [] if _set(options, "U", ("U", "U1")) else ["U"]
    hint = nearest(missing[0], names)
    meant = hint.partition("'")[2].rpartition("'")[0] or names[-1]
    return (
        f"{table.source}: column {', '.join(missing)} is missing; the header line names {', '.join(names)}{hint}; if "
        f"another name is meant, say so: data.columns={{{missing[0]}: '{meant}'}}"
    )


def _with_unit(one: Chosen, units: Mapping[str, str]) -> Chosen:
    """The unit that is given goes before that in the header."""
    quantity = one.role.quantity
    return replace(one, role=replace(one.role, unit=str(units[quantity]))) if quantity in units else one


def _notes(table: Table, chosen: Mapping[str, Chosen], known: Collection[str]) -> list[str]:
    """What was taken for what, where names alone do not say it; and the columns left over."""
    notes, used = [], {one.number for one in chosen.values()}
    if any(key != one.name or table.heading.units[one.number] for key, one in chosen.items()):
        notes.append("columns: " + ", ".join(f"{key} = {one.told}" for key, one in chosen.items()))
    spare = [name for k, name in enumerate(table.heading.names) if name and k not in used and name not in known]
    return [*notes, f"columns not used: {', '.join(spare)}"] if spare else notes
