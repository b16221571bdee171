"""Phasors from sampled waveforms: one-cycle windows at the frequency really present, and what follows from them."""

from collections.abc import Callable
from dataclasses import dataclass, replace

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
    """Frequency (N,) [Hz] of phase voltages (K, N), three or one, smoothed over `cycles`, within 10 % of `nominal`.

    The mean speed of the positive-sequence voltage (of the one there is) over the span about each sample. Three passes,
    each with the frequency found by the one before, remove what the unknown frequency did to the phasors themselves.
    """
    n = voltages.shape[-1]
    f = np.full(n, nominal)
    half = int(cycles * rate / nominal / 2)
    for _ in range(3):
        inside, phasors = fundamental(voltages, rate, f)
        V1 = sequences(phasors)[0] if len(phasors) == 3 else phasors[0]
        angle = np.unwrap(np.angle(V1)) + frame(f, rate)[inside]
        k = np.arange(len(angle))
        early, late = np.maximum(k - half, 0), np.minimum(k + half, len(angle) - 1)
        speed = (angle[late] - angle[early]) * rate / (late - early) / (2 * np.pi)
        f = np.interp(np.arange(n), np.arange(n)[inside], np.clip(speed, 0.9 * nominal, 1.1 * nominal))
    return f


@dataclass(frozen=True, eq=False)
class Phasors:
    """RMS phasors of one load at uniform times: of its three phases (K = 3) or of the only one (K = 1)."""

    t: np.ndarray  # (M,) s
    V: np.ndarray  # (K, M) kV, phase to ground; of a single-phase load the voltage it is fed with
    I: np.ndarray  # (K, M) kA, into the load
    f: np.ndarray  # (M,) Hz, at which the (positive-sequence) voltage turns

    @property
    def V1(self) -> np.ndarray:
        """Positive-sequence voltage (M,) [kV]; of a single-phase load its voltage."""
        return sequences(self.V)[0] if len(self.V) == 3 else self.V[0]

    @property
    def V2(self) -> np.ndarray:
        """Negative-sequence voltage (M,) [kV]; zero for a single-phase load."""
        return sequences(self.V)[1] if len(self.V) == 3 else np.zeros_like(self.V[0])

    @property
    def I1(self) -> np.ndarray:
        """Positive-sequence current (M,) [kA]; of a single-phase load its current."""
        return sequences(self.I)[0] if len(self.I) == 3 else self.I[0]

    @property
    def I2(self) -> np.ndarray:
        """Negative-sequence current (M,) [kA]; zero for a single-phase load."""
        return sequences(self.I)[1] if len(self.I) == 3 else np.zeros_like(self.I[0])

    @property
    def S(self) -> np.ndarray:
        """Power P + jQ [MVA], (M,) complex: of the positive sequence, 3 V1 I1*; of a single-phase load V I*."""
        return len(self.V) * self.V1 * self.I1.conj()

    @property
    def U(self) -> np.ndarray:
        """Voltage (M,) [kV] as records have it: line to line; of a single-phase load its own."""
        return np.sqrt(len(self.V)) * np.abs(self.V1)

    @property
    def U2(self) -> np.ndarray:
        """Negative-sequence voltage (M,) [kV], line to line."""
        return np.sqrt(len(self.V)) * np.abs(self.V2)


def measure(
    waves: np.ndarray,
    rate: float,
    nominal: float,
    start: float = 0.0,
    step: float = 1e-3,
    skew: np.ndarray | None = None,
    phasors: Callable[..., tuple[slice, np.ndarray]] = fundamental,
) -> Phasors:
    """Phasors of voltages [kV] and as many currents [kA], `waves` (2 K, N) sampled at `rate` from `start` [s].

    About one phasor every `step` seconds: the nearest whole number of samples. `skew` (2 K,) [s] is how much later
    than the time stamp each channel is sampled. `phasors` estimates, with the arguments of `fundamental`. N must span
    two cycles at least; raises `UserError` otherwise.
    """
    if waves.shape[-1] < 2 * rate / (0.9 * nominal) + 4:
        raise UserError(
            f"{waves.shape[-1]} samples at {rate:g} Hz are too short: phasors need over two cycles of {nominal:g} Hz"
        )
    K = len(waves) // 2
    tracked = track(waves[:K], rate, nominal)
    inside, X = phasors(waves, rate, tracked)
    if skew is not None:
        X = X * np.exp(-2j * np.pi * tracked[inside] * skew[:, None])
    every = max(1, round(step * rate))
    X, f = X[:, ::every], tracked[inside][::every]
    t = start + np.arange(waves.shape[-1])[inside][::every] / rate
    made = Phasors(t, X[:K], X[K:], f)
    return replace(made, f=f + turning(np.angle(made.V1), rate / every))
