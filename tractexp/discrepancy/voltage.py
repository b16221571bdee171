"""The voltage channel's own noise. The load never saw it, but a simulation driven by the record does.

Before the event the voltage is replaced by a straight line, and where it is smooth by a smoothing spline. Smooth is
where wide averages agree with all narrower ones (intersection of confidence intervals: Goldenshluger and Nemirovski
1997). Near the edges of a dip only narrow averages agree, biased by as much as they may scatter and over as many
samples as they span; those samples weigh less. Left as recorded they would do more harm: whatever smooths the
calculated power, such as a measurement window, would seem to be there.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.identify.noise import runs
from tractexp.record import Event

HALF_WIDTHS = (1, 2, 3, 5, 8, 12, 18, 27)  # samples; with the last an average has no bias to speak of
NARROW, WIDE = 2.0, 3.0  # standard deviations within which averages agree: at edges, and to call a stretch smooth
MARGIN = 8  # samples beside an edge that are not smooth
SILENT = 1e-5  # pu: less noise than this is none


@dataclass(frozen=True, eq=False)
class Blur:
    """What noise of the voltage did to the calculated power before it was taken out, and how much of it is left."""

    jitter: np.ndarray  # (2, N) pu
    left: np.ndarray  # (N,) share of its variance, as white noise that does as much harm


def smoothed(event: Event) -> tuple[Event, np.ndarray]:
    """The event with a smooth voltage, and the share of the noise's variance left at each sample, (N,)."""
    U, deviation = event.record.U, noise_of(event.record.U[event.steady])
    if deviation < SILENT:
        return event, np.zeros(len(U))
    made, left = _averaged(U, deviation, NARROW)[0], np.full(len(U), 1 + NARROW**2)
    for part in _smooth_stretches(_averaged(U, deviation, WIDE)[1]):
        made[part], left[part] = _spline(U[part]), 3 / (part.stop - part.start)
    t, steady = np.arange(len(U)), event.steady
    made[steady] = np.polyval(np.polyfit(t[steady], U[steady], 1), t[steady])
    left[steady] = 3 / (steady.stop - steady.start)
    return replace(event, record=replace(event.record, U=made)), left


def noise_of(U: np.ndarray) -> float:
    """Standard deviation of white noise on a smooth voltage (n,), from its third differences."""
    third = np.diff(U, 3)
    return float(np.median(np.abs(third)) / 0.6745 / np.sqrt(20)) if len(third) else 0.0


def _averaged(U: np.ndarray, deviation: float, agreement: float) -> tuple[np.ndarray, np.ndarray]:
    """The widest averages that agree with all narrower ones (N,), and whether that is the widest of all."""
    index, sums = np.arange(len(U)), np.concatenate(([0.0], np.cumsum(U)))
    best = U.copy()
    low, high = U - agreement * deviation, U + agreement * deviation
    agrees = np.ones(len(U), dtype=bool)
    for half in HALF_WIDTHS:
        h = np.minimum(half, np.minimum(index, index[::-1]))  # symmetric at the ends too, or a slope would bend
        mean = (sums[index + h + 1] - sums[index - h]) / (2 * h + 1)
        reach = agreement * deviation / np.sqrt(2 * h + 1)
        low, high = np.maximum(low, mean - reach), np.minimum(high, mean + reach)
        agrees &= low <= high
        best = np.where(agrees, mean, best)
    return best, agrees


def _smooth_stretches(agrees: np.ndarray) -> list[slice]:
    """Stretches long enough for a spline, away from where averages disagree."""
    edge = np.convolve(~agrees, np.ones(2 * MARGIN + 1), "same") > 0.5
    return [p for p in runs(~edge) if p.stop - p.start >= HALF_WIDTHS[-1]]


def _spline(U: np.ndarray) -> np.ndarray:
    """Cubic smoothing spline of a stretch (n,), its stiffness by generalized cross-validation."""
    from scipy.interpolate import make_smoothing_spline

    t = np.arange(len(U), dtype=float)
    return make_smoothing_spline(t, U)(t)


def smooth(events: Sequence[Event]) -> tuple[tuple[Event, ...], np.ndarray]:
    """All events smoothed, and the shares left end to end."""
    made = [smoothed(e) for e in events]
    return tuple(e for e, _ in made), np.concatenate([left for _, left in made])
