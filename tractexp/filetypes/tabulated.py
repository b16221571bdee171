"""The content of a table, from its columns: what it holds, and a load's powers against time."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.errors import DATA, UserError
from tractexp.filetypes.column_key import LINES, PHASES, check_mapping
from tractexp.filetypes.column_options import MappedColumn
from tractexp.filetypes.columns import PER_UNIT, factor
from tractexp.filetypes.direct_table import check_alternating, describe_direct_table
from tractexp.filetypes.mapping import Mapped, map_columns, map_voltage
from tractexp.filetypes.moments import times_of
from tractexp.filetypes.row_quality import find_bad_rows, find_filled_rows
from tractexp.filetypes.sidecar import Sidecar, read_sidecar
from tractexp.filetypes.table import TableFile, TableForm, instrument_of, open_table
from tractexp.record import Base, Record
from tractexp.record.angle import unwrap_angle
from tractexp.record.phasor import sequences
from tractexp.recording.nominal_voltage import is_between_phases, off_nominal
from tractexp.recording.snapshot import OTHER_FREQUENCY, nearest_nominal
from tractexp.recording.unit import SECONDARY_LINES
from tractexp.storage.files import locate_file

# the positive sequence of line voltages over that of phase voltages
FORWARD = np.sqrt(3) * np.exp(1j * np.pi / 6)
LARGEST_KILOVOLTS = 1000.0  # a voltage without a unit that is above it is in V
NEAR_ONE = (0.3, 3.0)  # and within these it is per unit
LEAST_LIVE_VOLTAGE = 0.5  # of the median voltage: at less the frequency is noise
SLOWEST = 10.0  # Hz: no network's frequency is lower
ANGLES = frozenset(("U_angle", "U1_angle"))  # of the voltage, beside powers
PHASE_ANGLES = ("Ua_angle", "Ub_angle", "Uc_angle")
BESIDE = ANGLES | {"U2"}
WHOLE_TURN = 0.85  # of a turn: an angle that steps by more from row to row was wrapped there
AGREES = 0.05  # of the apparent power, within which it is the product of voltage and current


@dataclass(frozen=True, kw_only=True)
class Tabular:
    """The settings of readers of tables; what is not set is detected, and a note says how it was
    read.
    """

    # {U: name of a column, or its number from 0}
    columns: dict[str, Any] = field(default_factory=dict)
    # {U: kV, P: MW, t: ms} where the header does not have them
    units: dict[str, str] = field(default_factory=dict)
    decimal: str = ""  # decimal mark, "." or ","
    header: int | None = None  # line of the columns' names, from 1
    sheet: Any = None  # of a workbook, by name or number from 1
    encoding: str | None = None  # of a text file

    def check_table(self) -> None:
        """Raise `UserError` for a setting that cannot be."""
        check_mapping(self.columns, self.units)
        self._form.check()

    @property
    def _form(self) -> TableForm:
        """How the table is written, as the settings say."""
        return TableForm(self.decimal, self.header, self.sheet, self.encoding)

    def table_of(
        self, path: str, sidecar: Sidecar, join: Sequence[str] = ()
    ) -> tuple[TableFile, Mapped]:
        """A table, with those of the same event, and what its columns are; raises `UserError` for
        what is no table, or ambiguous.
        """
        table = open_table(path, replace(self._form, join=tuple(join)))
        columns = {**sidecar.columns, **self.columns}
        units = {**sidecar.units, **self.units}
        try:
            return table, map_columns(table, columns, units, sidecar.more)
        except UserError:
            if said := describe_direct_table(table, units):
                raise UserError(f"{table.source}: {said}") from None
            raise

    def record_voltage(
        self, source: str, path: str, join: Sequence[str], nominal: float
    ) -> Record | None:
        """The line voltage [kV, or as it stands without a unit] of a table without powers as a
        record of `source`, P and Q unknown (nan); None where it holds more, or cannot be read.
        """
        try:
            table = open_table(path, replace(self._form, join=tuple(join)))
            mapping = map_voltage(table)
            if mapping is None or describe_direct_table(table, self.units):
                return None
            return _record_voltage(source, table, mapping, nominal)
        except UserError:
            return None


def _record_voltage(source: str, table: TableFile, mapping: Mapped, nominal: float) -> Record:
    values, start, said = _read(table, mapping)
    keys = [key for key in values if key[0] == "U"]
    columns = {"U": np.mean([values[key] for key in keys], axis=0)}
    absolute = _absolute(mapping, keys[0])
    lines = _to_lines(columns, mapping.columns[keys[0]], None) if absolute else []
    level = float(np.nanmedian(columns["U"])) if absolute else 1.0
    record = Record(
        name=Path(source).stem,
        t=values["t"],
        U=columns["U"] / level,
        P=np.zeros(len(values["t"])),
        Q=np.zeros(len(values["t"])),
        source=source,
        base=Base(level, frequency=table.frequency or nominal),
        identity={"time": start.isoformat()} if start else {},
        notes=(*table.notes, *said, *lines),
    )
    even = record.uniform(table.place)
    unknown = np.full(even.samples, np.nan)
    return replace(even, P=unknown, Q=unknown)


def kind_of(path: str, *join: str) -> str:
    """The kind of the table in a file, or in those of one event: "powers", "phasors" or "waves";
    "powers" where it is ambiguous.
    """
    try:
        sidecar = read_sidecar(path)
        instrument = instrument_of(locate_file(path))
        if sidecar.recording is not None or (
            instrument and instrument.holds_waveforms(locate_file(path))
        ):
            return "waves"
        return map_columns(
            open_table(path, TableForm(join=join), whole=False), sidecar.columns, sidecar.units
        ).kind
    except UserError:
        return "powers"  # whose reader says what is wrong


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


def powers(
    table: TableFile, mapping: Mapped, nominal: float, reverse: bool, kilovolts: bool
) -> Powers:
    """What a table of powers or of phasors holds.

    `reverse` negates P and Q; `kilovolts` says that a voltage without a unit is in kV. Raises
    `UserError` for cells that are no numbers, and for ambiguous units.
    """
    if mapping.kind == "phasors":
        result = _of_phasors(table, mapping, nominal)
    elif mapping.kind == "powers":
        result = _read_powers(table, mapping, kilovolts)
    else:
        raise UserError(
            f"{table.source} holds waveforms"
            f" ({', '.join(c.label for c in mapping.columns.values())}), not powers; read it as"
            f" such: data=waveforms data.path={table.source}"
        )
    if reverse:
        result.columns["P"], result.columns["Q"] = -result.columns["P"], -result.columns["Q"]
    return _tune_nominal_frequency(result, nominal, mapping.columns.get("f"))


def _tune_nominal_frequency(result: Powers, declared: float, source: MappedColumn | None) -> Powers:
    """The powers with the nominal frequency [Hz] that f shows, else the declared one, and without
    an f that is none; a note on what was found.
    """
    if "f" not in result.columns or source is None:
        return replace(result, frequency=declared)
    columns = {**result.columns}
    U = result.columns["U"]
    f = (
        columns["f"]
        if source.role.unit.strip().lower() not in PER_UNIT
        else columns["f"] * declared
    )
    alive = LEAST_LIVE_VOLTAGE * np.nanmedian(U) < U
    level = float(np.nanmedian(f[alive])) if np.isfinite(f[alive]).any() else declared
    if level < SLOWEST:
        del columns["f"]
        note = (
            f"{source.label} is about {level:.3g}, a deviation from the nominal frequency or per"
            " unit of it: not used"
        )
        return replace(result, columns=columns, notes=(*result.notes, note), frequency=declared)
    columns["f"], nominal = f, nearest_nominal(level)
    if nominal is None or abs(nominal / declared - 1) < OTHER_FREQUENCY:
        return replace(result, columns=columns, frequency=declared)
    note = (
        f"f is {level:.5g} Hz: {nominal:.3g} Hz is taken for nominal, where {declared:g} Hz stands"
        " in the settings"
    )
    return replace(result, columns=columns, notes=(*result.notes, note), frequency=nominal)


def _read_powers(table: TableFile, mapping: Mapped, kilovolts: bool) -> Powers:
    """The powers of a table with columns of U, P and Q: U the mean of its phases, P and Q their
    sums, with the time and, where the table has them, f, U2 and the voltage's angle.

    `kilovolts` says that a voltage without a unit is in kV. Raises `UserError` for cells that are
    no numbers, and for ambiguous units.
    """
    _check_power_units(table, mapping)
    values, start, said = _read(table, mapping)
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
        columns["U_angle"], note = _turned_angle(mapping.columns[key], values[key])
        notes.append(note)
    absolute = {"U": _absolute(mapping, keys["U"][0]), "P": _absolute(mapping, keys["P"][0])}
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
    notes += _to_lines(columns, one, current)
    if absolute and not kilovolts:
        notes += _describe_secondary_size(columns)
    return replace(result, notes=(*result.notes, *notes))


def _turned_angle(one: MappedColumn, values: np.ndarray) -> tuple[np.ndarray, str]:
    """An angle (N,) in rad, not wrapped, and what is said of it.

    Without a unit it is in degrees where it is wrapped by 360, else in rad.
    """
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    by_degrees = float(steps.max(initial=0.0)) > WHOLE_TURN * 360
    scale = factor(one.role.unit) if one.role.unit else np.pi / 180 if by_degrees else 1.0
    unit = one.role.unit or ("deg, for it is wrapped by 360" if by_degrees else "rad")
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


def _to_lines(
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
    product = None if current is None else _by_power(columns, current)
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


def _by_power(columns: Mapping[str, np.ndarray], current: np.ndarray) -> bool | None:
    """Whether a voltage is line to line by S = sqrt(3) U I, where that or S = 3 U I holds; else
    None.
    """
    size = np.hypot(columns["P"], columns["Q"])
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = size / (np.abs(columns["U"]) * np.abs(current))
    ratio = float(np.median(ratio[np.isfinite(ratio)])) if np.isfinite(ratio).any() else 0.0
    fits = {line: abs(ratio / by - 1) < AGREES for line, by in ((True, np.sqrt(3)), (False, 3.0))}
    return next((line for line, good in fits.items() if good), None)


def _absolute(mapping: Mapped, key: str) -> bool | None:
    """Whether a column is in V, A, W or the like; None where it names no unit."""
    unit = mapping.columns[key].role.unit.strip().lower()
    return None if not unit else unit not in PER_UNIT


def _read(
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
        and (by := factor(one.role.unit)) != 1
    }
    values.pop("frac", None)
    read = times_of(table, mapping, cells)
    values["t"] = read.t
    bad, said = find_bad_rows(table, len(read.t))
    for key in values.keys() - {"t"}:
        values[key] = np.where(bad | lost, np.nan, values[key])
    return values, read.start, (*read.notes, *said, *lost_said)


def _of_phasors(table: TableFile, mapping: Mapped, nominal: float) -> Powers:
    """U, P and Q of a table of voltages and currents by size and angle."""
    values, start, note = _read(table, mapping)
    values, absolute = _in_units(table, mapping, values)
    voltages = _list_magnitudes(values, "U")
    currents = _list_magnitudes(values, "I")
    scale, angle_notes = _radians(table, mapping, values)
    V, turned = _forward(
        _join_phasors(values, voltages, scale), [mapping.columns[k] for k in voltages]
    )
    V1, V2 = _sequences(V, voltages)
    I1, _ = _sequences(_join_phasors(values, currents, scale), currents)
    sort: list[str] = []
    if absolute:
        V1, sort = _to_ground(mapping.columns[voltages[0]], V1)
    elif voltages[0][1:] in LINES:  # per unit of a line voltage
        V1 = np.sqrt(3) * V1
        V2 = None if V2 is None else np.sqrt(3) * V2
    size, three = (np.sqrt(3), 3.0) if absolute else (1.0, 1.0)
    S = three * V1 * I1.conj()
    columns = {"t": values["t"], "U": size * np.abs(V1), "P": S.real, "Q": S.imag}
    source = "U, P, Q from phasors"
    if V2 is not None:
        columns["U2"] = size * np.abs(V2)
        source += ", positive sequence"
    notes = [*mapping.notes, *note, *angle_notes, *turned, *sort, source]
    columns["U_angle"] = unwrap_angle(np.angle(V1))
    if "f" in values:
        is_whole = np.nanmedian(values["f"]) > nominal / 2  # else the deviation from nominal
        columns["f"] = values["f"] if is_whole else nominal + values["f"]
    else:
        notes.append(f"f from the angle of the voltage, which stands still at {nominal:g} Hz")
    return Powers(columns, {"U": absolute, "P": absolute}, (*table.notes, *notes), start=start)


def _join_phasors(
    values: Mapping[str, np.ndarray], keys: Sequence[str], scale: float
) -> np.ndarray:
    """The phasors (K, N) of magnitudes and their angles, `scale` rad each one."""
    return np.array([values[k] * np.exp(1j * scale * values[f"{k}_angle"]) for k in keys])


def _list_magnitudes(keys: Iterable[str], letters: str) -> list[str]:
    """The keys of voltages or currents but for those of their angles."""
    return [key for key in keys if key[0] in letters and not key.endswith("_angle")]


def _forward(V: np.ndarray, sources: Sequence[MappedColumn]) -> tuple[np.ndarray, list[str]]:
    """Phasors (K, N) of line voltages as AB, BC, CA; a note where all are named the other way, as
    V1 - V2 is.
    """
    backward = np.array([one.role.backward for one in sources])
    if not backward.any():
        return V, []
    names = ", ".join(one.label for one in sources)
    if backward.all():
        return V, [
            f"{names} taken as V1 - V2 and so on (where U21 is V2 - V1, the power is the opposite)"
        ]
    return np.where(backward, -1, 1)[:, None] * V, []


def _to_ground(one: MappedColumn, V: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """The phasors (N,) of one voltage, to ground, and what they were taken for where its name does
    not say it.
    """
    level = float(np.nanmedian(np.abs(V)))
    if one.role.key[1:] in PHASES and one.role.line is None and is_between_phases(level):
        why = f"{level:.4g} kV is near a nominal voltage, and times sqrt(3) near none"
        return V / FORWARD, [f"{one.label} and the others taken as line to line, for {why}"]
    if one.role.key != "U" or one.role.line is False:
        return V, []
    if one.role.line:
        return V / np.sqrt(3), []
    line = off_nominal(level) <= off_nominal(np.sqrt(3) * level)
    if line:
        why = (
            f"taken as line to line: {level:.4g} kV is nearer to a nominal voltage than"
            f" {np.sqrt(3) * level:.4g} kV"
        )
        return V / np.sqrt(3), [
            f"{one.label} {why} (data.columns={{U1: ..., U1_angle: ...}} says phase to ground)"
        ]
    why = (
        f"taken as phase to ground: times sqrt(3) it is {np.sqrt(3) * level:.4g} kV, nearer to a"
        " nominal voltage"
    )
    return V, [f"{one.label} {why} (a name with LL says line to line)"]


def _in_units(
    table: TableFile, mapping: Mapped, values: Mapping[str, np.ndarray]
) -> tuple[dict[str, np.ndarray], bool]:
    """(magnitudes in kV and kA or per unit, whether they are in kV and kA).

    Without units they are in V and A where a voltage can be nothing else, per unit where it is near
    one. Raises `UserError` where neither is so, and where one has a unit and another none, or one
    per unit.
    """
    sizes = {key: _absolute(mapping, key) for key in _list_magnitudes(mapping.columns, "UI")}
    stated = {*sizes.values()}
    level = float(np.nanmedian(np.abs(values[_list_magnitudes(sizes, "U")[0]])))
    if stated == {None} and level > LARGEST_KILOVOLTS:
        return {**values, **{key: values[key] * 1e-3 for key in sizes}}, True
    if stated == {None} and NEAR_ONE[0] < level < NEAR_ONE[1]:
        return {**values}, False
    if stated in ({True}, {False}):
        return {**values}, stated == {True}
    raise UserError(
        f"{table.source}: {_describe_odd_unit(mapping, sizes, level)}: say the units, e.g."
        f" {DATA.units}={{U: kV, I: A}}"
    )


def _describe_odd_unit(mapping: Mapped, sizes: Mapping[str, bool | None], level: float) -> str:
    """Which column is unlike the others, or without a unit: `sizes` are per unit where False,
    without a unit where None; the voltage is about `level`.
    """
    for key, is_absolute in sizes.items():
        if is_absolute is None:
            return f"{mapping.columns[key].label} has no unit, and its voltage is {level:.4g}"
    odd = next(key for key, is_absolute in sizes.items() if not is_absolute)
    return f"{mapping.columns[odd].label} is per unit and others are not"


def _radians(
    table: TableFile, mapping: Mapped, values: Mapping[str, np.ndarray]
) -> tuple[float, list[str]]:
    """The factor from the unit of the angles to rad, and a note where the values decided it."""
    angles = {key: one for key, one in mapping.columns.items() if key.endswith("_angle")}
    unit = next(filter(None, (one.role.unit for one in angles.values())), "")
    if unit:
        return factor(unit), []
    widest = max(float(np.nanmax(np.abs(values[key]), initial=0.0)) for key in angles)
    if widest > 2 * np.pi:
        return np.pi / 180, ["angles taken as degrees, for they exceed 2 pi"]
    if _are_thirds_apart([values[key] for key in angles if key in PHASE_ANGLES]):
        return 1.0, ["angles taken as rad, for the phases are 2 pi/3 apart"]
    raise UserError(
        f"{table.source}: {next(iter(angles.values())).label} has no unit, and its values suit"
        f" degrees and rad: say {DATA.units}={{angle: deg}} or {DATA.units}={{angle: rad}}"
    )


def _are_thirds_apart(angles: Sequence[np.ndarray]) -> bool:
    """Whether angles (N,) are those of three phases in rad, a third of a turn apart."""
    if len(angles) != 3:
        return False
    apart = np.nanmedian(np.abs(np.mod(angles[1] - angles[0] + np.pi, 2 * np.pi) - np.pi))
    return abs(apart - 2 * np.pi / 3) < 0.3


def _sequences(X: np.ndarray, keys: list[str]) -> tuple[np.ndarray, np.ndarray | None]:
    """Positive and negative sequence (N,) of phasors of three or two phases or lines; of one (1,
    N), it and None.
    """
    if len(X) == 1:
        return X[0], None
    marks = LINES if keys[0][1:] in LINES else PHASES
    three = [
        X[keys.index(k)] if (k := keys[0][0] + mark) in keys else -X.sum(axis=0) for mark in marks
    ]
    positive, negative = sequences(np.array(three))
    if marks == LINES:
        return positive / FORWARD, negative / FORWARD.conjugate()
    return positive, negative
