"""Pole slips: a voltage that swings with machines that have lost synchronism."""

from collections.abc import Sequence

import numpy as np

from tractexp.recording.event_kind import LARGEST_SWITCHING_STEP
from tractexp.recording.excursion import Excursion
from tractexp.recording.trace import Trace

SWING = 0.1  # of the voltage: how deep the swings of a pole slip are at least
SWINGS = 2  # so many at least
SWING_PERIOD = (0.15, 5.0)  # s
LARGEST_PERIOD_RATIO = 3.0  # the longest period of a pole slip over its shortest, at most
LARGEST_SWING_UNBALANCE = 0.05  # U2 over U1: swings are balanced, faults are not


def is_swing_of_slip(trace: Trace, e: Excursion, slip: Excursion) -> bool:
    """Whether an excursion is a swing of a pole slip: in it, or a smaller one right beside it."""
    near = round(SWING_PERIOD[1] / 5 / trace.step) if abs(e.worst) < LARGEST_SWITCHING_STEP else 0
    return e.start < slip.end + near and e.end > slip.start - near


def _find_even_end(trace: Trace, lows: Sequence[int], first: int) -> int:
    """The number of the low after the last that follows the `first` at even distances."""
    last = first + 1
    while last < len(lows) and _are_even(trace.t[lows[first : last + 1]]):
        last += 1
    return last


def find_pole_slips(trace: Trace) -> list[Excursion]:
    """Spans of two or more smooth balanced swings of the voltage, of about one period each."""
    width = max(1, round(2 * trace.cycle / trace.step)) | 1
    U = np.convolve(np.pad(trace.U, width // 2, "edge"), np.full(width, 1 / width), "valid")
    level = float(np.percentile(U, 90))
    if level <= 0:
        return []
    lows = [k for k in _find_swings(U / level) if _smooth(U / level, k, trace)]
    lows = [k for k in lows if not trace.U2[k] > LARGEST_SWING_UNBALANCE * max(trace.U[k], level)]
    slips, first = [], 0
    while first < len(lows):
        last = _find_even_end(trace, lows, first)
        if last - first >= SWINGS:
            half = int(np.diff(lows[first:last]).max()) // 2
            a, b = max(lows[first] - half, 0), min(lows[last - 1] + half + 1, len(U))
            if slips and a - slips[-1].end < 2 * half:
                a = slips.pop().start
            slips.append(
                Excursion(a, b, float(U[a:b].min() / level - 1), True, False, False, level)
            )
        first = last
    return slips


def _find_swings(u: np.ndarray) -> list[int]:
    """Minima of u that lie lower by `SWING` than the maxima on either side."""
    lows, low, high, falling = [], 0, 0, False
    for k in range(1, len(u)):
        if falling:
            low = k if u[k] < u[low] else low
            if u[k] > u[low] + SWING:
                lows.append(low)
                falling, high = False, k
        else:
            high = k if u[k] > u[high] else high
            if u[k] < u[high] - SWING:
                falling, low = True, k
    return lows


def _smooth(u: np.ndarray, k: int, trace: Trace) -> bool:
    """Whether the fall to a minimum and the rise from it both take their time: no fault begins or
    ends so.
    """
    within = max(2, round(2 * trace.cycle / trace.step))
    reach = round(SWING_PERIOD[1] / 2 / trace.step)
    for part in (u[max(k - reach, 0) : k + 1][::-1], u[k : k + reach + 1]):
        top = int(np.argmax(part >= part[0] + SWING)) + within
        part = part[: top + 1]
        if len(part) > within and np.abs(part[within:] - part[:-within]).max() > 0.7 * np.ptp(part):
            return False
    return True


def _are_even(t: np.ndarray) -> bool:
    """Whether times (n,) [s] follow one another as those of a swing do."""
    steps = np.diff(t)
    low, high = SWING_PERIOD
    return bool(
        steps.min() >= low
        and steps.max() <= high
        and steps.max() <= LARGEST_PERIOD_RATIO * steps.min()
    )
