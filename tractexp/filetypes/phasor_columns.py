"""U, P and Q of a table of voltages and currents by size and angle."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from tractexp.errors import DATA, UserError
from tractexp.filetypes.column_key import LINES, PHASES
from tractexp.filetypes.column_options import MappedColumn
from tractexp.filetypes.column_unit import find_factor
from tractexp.filetypes.mapping import Mapped
from tractexp.filetypes.power_columns import Powers, has_absolute_unit, read_columns
from tractexp.filetypes.table import TableFile
from tractexp.record.angle import unwrap_angle
from tractexp.record.phasor import compute_sequences
from tractexp.recording.nominal_voltage import is_between_phases, measure_offset_from_nominal

# the positive sequence of line voltages over that of phase voltages
FORWARD = np.sqrt(3) * np.exp(1j * np.pi / 6)
LARGEST_KILOVOLTS = 1000.0  # a voltage without a unit that is above it is in V
NEAR_ONE = (0.3, 3.0)  # and within these it is per unit
PHASE_ANGLES = ("Ua_angle", "Ub_angle", "Uc_angle")


def read_phasors(table: TableFile, mapping: Mapped, nominal: float) -> Powers:
    """U, P and Q of a table of voltages and currents by size and angle."""
    values, start, note = read_columns(table, mapping)
    values, absolute = _convert_to_units(table, mapping, values)
    voltages = _list_magnitudes(values, "U")
    currents = _list_magnitudes(values, "I")
    scale, angle_notes = _find_angle_unit(table, mapping, values)
    V, turned = _turn_forward(
        _join_phasors(values, voltages, scale), [mapping.columns[k] for k in voltages]
    )
    V1, V2 = _compute_sequences(V, voltages)
    I1, _ = _compute_sequences(_join_phasors(values, currents, scale), currents)
    wiring: list[str] = []
    if absolute:
        V1, wiring = _refer_to_ground(mapping.columns[voltages[0]], V1)
    elif voltages[0][1:] in LINES:  # per unit of a line voltage
        V1 = np.sqrt(3) * V1
        V2 = None if V2 is None else np.sqrt(3) * V2
    # to line-to-line voltage and power of three phases; per unit both are as they stand
    line, three = (np.sqrt(3), 3.0) if absolute else (1.0, 1.0)
    S = three * V1 * I1.conj()
    columns = {"t": values["t"], "U": line * np.abs(V1), "P": S.real, "Q": S.imag}
    source = "U, P, Q from phasors"
    if V2 is not None:
        columns["U2"] = line * np.abs(V2)
        source += ", positive sequence"
    notes = [*mapping.notes, *note, *angle_notes, *turned, *wiring, source]
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


def _turn_forward(V: np.ndarray, sources: Sequence[MappedColumn]) -> tuple[np.ndarray, list[str]]:
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


def _refer_to_ground(one: MappedColumn, V: np.ndarray) -> tuple[np.ndarray, list[str]]:
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
    line = measure_offset_from_nominal(level) <= measure_offset_from_nominal(np.sqrt(3) * level)
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


def _convert_to_units(
    table: TableFile, mapping: Mapped, values: Mapping[str, np.ndarray]
) -> tuple[dict[str, np.ndarray], bool]:
    """(magnitudes in kV and kA or per unit, whether they are in kV and kA).

    Without units they are in V and A where a voltage can be nothing else, per unit where it is near
    one. Raises `UserError` where neither is so, and where one has a unit and another none, or one
    per unit.
    """
    sizes = {
        key: has_absolute_unit(mapping, key) for key in _list_magnitudes(mapping.columns, "UI")
    }
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


def _find_angle_unit(
    table: TableFile, mapping: Mapped, values: Mapping[str, np.ndarray]
) -> tuple[float, list[str]]:
    """The factor from the unit of the angles to rad, and a note where the values decided it."""
    angles = {key: one for key, one in mapping.columns.items() if key.endswith("_angle")}
    unit = next(filter(None, (one.role.unit for one in angles.values())), "")
    if unit:
        return find_factor(unit), []
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


def _compute_sequences(X: np.ndarray, keys: list[str]) -> tuple[np.ndarray, np.ndarray | None]:
    """Positive and negative sequence (N,) of phasors of three or two phases or lines; of one (1,
    N), it and None.
    """
    if len(X) == 1:
        return X[0], None
    marks = LINES if keys[0][1:] in LINES else PHASES
    three = [
        X[keys.index(k)] if (k := keys[0][0] + mark) in keys else -X.sum(axis=0) for mark in marks
    ]
    positive, negative = compute_sequences(np.array(three))
    if marks == LINES:
        return positive / FORWARD, negative / FORWARD.conjugate()
    return positive, negative
