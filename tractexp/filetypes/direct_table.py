"""Tables of direct current: voltages of 600 to 3000 V with currents or powers, no RMS values.

What is known: a name with DC, a Q that is missing or zero beside a voltage of such railways, and
the ripple of their rectifiers, six or twelve times the network's frequency.
"""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from tractexp.errors import DATA, UserError
from tractexp.filetypes.column_key import PHASES
from tractexp.filetypes.column_unit import find_factor
from tractexp.filetypes.columns import Role, find_role
from tractexp.filetypes.mapping import map_times
from tractexp.filetypes.moments import compute_times
from tractexp.filetypes.table import TableFile
from tractexp.recording.railway import (
    ALTERNATING,
    FROM_NOMINAL_DIRECT,
    DirectVoltage,
    is_near_direct_nominal,
)

ALTERNATING_NEAR = (0.69, 3.3)  # kV: alternating voltages near those
NAMED = re.compile(
    r"(?<![a-z])dc(?![a-z])|(?<=[uvip])[_ ]?dc(?![a-z])|gleich(?=spannung|strom)"
    r"|постоянн\w*|直流",
    re.IGNORECASE,
)
RIPPLES = (300.0, 600.0, 360.0, 720.0)  # Hz: of six and twelve pulses at 50 and 60 Hz
LEAST_RIPPLE, RIPPLE_SHARE = 1e-3, 0.5  # of the mean; of all that is faster than 100 Hz
LEAST_RIPPLE_FREQUENCY = 100.0  # Hz
NO_Q = 1e-6  # of P: so much Q is none
LARGEST_DIRECT_KILOVOLTS = 100.0  # a voltage without a unit that is above it is in V


def describe_direct_table(table: TableFile, units: Mapping[str, str]) -> str:
    """That a table without Q, or angles, is of direct current, with mean, ripple and dip, one
    sentence; "" where it is not, or may be something else.
    """
    names, roles = table.heading.names, _read_roles(table)
    keys = {one.key for one in roles.values()}
    number = _find_voltage(roles)
    if number is None:
        return ""
    try:
        t, x = _read_column(table, number, units.get("U") or roles[number].unit)
    except UserError:
        return ""
    direct = _find_direct(t, x)
    if direct is None:
        return ""
    said = f"{direct.describe(names[number], float(t[0]))}; {ALTERNATING}"
    if any(map(NAMED.search, names)):
        return said
    told = not keys.isdisjoint("IP") or _is_told(direct.mean, t, x)
    if not told or not is_near_direct_nominal(direct.mean):
        return ""
    return (
        f"{said}; that it is no RMS value is told by {1000 * direct.mean:.4g} V, near a nominal one"
        " of direct current, without Q or angles: if it is one, add Q"
    )


def _read_roles(table: TableFile) -> dict[int, Role]:
    """{number of a column: its role by its name without what says direct current}."""
    names = [NAMED.sub(" ", name).strip() for name in table.heading.names]
    roles = map(find_role, names, table.heading.units)
    return {k: one for k, one in enumerate(roles) if one}


def _find_voltage(roles: Mapping[int, Role]) -> int | None:
    """The number of the one voltage among columns; None where there are several, or one that
    tables of direct current do not have: of Q, of a phase, an angle.
    """
    volts = []
    for number, one in roles.items():
        if one.key[0] == "Q" or one.key[1:] in PHASES or "angle" in one.key:
            return None
        if one.key in ("U", "U1"):
            volts.append(number)
    return volts[0] if len(volts) == 1 else None


def _read_column(table: TableFile, number: int, unit: str) -> tuple[np.ndarray, np.ndarray]:
    """The times (N,) [s] of a table and one of its columns [kV], by its size where it has no unit.
    Raises `UserError` for cells that are none.
    """
    mapping = map_times(table)
    kinds = {one.number: "number" for one in mapping.columns.values()}
    kinds |= {mapping.columns["t"].number: "time"}
    cells = table.read({**kinds, number: "gaps"})
    x = cells[number].values * find_factor(unit)
    if not unit and np.nanmedian(x) > LARGEST_DIRECT_KILOVOLTS:
        x = x / 1000
    return compute_times(table, mapping, cells).t, x


def _find_direct(t: np.ndarray, x: np.ndarray) -> DirectVoltage | None:
    """The direct voltage that a column (N,) [kV] shows; None where it is none."""
    rate = _find_sampling_rate(t)
    direct = DirectVoltage.from_values(x, rate) if rate else None
    return direct if direct and direct.is_direct else None


def _find_sampling_rate(t: np.ndarray) -> float:
    """Samples a second of times (N,) [s]; 0 where they do not increase."""
    return (len(t) - 1) / float(t[-1] - t[0]) if len(t) > 1 and t[-1] > t[0] else 0.0


def _is_told(mean: float, t: np.ndarray, x: np.ndarray) -> bool:
    """Whether the ripple of a voltage (N,) [kV], or its mean, says that it is direct."""
    return bool(_find_pulses(x, _find_sampling_rate(t))) or _is_direct_alone(mean)


def _is_direct_alone(mean: float) -> bool:
    """Whether a mean [kV] is near a nominal direct voltage, and near none of an alternating one
    that it may be the RMS of.
    """
    most = FROM_NOMINAL_DIRECT / 4
    alternating = any(abs(mean / other - 1) <= most for other in ALTERNATING_NEAR)
    return is_near_direct_nominal(mean, most) and not alternating


def check_alternating(
    source: str, name: str, columns: Mapping[str, np.ndarray], declared: bool
) -> list[str]:
    """Raise `UserError` where U [kV], P and Q of a table are those of direct current; else what is
    said of a voltage that may be.

    `declared` says that the user gave an alternating nominal voltage.
    """
    t, U, P, Q = (columns[key] for key in "tUPQ")
    level = float(np.nanmedian(U))
    direct = None if declared or not is_near_direct_nominal(level) else _find_direct(t, U)
    if direct is None:
        return []
    pulses = _find_pulses(U, _find_sampling_rate(t))
    without_Q = np.nanmax(np.abs(Q), initial=0.0) <= NO_Q * np.nanmax(np.abs(P), initial=0.0)
    telling = {
        f"a ripple of {pulses:g} Hz": pulses,
        "Q is zero": without_Q,
        "its name": NAMED.search(name),
    }
    if reasons := [reason for reason, holds in telling.items() if holds]:
        raise UserError(
            f"{source}: {direct.describe(name, float(t[0]))}; {ALTERNATING}; told by"
            f" {' and '.join(reasons)}; if it is an RMS value, say its nominal voltage,"
            f" {DATA.base_voltage}={level:.3g}"
        )
    return [
        f"{level:.4g} kV may be a direct voltage of railways: taken as RMS of an alternating one,"
        " for there is Q"
    ]


def _find_pulses(U: np.ndarray, rate: float) -> float:
    """The frequency [Hz] of a rectifier's ripple where it makes up most of what is fast; else 0."""
    x = U[np.isfinite(U)]
    if rate < 2.5 * min(RIPPLES) or len(x) < 0.1 * rate:
        return 0.0
    lines = np.abs(np.fft.rfft((x - x.mean()) * np.hanning(len(x)))) ** 2
    f = np.fft.rfftfreq(len(x), 1 / rate)
    fast = f > LEAST_RIPPLE_FREQUENCY
    # mean square of a Hann window is 3/8
    size = np.sqrt(2 * lines[fast].sum() / (3 / 8)) / len(x)
    near: Sequence[float] = [lines[np.abs(f - one) < 0.02 * one].sum() for one in RIPPLES]
    if size < LEAST_RIPPLE * abs(x.mean()) or max(near) < RIPPLE_SHARE * lines[fast].sum():
        return 0.0
    return RIPPLES[int(np.argmax(near))]
