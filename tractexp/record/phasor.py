"""Phasors from sampled waveforms: one-cycle windows at the frequency really present, and what follows from them."""

from dataclasses import dataclass

import numpy as np

from tractexp.errors import UserError

TURN = np.exp(2j * np.pi / 3)  # the operator a of symmetrical components


def frame(f: np.ndarray, rate: float) -> np.ndarray:
    """Angle (N,) [rad] of a frame that turns at the frequencies f (N,) [Hz], zero at sample 0."""
    return np.concatenate([[0.0], np.cumsum((f[1:] + f[:-1]) * np.pi / rate)])


def fundamental(x: np.ndarray, rate: float, frequency: float | np.ndarray) -> tuple[slice, np.ndarray]:
    """RMS phasors of x (..., N) at each sample whose one-cycle window lies inside.

    `rate` in samples per second, `frequency` in Hz, a number or (N,). Returns the samples covered and the phasors
    (..., M), stamped at the window's center, in the `frame` that turns at `frequency`.

    The window is one cycle long to a fraction of a sample: its two end samples are weighted by what is left over.
    In it the least-squares sinusoid is taken, x = sqrt(2) Re(X e^{j phi}), so a phasor is exact at any known
    frequency, where the plain DFT leaks its mirror image: with S = sum w x e^{-j phi}, G = sum w e^{-2 j phi} and
    W = sum w, the normal equation sqrt(2) S = W X + G X* is solved for X.
    """
    n = x.shape[-1]
    f = np.broadcast_to(np.asarray(frequency, dtype=float), n)
    whole = np.floor(rate / f / 2 - 0.5).astype(int)  # samples of full weight on either side of the center
    reach = int(whole.max()) + 1
    k = np.arange(reach, n - reach)
    h, edge = whole[k], (rate / f[k]) / 2 - 0.5 - whole[k]

    def window(y: np.ndarray) -> np.ndarray:
        total = np.concatenate([np.zeros((*y.shape[:-1], 1)), np.cumsum(y, axis=-1)], axis=-1)
        return total[..., k + h + 1] - total[..., k - h] + edge * (y[..., k + h + 1] + y[..., k - h - 1])

    turn = np.exp(-1j * frame(f, rate))
    S, G, W = window(x * turn), window(turn**2), rate / f[k]
    return slice(reach, n - reach), np.sqrt(2) * (W * S - G * S.conj()) / (W**2 - np.abs(G) ** 2)


def sequences(phases: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positive and negative sequence (N,) of three phase phasors (3, N), ordered a, b, c (Fortescue 1918)."""
    a, b, c = phases
    return (a + TURN * b + TURN**2 * c) / 3, (a + TURN**2 * b + TURN * c) / 3


def turning(angle: np.ndarray, rate: float) -> np.ndarray:
    """Frequency [Hz] at which a phasor's angle (N,) [rad] turns in its frame."""
    return np.gradient(np.unwrap(angle)) * rate / (2 * np.pi)


def track(voltages: np.ndarray, rate: float, nominal: float, cycles: float = 4.0) -> np.ndarray:
    """Frequency (N,) [Hz] of three phase voltages (3, N), smoothed over `cycles`, within 10 % of `nominal`.

    The mean speed of the positive-sequence voltage over the span about each sample. Three passes, each with the
    frequency found by the one before, remove what the unknown frequency did to the phasors themselves.
    """
    n = voltages.shape[-1]
    f = np.full(n, nominal)
    half = int(cycles * rate / nominal / 2)
    for _ in range(3):
        inside, phasors = fundamental(voltages, rate, f)
        angle = np.unwrap(np.angle(sequences(phasors)[0])) + frame(f, rate)[inside]
        k = np.arange(len(angle))
        early, late = np.maximum(k - half, 0), np.minimum(k + half, len(angle) - 1)
        speed = (angle[late] - angle[early]) * rate / (late - early) / (2 * np.pi)
        f = np.interp(np.arange(n), np.arange(n)[inside], np.clip(speed, 0.9 * nominal, 1.1 * nominal))
    return f


@dataclass(frozen=True, eq=False)
class Phasors:
    """Sequence phasors of one load at uniform times, arrays (M,)."""

    t: np.ndarray  # s
    V1: np.ndarray  # kV, phase to ground, RMS, complex
    V2: np.ndarray  # kV
    I1: np.ndarray  # kA
    I2: np.ndarray  # kA
    f: np.ndarray  # Hz, at which V1 turns

    @property
    def S(self) -> np.ndarray:
        """Positive-sequence power P + jQ [MVA], (M,) complex."""
        return 3 * self.V1 * self.I1.conj()


def measure(
    waves: np.ndarray,
    rate: float,
    nominal: float,
    start: float = 0.0,
    step: float = 1e-3,
    skew: np.ndarray | None = None,
) -> Phasors:
    """Phasors of three voltages [kV] and three currents [kA], `waves` (6, N) sampled at `rate` from `start` [s].

    About one phasor every `step` seconds: the nearest whole number of samples. `skew` (6,) [s] is how much later
    than the time stamp each channel is sampled. N must span two cycles at least; raises `UserError` otherwise.
    """
    if waves.shape[-1] < 2 * rate / (0.9 * nominal) + 4:
        raise UserError(
            f"{waves.shape[-1]} samples at {rate:g} Hz are too short: phasors need over two cycles of {nominal:g} Hz"
        )
    tracked = track(waves[:3], rate, nominal)
    inside, X = fundamental(waves, rate, tracked)
    if skew is not None:
        X = X * np.exp(-2j * np.pi * tracked[inside] * skew[:, None])
    every = max(1, round(step * rate))
    X, f = X[:, ::every], tracked[inside][::every]
    V1, V2 = sequences(X[:3])
    I1, I2 = sequences(X[3:])
    t = start + np.arange(waves.shape[-1])[inside][::every] / rate
    return Phasors(t, V1, V2, I1, I2, f + turning(np.angle(V1), rate / every))
