"""Tables of direct current: voltages of 600 to 3000 V with currents or powers, no RMS values.

What is known: a name with DC, a Q that is missing or zero beside a voltage of such railways, and
the ripple of their rectifiers, six or twelve times the network's frequency.
"""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from tractexp.errors import DATA, UserError
from tractexp.filetypes.columns import factor, role
from tractexp.filetypes.mapping import PHASES, map_times
from tractexp.filetypes.moments import times_of
from tractexp.filetypes.table import TableFile
from tractexp.recording.railway import DirectVoltage

NOMINAL = (0.6, 0.75, 1.5, 3.0)  # kV of direct-current railways (EN 50163)
FROM_NOMINAL = 0.2  # of it, by which the mean may differ
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
    names, named = table.heading.names, [bool(NAMED.search(name)) for name in table.heading.names]
    roles = {
        k: one
        for k, name in enumerate(names)
        if (one := role(NAMED.sub(" ", name).strip(), table.heading.units[k]))
    }
    volts = [k for k, one in roles.items() if one.key in ("U", "U1")]
    keys = {one.key for one in roles.values()}
    if len(volts) != 1 or any(key[1:] in PHASES or "angle" in key or key[0] == "Q" for key in keys):
        return ""
    (number,) = volts
    unit = units.get("U") or roles[number].unit
    try:
        mapping = map_times(table)
        times = {one.number: "number" for one in mapping.columns.values()}
        times[mapping.columns["t"].number] = "time"
        cells = table.read({**times, number: "gaps"})
        t, x = times_of(table, mapping, cells).t, cells[number].values * factor(unit)
    except UserError:
        return ""
    if not unit and np.nanmedian(x) > LARGEST_DIRECT_KILOVOLTS:
        x = x / 1000
    rate = (len(t) - 1) / float(t[-1] - t[0]) if len(t) > 1 and t[-1] > t[0] else 0.0
    direct = DirectVoltage.from_values(x, rate) if rate else None
    if direct is None or not direct.is_direct:
        return ""
    alone = (
        not keys & {"I", "P"} and not _find_pulses(x, rate) and not _is_direct_alone(direct.mean)
    )
    if not any(named) and (alone or not _is_railway(direct.mean)):
        return ""
    said = direct.describe(names[number], float(t[0]))
    if any(named):
        return said
    return (
        f"{said}; that it is no RMS value is told by {1000 * direct.mean:.4g} V, near a nominal"
        " one of direct current, without Q or angles: if it is one, add Q"
    )


def _is_direct_alone(mean: float) -> bool:
    """Whether a mean [kV] is near a nominal direct voltage, and near none of an alternating one
    that it may be the RMS of.
    """
    near = any(abs(mean / nominal - 1) <= FROM_NOMINAL / 4 for nominal in NOMINAL)
    return near and not any(abs(mean / other - 1) <= FROM_NOMINAL / 4 for other in ALTERNATING_NEAR)


def _is_railway(mean: float) -> bool:
    """Whether a mean [kV] is near a nominal direct voltage of railways."""
    return any(abs(mean / nominal - 1) <= FROM_NOMINAL for nominal in NOMINAL)


def check_alternating(
    source: str, name: str, columns: Mapping[str, np.ndarray], declared: bool
) -> list[str]:
    """Raise `UserError` where U [kV], P and Q of a table are those of direct current; else what is
    said of a voltage that may be.

    `declared` says that the user gave an alternating nominal voltage.
    """
    t, U, P, Q = (columns[key] for key in "tUPQ")
    level = float(np.nanmedian(U))
    rate = (len(t) - 1) / float(t[-1] - t[0]) if len(t) > 1 and t[-1] > t[0] else 0.0
    direct = (
        DirectVoltage.from_values(U, rate) if rate and not declared and _is_railway(level) else None
    )
    if direct is None or not direct.is_direct:
        return []
    without = np.nanmax(np.abs(Q), initial=0.0) <= NO_Q * np.nanmax(np.abs(P), initial=0.0)
    pulses = _find_pulses(U, rate)
    reasons = [f"a ripple of {pulses:g} Hz"] if pulses else []
    if without:
        reasons.append("Q is zero")
    if NAMED.search(name):
        reasons.append("its name")
    if reasons:
        raise UserError(
            f"{source}: {direct.describe(name, float(t[0]))}; told by {' and '.join(reasons)};"
            f" if it is an RMS value, say its nominal voltage, {DATA.base_voltage}={level:.3g}"
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
