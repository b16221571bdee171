"""A recorder's window: what phasors are averages over, how a load's power looks through it, and the
voltage behind it.

With a window h, U = h * u and I = h * i are recorded, and P + jQ = U conj(I). A load whose current
is linear in the voltage would not show it; any other does wherever the voltage bends. u is computed
back from U near the edges of the dip, where it is free to bend; the current a model draws at u is
then averaged as the recorder does. Voltage and current are phasors: where the angle of the voltage
jumps with the dip, as it was recorded or as f turns it, their averages turn step by step.

Source: IEC/IEEE 60255-118-1.
"""

import functools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tractexp.record.angle import integrate, measure_frequency

if TYPE_CHECKING:
    from tractexp.record.event import Event

MEAN_POINTS = 200  # of a plain mean
LONGEST_WINDOW = 2.0  # s about a time stamp: far more than any recorder averages over
BEND_SECONDS = 0.05  # s on either side of a window around an edge, in which the voltage may bend
BENT, CALM = 0.01, 3e-4  # pu: second differences of the voltage there, and elsewhere
ERROR = 2e-4  # pu: how exactly the average voltage must be the recorded one, if its noise allows
# times that error [rad]: what an angle turns by beside an edge, and less is noise
TURN_OVER_NOISE = 15.0


@dataclass(frozen=True, eq=False)
class Window:
    """A linear average: each phasor is the sum of weights times what was there at times about its
    stamp.

    Attributes
    ----------
    name : str
        Of the estimator.
    at : (W,) [s]
        Times about the stamp, increasing.
    weights : (W,)
        Their sum is 1.
    """

    name: str  # of the estimator
    at: np.ndarray  # (W,) s, about the time stamp, increasing
    weights: np.ndarray  # (W,), of sum 1

    @property
    def length(self) -> float:
        """The length [s] of the window."""
        return float(self.at[-1] - self.at[0]) * len(self.at) / (len(self.at) - 1)

    def compute_weights(self, step: float) -> np.ndarray:
        """The weights (odd,) of samples `step` [s] apart, for what is linear between them.

        Examples
        --------
        >>> window = Window("mean", np.array([-0.01, 0.01]), np.array([0.5, 0.5]))
        >>> window.compute_weights(0.01).tolist()
        [0.5, 0.0, 0.5]
        """
        reach = int(np.ceil(np.abs(self.at).max() / step - 1e-9))
        weights = np.zeros(2 * reach + 2)
        whole, part = np.divmod(self.at / step, 1)
        np.add.at(weights, whole.astype(int) + reach, (1 - part) * self.weights)
        np.add.at(weights, whole.astype(int) + reach + 1, part * self.weights)
        return weights[:-1]

    def to_dict(self) -> dict[str, Any]:
        """The window as JSON holds it, its arrays as lists."""
        return {"name": self.name, "at": self.at.tolist(), "weights": self.weights.tolist()}

    @classmethod
    def from_content(cls, content: Mapping[str, Any]) -> "Window":
        """The window that `to_dict` made; raises `ValueError`, `TypeError`, `KeyError` or
        `OverflowError` for anything else.
        """
        at, weights = (np.array(content[key], dtype=float) for key in ("at", "weights"))
        if (
            at.ndim != 1
            or at.shape != weights.shape
            or len(at) < 2
            or not np.isfinite(weights).all()
        ):
            raise ValueError("times and weights are two lists of as many numbers")
        if not (np.abs(at) <= LONGEST_WINDOW).all() or not (np.diff(at) > 0).all():
            raise ValueError("times increase")
        return cls(str(content["name"]), at, weights)


def make_mean_window(length: float) -> Window:
    """The plain mean over a length [s].

    Examples
    --------
    >>> make_mean_window(0.02).compute_weights(0.01).round(3).tolist()
    [0.25, 0.5, 0.25]
    """
    at = length * ((np.arange(MEAN_POINTS) + 0.5) / MEAN_POINTS - 0.5)
    return Window("mean", at, np.full(MEAN_POINTS, 1 / MEAN_POINTS))


def build_mean_weights(samples: float) -> np.ndarray:
    """The weights of samples in the mean over a window.

    Parameters
    ----------
    samples : float
        Length of the window in samples, not necessarily whole.

    Returns
    -------
    (odd,) array
        Around the middle sample, of sum 1, for what is linear between samples.

    Examples
    --------
    >>> build_mean_weights(2.0).tolist()
    [0.0, 0.25, 0.5, 0.25, 0.0]
    """
    whole, part = divmod(samples / 2, 1)
    half = np.zeros(int(whole) + 2)
    half[:-2] += 0.5
    half[1:-1] += 0.5
    half[-2:] += part - part**2 / 2, part**2 / 2
    return np.r_[half[:0:-1], 2 * half[0], half[1:]] / samples


@np.errstate(invalid="ignore")  # what diverges stays what is not finite
def average(y: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The mean of a signal about each sample.

    Beyond its ends the signal goes on as over its last window, with the trend from one window to
    the next: a ring of whole cycles, such as the offset of a stator flux, would not average out at
    the ends of a signal that stood still there.

    Parameters
    ----------
    y : (..., N)
        The signal.
    weights : (odd,)
        Of the samples about each, of sum 1.

    Returns
    -------
    (..., N) array
    """
    from scipy.ndimage import correlate1d

    most = len(weights) // 2
    cycle = max(round(1 / float(weights.max())), 1)
    if y.shape[-1] < 2 * cycle or most > cycle:
        wide = np.pad(y, [(0, 0)] * (y.ndim - 1) + [(most, most)], "edge")
    else:
        first, second, third, last = (
            y[..., part].mean(axis=-1, keepdims=True)
            for part in (
                slice(cycle),
                slice(cycle, 2 * cycle),
                slice(-2 * cycle, -cycle),
                slice(-cycle, None),
            )
        )
        before = y[..., cycle - most : cycle] - (second - first)
        after = y[..., y.shape[-1] - cycle :][..., :most] + (last - third)
        wide = np.concatenate([before, y, after], axis=-1)
    middle = slice(most, wide.shape[-1] - most)
    return correlate1d(wide, weights, axis=-1)[..., middle]


@np.errstate(over="ignore", invalid="ignore")  # likewise
def averaged_power(power: np.ndarray, u: NDArray[np.complex128], weights: np.ndarray) -> np.ndarray:
    """The power of a load as phasors of a window show it.

    The conjugate of the current, power over voltage, is averaged, and multiplied by the averaged
    voltage.

    Parameters
    ----------
    power : (2, ..., N) [pu]
        P and Q that the load draws.
    u : (N,) complex [pu]
        The voltage that it sees, in a frame of nominal frequency.
    weights : (odd,)
        Of the window.

    Returns
    -------
    (2, ..., N) array [pu]
    """
    back: NDArray[np.complex128] = 1 / u
    P, Q = power
    current = np.stack([P * back.real - Q * back.imag, P * back.imag + Q * back.real])
    real, imag = average(current, weights)
    u_real, u_imag = average(np.stack([u.real, u.imag]), weights)
    return np.stack([real * u_real - imag * u_imag, real * u_imag + imag * u_real])


def sharpen_voltage(event: "Event", weights: np.ndarray, window: float) -> "Event":
    """The event with the voltage that the load saw.

    Of the voltages whose average is the recorded one, within its noise, it is the one that bends
    least: weighted least squares. Near the edges of the dip it is free to bend. Its angle is
    computed back with its size where it turns there by more than noise: the angle of phasors is as
    noisy as their size, and noise that is computed back grows.

    Parameters
    ----------
    event : Event
        As recorded.
    weights : (odd,)
        Of the recorder's window.
    window : float [s]
        Its length.

    Returns
    -------
    Event
    """
    from scipy.linalg import cho_solve_banded

    step = event.record.step
    U = event.record.U
    at, near = (
        np.arange(1 - len(weights) // 2, len(U) + len(weights) // 2 - 1),
        (window + BEND_SECONDS) / step,
    )
    free = (np.abs(at - event.start) < near) | (np.abs(at - event.end) < near)
    error = max(ERROR, event.noise_U)
    factor = _factorize(weights.tobytes(), len(U), free.tobytes(), error)

    def undo(shown: np.ndarray) -> np.ndarray:
        u = cho_solve_banded((factor, False), np.convolve(shown, weights) / error**2)
        return u[len(weights) // 2 :][: len(U)]

    record = event.record
    turned = _find_turned_angle(event)
    if _measure_turn(event, turned, int(near)) <= TURN_OVER_NOISE * error:
        return replace(event, record=replace(record, U=undo(U)))
    u = undo(U * np.cos(turned)) + 1j * undo(U * np.sin(turned))
    steady = 2 * np.pi * (event.f0 - record.base.frequency) * step * np.arange(len(U))
    angle = steady + np.unwrap(np.angle(u))
    f = measure_frequency(angle, step, record.base.frequency)
    return replace(event, record=replace(record, U=np.abs(u), U_angle=angle, f=f))


def _find_turned_angle(event: "Event") -> np.ndarray:
    """By how much the voltage's angle was recorded to turn, beside what it turned by before the
    dip.

    Parameters
    ----------
    event : Event
        Its `U_angle`, or else what f turns.

    Returns
    -------
    (N,) array [rad]
        Zero throughout where neither was recorded or nothing turns.
    """
    record = event.record
    if record.f is None:
        return np.zeros(record.samples)
    if record.U_angle is None:
        return integrate(2 * np.pi * (record.f - event.f0), record.step)
    steady = 2 * np.pi * (event.f0 - record.base.frequency) * record.step
    return record.U_angle - record.U_angle[0] - steady * np.arange(record.samples)


def _measure_turn(event: "Event", turned: np.ndarray, near: int) -> float:
    """By how much the voltage's angle `turned` (N,) [rad] moves within `near` samples of either
    edge of the dip.
    """
    spans = (slice(max(0, k - near), k + near) for k in (event.start, event.end))
    return max(float(np.ptp(turned[span])) for span in spans)


@functools.lru_cache(maxsize=32)
def _factorize(weights: bytes, n: int, free: bytes, error: float) -> np.ndarray:
    """The banded Cholesky factor of the normal equations: the same for every voltage
    of one event.
    """
    from scipy.linalg import cholesky_banded
    from scipy.sparse import diags_array

    w = np.frombuffer(weights)
    bends = np.where(np.frombuffer(free, bool), BENT, CALM) ** -2.0
    wide = n + len(w) - 1
    most = max(len(w) - 1, 2)
    # SciPy's type of it is inferred from its default, one diagonal
    across: Any = list(range(len(w)))
    second: Any = [0, 1, 2]
    box = diags_array(list(w), offsets=across, shape=(n, wide))
    bend = diags_array([1.0, -2.0, 1.0], offsets=second, shape=(wide - 2, wide))
    normal = box.T @ box / error**2 + bend.T @ diags_array(bends) @ bend
    return cholesky_banded(
        np.array([np.pad(normal.diagonal(k), (k, 0)) for k in range(most, -1, -1)])
    )
