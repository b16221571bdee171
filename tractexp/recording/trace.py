"""A feeder every half cycle: RMS of each phase (IEC 61000-4-30), sequence components, powers,
second harmonic.
"""

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.record.phasor import Phasors
from tractexp.record.phasor_measurement import BLOCK, WaveSource, turn_frame
from tractexp.record.record import Record


@dataclass(frozen=True, eq=False)
class Trace:
    """The quantities of a feeder, every half cycle. Voltages in the unit of the record, one row per
    recorded phase.
    """

    t: np.ndarray  # (M,) s, centers of the windows
    U: np.ndarray  # (M,) positive sequence, phase to ground
    phases: np.ndarray  # (K, M) RMS of each voltage; K = 0 where only U is recorded
    U2: np.ndarray  # (M,) nan where it is not recorded
    P: np.ndarray  # (M,) MW; nan where it is not recorded
    Q: np.ndarray  # (M,) Mvar
    f: np.ndarray  # (M,) Hz, at which the voltage turns
    I: np.ndarray  # (K, M) RMS of each current's fundamental; K = 0 where none is recorded
    second: np.ndarray  # (K, M) second harmonic of each current, RMS
    content: np.ndarray  # (K, M) RMS of each current about its mean: with all harmonics and noise
    cycle: float  # s, nominal

    @property
    def step(self) -> float:
        """The time between two samples [s]."""
        return float((self.t[-1] - self.t[0]) / (len(self.t) - 1))

    def without_currents(self) -> "Trace":
        """The trace as if no currents were recorded, nor powers."""
        none, unknown = self.I[:0], np.full(len(self.t), np.nan)
        return replace(self, P=unknown, Q=unknown, I=none, second=none, content=none)

    def jump(self, i: int) -> float:
        """Degrees by which the voltage's angle leaves, at sample i, the course it had before; nan
        where unknown.
        """
        reach = max(2, round(1.5 * self.cycle / self.step))
        first, stop = max(i - reach, 0), min(i + reach, len(self.t) - 1)
        before = self.f[max(first - 50, 0) : max(first - 1, 1)]
        if not np.isfinite(before).any():
            return float("nan")
        extra = self.f[first : stop + 1] - np.nanmedian(before)
        return float(360 * np.trapezoid(np.nan_to_num(extra), self.t[first : stop + 1]))


def trace_waves(
    waves: WaveSource, rate: float, start: float, nominal: float, phasors: Phasors
) -> Trace:
    """The trace of waveforms (2 K, N), voltages first, read a block at a time; `phasors` are those
    measured of them.
    """
    K, n = waves.shape[0] // 2, waves.shape[-1]
    first, last = phasors.t[0], phasors.t[-1]
    t = np.arange(first, last + 1e-9, 0.5 / nominal)
    f = _track_frequency(phasors, nominal)
    width = rate / np.interp(t, phasors.t, f)  # samples in a window
    center = (t - start) * rate + 0.5  # sample k lies between k and k + 1
    low, high = np.clip(center - width / 2, 0, n), np.clip(center + width / 2, 0, n)
    pieces: list[tuple[np.ndarray, np.ndarray]] = []
    for windows, (a, b) in _cut_in_blocks(low, high):
        x, mean = (
            waves[:, a:b],
            functools.partial(_average_windows, low=low[windows] - a, high=high[windows] - a),
        )
        turn = np.exp(
            -1j * turn_frame(np.interp(start + np.arange(a, b) / rate, phasors.t, f), rate)
        )
        pieces.append(
            (
                mean(np.concatenate([x**2, x[K:]])),
                np.abs(mean(np.concatenate([x[K:] * turn, x[K:] * turn**2]))),
            )
        )
    means, turned = (np.concatenate([piece[k] for piece in pieces], axis=1) for k in (0, 1))
    squares, offset = means[: 2 * K], means[2 * K :]
    return Trace(
        t,
        np.interp(t, phasors.t, np.abs(phasors.V1)),
        np.sqrt(squares[:K]),
        np.interp(t, phasors.t, np.abs(phasors.V2)) if K == 3 else np.full(len(t), np.nan),
        np.interp(t, phasors.t, phasors.S.real),
        np.interp(t, phasors.t, phasors.S.imag),
        _average_frequency(t, phasors.t, phasors.f),
        np.sqrt(2) * turned[:K],
        np.sqrt(2) * turned[K:],
        np.sqrt(np.maximum(squares[K:] - offset**2, 0)),
        1 / nominal,
    )


def join_traces(traces: Sequence[Trace]) -> Trace:
    """Traces that follow each other without a gap as one; what no window saw at a change of rate is
    interpolated.
    """
    if len(traces) == 1:
        return traces[0]
    at, step = np.concatenate([trace.t for trace in traces]), 0.5 * traces[0].cycle
    t = np.arange(at[0], at[-1] + 1e-9, step)

    def join(name: str) -> np.ndarray:
        values = np.concatenate([getattr(trace, name) for trace in traces], axis=-1)
        rows = [np.interp(t, at, row) for row in np.atleast_2d(values)]
        return rows[0] if values.ndim == 1 else np.array(rows).reshape(len(values), len(t))

    names = ("U", "phases", "U2", "P", "Q", "f", "I", "second", "content")
    return Trace(t, **{name: join(name) for name in names}, cycle=traces[0].cycle)


def compute_half_cycle_rms(
    waves: WaveSource, rate: float, frequency: float
) -> tuple[np.ndarray, np.ndarray]:
    """RMS over one cycle, taken anew each half cycle (IEC 61000-4-30, U_rms(1/2)) of waves (K, N).

    Returns the times of the windows' centers (M,) [s] from the first sample on and the values (K,
    M).
    """
    cycle = rate / frequency  # samples, not whole
    low = np.arange(0.0, waves.shape[-1] - cycle + 1e-9, cycle / 2)
    squares = [
        _average_windows(waves[:, a:b] ** 2, low[windows] - a, low[windows] + cycle - a)
        for windows, (a, b) in _cut_in_blocks(low, low + cycle)
    ]
    return (low + (cycle - 1) / 2) / rate, np.sqrt(np.maximum(np.concatenate(squares, axis=1), 0.0))


def _cut_in_blocks(low: np.ndarray, high: np.ndarray) -> Iterator[tuple[slice, tuple[int, int]]]:
    """Windows from `low` to `high` (M,), about as many at a time as lie in a block, and the samples
    that they need.
    """
    first = 0
    while first < len(low):
        windows = slice(first, max(int(np.searchsorted(low, low[first] + BLOCK)), first + 1))
        yield windows, (int(low[windows].min()), int(np.ceil(high[windows].max())))
        first = windows.stop


def _average_windows(x: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Means (K, M) of x (K, N) from `low` to `high` (M,), sample k lying between k and k + 1."""
    total = np.concatenate([np.zeros((len(x), 1), x.dtype), np.cumsum(x, axis=1)], axis=1)
    return (_interpolate(total, high) - _interpolate(total, low)) / (high - low)


def _interpolate(values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Values (K, N) at fractions of samples `at` (M,), by straight lines."""
    k = np.minimum(at.astype(int), values.shape[1] - 2)
    left = values.take(k, axis=1)
    return left + (at - k) * (values.take(k + 1, axis=1) - left)


def trace_record(record: Record) -> Trace:
    """The trace of a record: U, P, Q and, where they are there, f and U2, thinned to
    half cycles.
    """
    cycle = 1 / record.base.frequency
    every = max(1, round(0.5 * cycle * record.rate))
    n, unknown = record.samples // every * every, np.full(record.samples, np.nan)

    def thin(x: np.ndarray | None) -> np.ndarray:
        return (unknown if x is None else x)[:n].reshape(-1, every).mean(axis=1)

    none = np.empty((0, n // every))
    U, P, Q = thin(record.U), thin(record.P), thin(record.Q)
    return Trace(
        thin(record.t), U, none, thin(record.U2), P, Q, thin(record.f), none, none, none, cycle
    )


def _track_frequency(phasors: Phasors, nominal: float) -> np.ndarray:
    """The network's frequency at the phasors: a median over five cycles, within 10 % of nominal."""
    n = len(phasors.t)
    step = (phasors.t[-1] - phasors.t[0]) / max(n - 1, 1)
    half = max(1, round(2.5 / nominal / step)) if step > 0 else 1
    knots, smooth = np.arange(0, n, half), np.empty(len(range(0, n, half)))
    whole = (knots >= half) & (knots + half < n)  # whose five cycles lie within the record
    if whole.any():
        views = np.lib.stride_tricks.sliding_window_view(phasors.f, 2 * half + 1)
        smooth[whole] = np.median(views[knots[whole] - half], axis=1)
    for j in np.flatnonzero(~whole):
        smooth[j] = np.median(phasors.f[max(knots[j] - half, 0) : knots[j] + half + 1])
    return np.clip(np.interp(np.arange(n), knots, smooth), 0.9 * nominal, 1.1 * nominal)


def _average_frequency(t: np.ndarray, at: np.ndarray, f: np.ndarray) -> np.ndarray:
    """The mean of f between the middles of the steps of t, so that its integral, the angle, stays
    the same.
    """
    angle = np.concatenate([[0.0], np.cumsum((f[1:] + f[:-1]) / 2 * np.diff(at))])
    middles = np.concatenate([[t[0]], (t[1:] + t[:-1]) / 2, [t[-1]]])
    return np.diff(np.interp(middles, at, angle)) / np.diff(middles) if len(t) > 1 else f[:1]
