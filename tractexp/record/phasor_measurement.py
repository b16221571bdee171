"""Phasors measured in sampled waveforms: weighted windows at the frequency really present."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from tractexp.errors import UserError
from tractexp.record.phasor import Phasors, compute_symmetrical

SLOWEST, FASTEST = 0.9, 1.1  # of the nominal frequency: what is tracked
SMOOTHED = 4.0  # cycles, over which a tracked frequency is
PASSES = 3  # of the tracking, each at the frequency that the previous one measured
DEAD_PHASOR_SHARE = 0.01  # of the highest voltage: a phasor below it has no angle to speak of
BLOCK = 1 << 15  # samples measured at once, about: what fits into a processor's cache


class WaveSource(Protocol):
    """Voltages [kV] and as many currents [kA], (2 K, N): an array, or what is read when it is
    sliced like one.
    """

    @property
    def shape(self) -> tuple[int, ...]: ...

    def __getitem__(self, at: Any, /) -> np.ndarray: ...


Means = Callable[[np.ndarray, float, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Averager:
    """The window of an estimator at one sampling rate.

    `means(y, rate, frequency, at)` are weighted means (..., M) of y (..., N), sampled at `rate`
    [Hz], about the samples `at` (M,), the weights of sum 1; `frequency` (N,) [Hz] is that of the
    waveforms behind y.
    """

    reach: int  # samples it needs on either side of its center
    means: Means


def compute_cycle_means(
    y: np.ndarray, rate: float, frequency: np.ndarray, at: np.ndarray
) -> np.ndarray:
    """Means over one cycle, to a fraction of a sample: the two end samples have
    fractional weights.
    """
    cycle = rate / frequency[at]  # samples
    whole = np.floor(cycle / 2 - 0.5).astype(int)  # of full weight on either side of the center
    total = np.zeros((*y.shape[:-1], y.shape[-1] + 1), dtype=y.dtype)
    np.cumsum(y, axis=-1, out=total[..., 1:])
    low, high = at - whole, at + whole + 1
    sums = total.take(high, axis=-1) - total.take(low, axis=-1)
    sums += (cycle / 2 - 0.5 - whole) * (y.take(high, axis=-1) + y.take(low - 1, axis=-1))
    return sums / cycle


def one_cycle(rate: float, nominal: float) -> Averager:
    """The plain mean over one cycle of the frequency really present.

    Its reach is that of a cycle of the lowest frequency that is tracked. `rate` is that of the
    samples and `nominal` the network's frequency, both in Hz.
    """
    return Averager(int(rate / (SLOWEST * nominal) / 2 + 0.5) + 1, compute_cycle_means)


def make_weighted_averager(weights: np.ndarray) -> Averager:
    """The averager of symmetric weights (2 reach + 1,).

    It uses the fast Fourier transform, as windows may be long.
    """
    reach, weights = len(weights) // 2, weights / weights.sum()

    def means(y: np.ndarray, rate: float, frequency: np.ndarray, at: np.ndarray) -> np.ndarray:
        from scipy.fft import next_fast_len

        length = next_fast_len(y.shape[-1])  # what wraps around falls where no whole window lies
        filtered = np.fft.ifft(np.fft.fft(y, length) * np.fft.fft(weights, length)).take(
            at + reach, axis=-1
        )
        return filtered if np.iscomplexobj(y) else filtered.real

    return Averager(reach, means)


def turn_frame(f: np.ndarray, rate: float) -> np.ndarray:
    """The angle of a frame that turns at given frequencies.

    Parameters
    ----------
    f : (N,) [Hz]
        Frequencies, on straight lines between samples.
    rate : float [Hz]
        Of the samples.

    Returns
    -------
    (N,) array [rad]
        Zero at sample 0.

    Examples
    --------
    >>> (turn_frame(np.full(3, 50.0), 100.0) / np.pi).tolist()
    [0.0, 1.0, 2.0]
    """
    return np.concatenate([[0.0], np.cumsum((f[1:] + f[:-1]) * np.pi / rate)])


def measure_fundamental(
    x: np.ndarray,
    rate: float,
    frequency: float | np.ndarray,
    at: np.ndarray,
    means: Means = compute_cycle_means,
    harmonics: Sequence[int] = (),
) -> np.ndarray:
    """The RMS phasors of a waveform.

    In each window the least-squares sinusoid is taken, x = sqrt(2) Re(X e^{j phi}), so that a
    phasor is exact at any frequency, where the plain DFT leaks its mirror image: with S and G the
    weighted means of x e^{-j phi} and e^{-2 j phi}, the normal equation sqrt(2) S = X + G X* is
    solved for X.

    Parameters
    ----------
    x : (..., N)
        Waveforms.
    rate : float [Hz]
        Of the samples.
    frequency : float or (N,) [Hz]
        At which the frame turns in which phasors are told.
    at : (M,) ints
        Samples at the centers of the windows, about which whole ones must lie inside.
    means : function
        The weighted means of an estimator.
    harmonics : ints
        Whose phasors are asked for, in frames as many times as fast; none: the fundamental.

    Returns
    -------
    (..., M) or (H, ..., M) complex array
        RMS, in the unit of x.

    Examples
    --------
    >>> t = np.arange(400) / 4000
    >>> x = 10 * np.sqrt(2) * np.cos(2 * np.pi * 48 * t + 0.5)
    >>> X = measure_fundamental(x, 4000, 48.0, np.array([200]))
    >>> np.abs(X).round(3).tolist(), np.angle(X).round(3).tolist()
    ([10.0], [0.5])
    """
    f = np.broadcast_to(np.asarray(frequency, dtype=float), x.shape[-1])
    angle = turn_frame(f, rate)
    phasors = []
    for h in harmonics or (1,):
        turn = np.exp(-1j * h * angle)
        S, G = means(x * turn, rate, f, at), means(turn**2, rate, f, at)
        phasors.append(np.sqrt(2) * (S - G * S.conj()) / (1 - np.abs(G) ** 2))
    return np.array(phasors) if harmonics else phasors[0]


def measure_turning(angle: np.ndarray, rate: float) -> np.ndarray:
    """The frequency (N,) [Hz] at which a phasor's angle (N,) [rad] turns in its frame.

    Examples
    --------
    >>> angle = 2 * np.pi * 0.5 * np.arange(5) / 100
    >>> measure_turning(angle, 100.0).round(6).tolist()
    [0.5, 0.5, 0.5, 0.5, 0.5]
    """
    return np.gradient(np.unwrap(angle)) * rate / (2 * np.pi)


def track(voltages: np.ndarray, rate: float, nominal: float, least: float = 0.0) -> np.ndarray:
    """The frequency of phase voltages, sample by sample.

    It is the mean speed of the positive-sequence voltage (of the one there is) over 4 cycles about
    each sample. Three passes, each at the frequency that the previous one measured, remove the
    error of the frequency from the phasors. A voltage below `least` has no angle: spans end before
    it, and within the nominal frequency is taken.

    Parameters
    ----------
    voltages : (K, N)
        Three phases, or one.
    rate : float [Hz]
        Of the samples.
    nominal : float [Hz]
        The network's frequency; the result is within 10 % of it.
    least : float
        In the unit of the voltages.

    Returns
    -------
    (N,) array [Hz]
    """
    n, (every, reach, half) = voltages.shape[-1], _choose_tracking_grid(rate, nominal)
    at = np.arange(reach, n - reach, every)
    f = np.full(n, nominal)
    for _ in range(PASSES):
        V1 = compute_symmetrical(measure_fundamental(voltages, rate, f, at))[0]
        angle = np.unwrap(np.angle(V1)) + turn_frame(f, rate)[at]
        speed = _measure_speed(angle, np.abs(V1) < least, half) * rate / every / (2 * np.pi)
        f = np.interp(
            np.arange(n),
            at,
            np.clip(np.nan_to_num(speed, nan=nominal), SLOWEST * nominal, FASTEST * nominal),
        )
    return f


def _measure_speed(angle: np.ndarray, dead: np.ndarray, half: int) -> np.ndarray:
    """The mean increase (M,) of an angle a step, over `half` steps either way or up to where it is
    dead; nan where it is.
    """
    k, last = np.arange(len(angle)), len(angle) - 1
    early = np.maximum(k - half, np.maximum.accumulate(np.where(dead, k + 1, 0)))
    late = np.minimum(k + half, np.minimum.accumulate(np.where(dead, k - 1, last)[::-1])[::-1])
    speed = np.full(len(angle), np.nan)
    np.divide(
        angle[late] - angle[early.clip(max=last)], late - early, out=speed, where=late > early
    )
    return speed


def _choose_tracking_grid(rate: float, nominal: float) -> tuple[int, int, int]:
    """Samples from one tracked phasor to the next, samples a phasor needs on either side, phasors
    in half a span.
    """
    every = max(1, int(rate / nominal / 20))
    return every, one_cycle(rate, nominal).reach, int(SMOOTHED * rate / nominal / 2 / every)


def measure(
    waves: WaveSource,
    rate: float,
    nominal: float,
    start: float = 0.0,
    step: float = 1e-3,
    skew: np.ndarray | None = None,
    window: Callable[[float, float], Averager] = one_cycle,
    harmonics: Sequence[int] = (),
    block: int = BLOCK,
    tracked: dict[int, np.ndarray] | None = None,
) -> Phasors:
    """The phasors of sampled waveforms.

    Parameters
    ----------
    waves : (2 K, N)
        Voltages [kV], then as many currents [kA]; N spans two cycles, and the window, at least.
    rate, nominal : float [Hz]
        Of the samples, and of the network.
    start : float [s]
        Time of the first sample.
    step : float [s]
        Between phasors: the nearest whole number of samples.
    skew : (2 K,) [s]
        How much later than its time stamp each channel is sampled.
    window : (rate, nominal) -> Averager
        What the estimator averages over.
    harmonics : ints
        Whose powers are asked for, with that of all but the fundamental and the total distortions.
    block : int
        Samples that are measured at a time, about.
    tracked : {first sample: frequencies}
        Frequencies tracked before in the blocks of the same voltages, which loads of one bus share;
        those that are tracked here are added.

    Returns
    -------
    Phasors

    Raises
    ------
    UserError
        For waveforms that are too short.
    """
    n, K, over, every = (
        waves.shape[-1],
        waves.shape[0] // 2,
        window(rate, nominal),
        max(1, round(step * rate)),
    )
    needed = max(2 * rate / (SLOWEST * nominal) + 4, 2 * (over.reach + every) + 1)
    if n < needed:
        raise UserError(
            f"{n} samples at {rate:g} Hz are too short: phasors need {1000 * needed / rate:.0f} ms,"
            f" over two cycles of {nominal:g} Hz and more than their window"
        )
    tracked = {} if tracked is None else tracked
    least = (
        DEAD_PHASOR_SHARE
        * max(float(np.abs(waves[:K, a:b]).max()) for a, b in _cut_in_blocks(n, block))
        / np.sqrt(2)
    )
    at, angle, pieces, distortions = np.arange(over.reach, n - over.reach, every), 0.0, [], []
    for (first, stop), (a, b) in _cut_overlapping_blocks(n, rate, nominal, over.reach, block):
        x = waves[:, first:stop]
        f = tracked[a] = tracked[a] if a in tracked else track(x[:K], rate, nominal, least=least)
        here = at[(at >= a) & (at < b)] - first
        turned = turn_frame(f, rate)
        X = measure_fundamental(x, rate, f, here, over.means, (1, *harmonics))
        X *= np.exp(1j * np.array([1, *harmonics])[:, None, None] * (turned[a - first] - angle))
        angle += turned[min(b, n - 1) - first] - turned[a - first]
        if skew is not None:
            X *= np.exp(
                -2j * np.pi * np.array([1, *harmonics])[:, None, None] * f[here] * skew[:, None]
            )
        pieces.append((X[0], f[here]))
        if harmonics:
            products = over.means(np.concatenate([x**2, x[:K] * x[K:]]), rate, f, here)
            distortions.append(
                _measure_distortion(X, products[: 2 * K], products[2 * K :], harmonics)
            )
    X, f = (np.concatenate([part[k] for part in pieces], axis=-1) for k in (0, 1))
    more = {
        name: np.concatenate([one[name] for one in distortions])
        for name in next(iter(distortions), ())
    }
    phasors = Phasors(start + at / rate, X[:K], X[K:], f, more)
    return replace(phasors, f=_measure_frequency(phasors, rate / every, least))


def _measure_distortion(
    X: np.ndarray, squares: np.ndarray, power: np.ndarray, harmonics: Sequence[int]
) -> dict[str, np.ndarray]:
    """The powers and distortions of phasors X (1 + H, 2 K, M), for waves with these mean squares
    and products (`power`).

    Source: IEEE 1459-2010, 3.1.2: P_H = P - P_1 and THD = sqrt((V/V_1)^2 - 1), which count whatever
    is not the fundamental; of three phases together as in its effective values, 3.2.2.
    """
    K = X.shape[1] // 2
    channels = {"P_H": power.sum(axis=0) - np.real(X[0, :K] * X[0, K:].conj()).sum(axis=0)}
    channels |= {
        f"P_{h}": np.real(V * I.conj()).sum(axis=0)
        for h, V, I in zip(harmonics, X[1:, :K], X[1:, K:], strict=True)
    }
    for name, side in (("THD_u", slice(K)), ("THD_i", slice(K, None))):
        one = (np.abs(X[0, side]) ** 2).sum(axis=0)
        rest = np.maximum(squares[side].sum(axis=0) - one, 0.0)
        channels[name] = np.sqrt(np.divide(rest, one, out=np.zeros_like(one), where=one > 0))
    return channels


def _measure_frequency(phasors: Phasors, rate: float, least: float) -> np.ndarray:
    """Frequency (M,) [Hz] at which the voltage really turns; where it is dead, that before and
    after.
    """
    dead = np.abs(phasors.V1) < least
    # a slope needs both neighbours
    alive = ~(dead | np.r_[dead[1:], False] | np.r_[False, dead[:-1]])
    if not alive.any():
        return phasors.f
    k = np.arange(len(alive))
    return np.interp(k, k[alive], (phasors.f + measure_turning(np.angle(phasors.V1), rate))[alive])


def _cut_in_blocks(n: int, block: int) -> Iterator[tuple[int, int]]:
    """(first, end) of each block of n samples."""
    return ((a, min(a + block, n)) for a in range(0, n, block))


def _cut_overlapping_blocks(
    n: int, rate: float, nominal: float, reach: int, block: int
) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    """Samples to look at, and those within to give phasors of: wherever a cut lies, it changes
    nothing.

    A pass of the tracking sees what lies a window and half a span away, and so many times as there
    are passes. Cuts lie on the grid of tracked phasors.
    """
    every, own, half = _choose_tracking_grid(rate, nominal)
    margin = (PASSES * (own + (half + 2) * every) + max(own, reach)) // every * every + every
    for a, b in _cut_in_blocks(n, max(block // every, 1) * every):
        yield (max(a - margin, 0), min(b + margin, n)), (a, b)
