"""When samples were taken: segments of one rate, from declared rates or time stamps, evened where
they are uneven.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tractexp.errors import UserError
from tractexp.recording.recording import Segment

# rates closer than this belong to one waveform whose sampling follows the network's frequency
LARGEST_RATE_DIFFERENCE = 0.02
# of a step: the departure from even steps that is not worth an interpolation
LARGEST_UNEVENNESS = 0.002
# a step longer or shorter than its neighbour by this factor starts another segment
LARGEST_STEP_RATIO = 1.5
MOST_SEGMENTS = 1000  # segments: more are no segments but stamps without order


@dataclass(frozen=True)
class SampleStretch:
    """Samples first to stop of the file, at times `t` (M,) [s] where they are not
    even, else None.
    """

    segment: Segment
    first: int
    stop: int
    t: np.ndarray | None = None


def build_from_rates(
    rates: Sequence[tuple[float, int]], t: np.ndarray | None = None
) -> list[SampleStretch]:
    """From (Hz, last sample counted from 1); neighbours of nearly one rate become one segment.

    `t` (N,) [s], are good time stamps, which say when a segment begins and whether two are joined.
    """
    groups: list[list[tuple[float, int, int]]] = []
    first = 0
    for rate, stop in rates:
        joined = t is None or first == 0 or t[first] - t[first - 1] < LARGEST_STEP_RATIO / rate
        if groups and joined and abs(rate / groups[-1][0][0] - 1) <= LARGEST_RATE_DIFFERENCE:
            groups[-1].append((rate, first, stop))
        else:
            groups.append([(rate, first, stop)])
        first = stop
    stretches: list[SampleStretch] = []
    start = 0.0
    for group in groups:
        start += 1 / group[0][0] if stretches else 0.0
        stretches.append(
            _build_declared_stretch(group, start if t is None else float(t[group[0][1]]))
        )
        last = stretches[-1].segment
        start = last.start + (last.stop - last.first - 1) / last.rate
    return stretches


def _build_declared_stretch(group: list[tuple[float, int, int]], start: float) -> SampleStretch:
    """One stretch of samples at declared rates [(rate, first, stop)], resampled where they
    differ.
    """
    first, stop = group[0][1], group[-1][2]
    if len({rate for rate, _, _ in group}) == 1:
        return SampleStretch(Segment(first, stop, group[0][0], start), first, stop)
    steps = np.concatenate([np.full(b - a, 1 / rate) for rate, a, b in group])[1:]
    t = start + np.concatenate([[0.0], np.cumsum(steps)])
    rate = (stop - first - 1) / float(t[-1] - t[0])
    return SampleStretch(
        Segment(first, stop, rate, start),
        first,
        stop,
        None if _measure_unevenness(t, rate) <= LARGEST_UNEVENNESS else t,
    )


def build_from_stamps(t: np.ndarray, unit: float, where: str) -> list[SampleStretch]:
    """From times (N,) [s] of every sample, exact to `unit` [s]; raises `UserError` where they do
    not increase.
    """
    steps = np.diff(t)
    if not len(steps):
        raise UserError(f"{where}: one sample alone has no sampling rate; give a longer record")
    if steps.min() <= 0 or not np.isfinite(steps).all():
        i = int(np.argmax(~(steps > 0)))
        raise UserError(
            f"{where}: sample {i + 2}: its time stamp {t[i + 1]:g} s is not after {t[i]:g} s of the"
            " sample before, and the sampling rate is declared as 0, so that the time stamps must"
            " be valid; write the rate into the .cfg"
        )
    stretches = [
        _build_stamped_stretch(t, unit, first, stop)
        for first, stop in _find_even_runs(steps, unit, where)
        if stop - first > 1
    ]
    if not stretches:
        raise UserError(
            f"{where}: time stamps without order: no two steps between samples are alike"
        )
    return stretches


def _find_even_runs(steps: np.ndarray, unit: float, where: str) -> list[tuple[int, int]]:
    """(first, stop) of the samples between which the steps are alike; a gap belongs to none."""
    longer, shorter = np.maximum(steps[1:], steps[:-1]), np.minimum(steps[1:], steps[:-1])
    breaks = np.flatnonzero(longer > LARGEST_STEP_RATIO * shorter + 2 * unit) + 1
    if len(breaks) > 2 * MOST_SEGMENTS:
        i = int(breaks[0])
        raise UserError(
            f"{where}: sample {i + 1}: time stamps without order: a step of {steps[i]:g} s follows"
            f" one of {steps[i - 1]:g} s, and {len(breaks) - 1} more are like it"
        )
    edges = [0, *breaks.tolist(), len(steps)]
    runs: list[tuple[int, int]] = []
    taken = 0
    for k, (a, b) in enumerate(pairwise(edges)):
        if b - a == 1 and len(edges) > 2 and _is_gap(edges, k):
            continue  # between two segments
        runs.append((max(a, taken), b + 1))
        taken = b + 1
    return runs


def _is_gap(edges: list[int], k: int) -> bool:
    """A single step between longer runs."""
    before = edges[k] - edges[k - 1] if k else 0
    after = edges[k + 2] - edges[k + 1] if k + 2 < len(edges) else 0
    return max(before, after) > 1


def _build_stamped_stretch(t: np.ndarray, unit: float, first: int, stop: int) -> SampleStretch:
    """One stretch of samples at stamped times, resampled where those are uneven."""
    own = t[first:stop]
    length = float(own[-1] - own[0])
    rate = (len(own) - 1) / length
    # a whole number, to the resolution of the stamps
    if abs(round(rate) - rate) <= rate * unit / length:
        rate = float(round(rate))
    worst = _measure_unevenness(own, rate)
    uneven = worst > LARGEST_UNEVENNESS + 1.01 * unit * rate
    return SampleStretch(
        Segment(first, stop, rate, float(own[0])), first, stop, own if uneven else None
    )


def _measure_unevenness(t: np.ndarray, rate: float) -> float:
    """Greatest departure from even steps, in steps."""
    return float(np.abs((t - t[0]) * rate - np.arange(len(t))).max())


def arrange_segments(stretches: Sequence[SampleStretch]) -> list[Segment]:
    """The segments after `evened`: numbered from 0 without what lies between them where anything is
    interpolated.
    """
    if all(s.t is None for s in stretches):
        return [s.segment for s in stretches]
    segments, first = [], 0
    for s in stretches:
        count = s.stop - s.first
        segments.append(Segment(first, first + count, s.segment.rate, s.segment.start))
        first += count
    return segments


def resample_evenly(
    raw: np.ndarray, stretches: Sequence[SampleStretch], missing: float | None
) -> np.ndarray:
    """Values (N,) at even times, by cubic splines; those of even stretches as they are."""
    if all(s.t is None for s in stretches):
        return raw
    return np.concatenate(
        [_interpolate_stretch(raw[s.first : s.stop], s, missing) for s in stretches]
    )


def take_nearest(raw: np.ndarray, stretches: Sequence[SampleStretch]) -> np.ndarray:
    """States (N,) at even times: those of the sample closest in time."""
    if all(s.t is None for s in stretches):
        return raw
    parts = []
    for s in stretches:
        own = raw[s.first : s.stop]
        parts.append(own if s.t is None else own[_find_closest(s.t, _spread_times(s))])
    return np.concatenate(parts)


def _spread_times(s: SampleStretch) -> np.ndarray:
    """The even times [s] of a stretch."""
    return s.segment.start + np.arange(s.stop - s.first) / s.segment.rate


def _find_closest(t: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """The index of the closest time to each one that is wanted."""
    right = np.clip(np.searchsorted(t, wanted), 1, len(t) - 1)
    return np.where(wanted - t[right - 1] <= t[right] - wanted, right - 1, right)


def _interpolate_stretch(raw: np.ndarray, s: SampleStretch, missing: float | None) -> np.ndarray:
    """A stretch's values at even times, by cubic splines; what is missing stays so."""
    from scipy.interpolate import CubicSpline

    values = raw.astype(np.float64)
    lacking = ~np.isfinite(values) if missing is None else ~np.isfinite(values) | (raw == missing)
    values[lacking] = np.nan
    if s.t is None or lacking.all():
        return values
    if lacking.any():
        values[lacking] = np.interp(s.t[lacking], s.t[~lacking], values[~lacking])
    times = _spread_times(s)
    even = CubicSpline(s.t, values)(times) if len(values) > 3 else np.interp(times, s.t, values)
    even[lacking[_find_closest(s.t, times)]] = np.nan
    return even
