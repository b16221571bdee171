"""What drives a simulation: recorded voltage and the steady state before it, laid out for the
kernel.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tractexp.kernel.layout import EVENT, INPUTS
from tractexp.record.angle import integrate
from tractexp.record.curve import compute_slopes

PHASORS, WAVES = DOMAINS = ("phasors", "waves")
OUTPUTS = {
    PHASORS: ("P", "Q"),
    WAVES: ("i_alpha", "i_beta", "i_zero"),
}  # rows of `Drive.measurements`
# as pages say
IN_WORDS = {"i_alpha": "current alpha", "i_beta": "current beta", "i_zero": "zero-sequence current"}


@dataclass(frozen=True, eq=False)
class Excitation:
    """One event of phasors: uniformly sampled input, and measured power where there is any.

    Attributes
    ----------
    step : float [s]
        Between samples.
    U : (N,) [pu]
        Voltage.
    P, Q : (N,) [pu]
        Measured power; nan where missing.
    U0, P0, Q0 : float [pu]
        The steady state before the event.
    omega_s : (N,) or None [rad/s]
        Synchronous speed relative to nominal.
    omega_s0, omega_n : float [rad/s]
        That before the event, and the nominal speed.
    U2 : (N,) or None [pu]
        Negative-sequence voltage, where it was recorded.
    U20 : float [pu]
        That before the event.
    weight_P, weight_Q : float
        Of squared errors.
    window : (odd,) or None
        Weights of the recorder's window, through which power is looked at.
    U_angle : (N,) or None [rad]
        The voltage's angle, whose slope `omega_s` is, where it was recorded.
    """

    step: float
    U: np.ndarray
    P: np.ndarray
    Q: np.ndarray
    U0: float
    P0: float
    Q0: float
    omega_s: np.ndarray | None = None
    omega_s0: float = 0.0
    omega_n: float = 2 * np.pi * 50.0
    U2: np.ndarray | None = None
    U20: float = float("nan")
    weight_P: float = 1.0
    weight_Q: float = 1.0
    # (odd,) weights of the recorder's window, through which power is looked at
    window: np.ndarray | None = None
    U_angle: np.ndarray | None = None

    @property
    def inputs(self) -> np.ndarray:
        """The kernel's rows (6, N)."""
        absent = np.full(len(self.U), np.nan)
        omega_s = np.zeros(len(self.U)) if self.omega_s is None else self.omega_s
        return np.stack(
            [
                self.U,
                omega_s,
                compute_slopes(self.U) / self.step,
                absent if self.U2 is None else self.U2,
                np.arange(len(self.U)) * self.step,
                integrate(omega_s, self.step) if self.U_angle is None else self.U_angle,
            ]
        )

    @property
    def measurements(self) -> np.ndarray:
        """The recorded P and Q (2, N) [pu] that a simulation is compared with."""
        return np.stack([self.P, self.Q])

    @property
    def weights(self) -> tuple[float, ...]:
        """How much a squared error of each row counts."""
        return self.weight_P, self.weight_Q


@dataclass(frozen=True, eq=False)
class WaveformDrive:
    """One event of sampled waveforms: space vectors in a frame that turns with the voltage before
    it.

    Attributes
    ----------
    step : float [s]
        Between samples.
    v : (N,) complex [pu of its peak]
        Voltage, real and U0 before the event.
    v_zero : (N,) [pu]
        Its zero sequence.
    turn : (N,) complex
        Of size one: what turns the frame's vectors into the stationary frame of phase a.
    currents : (3, N) [pu]
        Alpha, beta and zero sequence in the stationary frame; nan where not compared.
    U, U2 : (N,) [pu]
        Sizes of the voltage's sequences as a window of the past shows them.
    U0, P0, Q0, U20 : float [pu]
        Before the event.
    omega_s0, omega_n : float [rad/s]
        Speed of the frame relative to nominal, and the nominal speed.
    weights : (3,)
        Of a squared error of each current.
    window : (odd,) or None
        Weights of a recorder's window.
    """

    step: float
    v: NDArray[np.complex128]
    v_zero: np.ndarray
    turn: NDArray[np.complex128]
    currents: np.ndarray
    U: np.ndarray
    U2: np.ndarray
    U0: float
    P0: float
    Q0: float
    omega_s0: float
    omega_n: float
    U20: float = 0.0
    weights: tuple[float, ...] = (0.5, 0.5, 1.0)
    window: np.ndarray | None = None

    @property
    def inputs(self) -> np.ndarray:
        """What drives the kernel, (14, N): `INPUTS`, then `WAVE_INPUTS`, a row each."""
        n = len(self.v)
        smooth = (self.v.real, self.v.imag, self.v_zero)
        rows = [
            self.U,
            np.full(n, self.omega_s0),
            compute_slopes(self.U) / self.step,
            self.U2,
            np.arange(n) * self.step,
            self.omega_s0 * np.arange(n) * self.step,
        ]
        rates = (differentiate_spline(y) / self.step for y in smooth)
        return np.stack([*rows, *smooth, *rates, self.turn.real, self.turn.imag])

    @property
    def measurements(self) -> np.ndarray:
        """The recorded currents (3, N) [pu] that a simulation is compared with."""
        return self.currents


def differentiate_spline(y: np.ndarray) -> np.ndarray:
    """The slope at each sample, per sample, of the cubic spline through them.

    What stands behind an anti-alias filter overshoots by itself: of negative sequence and of
    harmonics `slopes` would miss some percent of the voltage between samples where there are but 24
    in a cycle, and it is not linear in noise.

    Parameters
    ----------
    y : (N,)
        Samples at even times.

    Returns
    -------
    (N,) array
    """
    from scipy.interpolate import CubicSpline

    return (
        CubicSpline(np.arange(len(y)), y)(np.arange(len(y)), 1) if len(y) > 3 else compute_slopes(y)
    )


@dataclass(frozen=True, eq=False)
class Drive:
    """One or several events end to end: N samples in all, E events.

    Attributes
    ----------
    inputs : (6, N) or (14, N)
        Of phasors or of waveforms, rows as in `INPUTS`; omega_s is 0 and U2 nan where not recorded.
    measurements : (C, N) [pu]
        P and Q, or three currents; gaps are filled with 0.
    weights : (C, N)
        Of squared errors; 0 in a gap.
    first : (E + 1,) ints
        First sample of each event, and the end.
    event : (E, 5)
        Columns as in `EVENT`.
    before : (E, 2) [pu]
        P0 and Q0.
    windows : tuple
        Weights of the recorder's window of each event, or None; empty where no event has one.
    """

    # (6, N) or (14, N), rows as in INPUTS; omega_s is 0 and U2 nan where not recorded
    inputs: np.ndarray
    measurements: np.ndarray  # (C, N): P and Q, or three currents; gaps filled with 0
    weights: np.ndarray  # (C, N): 0 in a gap
    first: np.ndarray  # (E + 1,)
    event: np.ndarray  # (E, 5), columns as in EVENT
    before: np.ndarray  # (E, 2): P0, Q0
    windows: tuple[np.ndarray | None, ...] = ()  # of each event, where any has one

    @classmethod
    def from_events(cls, events: Sequence[Excitation | WaveformDrive]) -> "Drive":
        """The drive of events end to end, all of phasors or all of waveforms."""
        measured = _join(events, "measurements")
        lengths = [e.measurements.shape[1] for e in events]
        weights = np.repeat(np.array([e.weights for e in events]).T, lengths, axis=1)
        gaps = np.isnan(measured)
        return cls(
            inputs=np.ascontiguousarray(_join(events, "inputs"), dtype=float),
            measurements=np.where(gaps, 0.0, measured),
            weights=np.where(gaps, 0.0, weights),
            first=np.concatenate([[0], np.cumsum(lengths)]),
            event=np.array([[getattr(e, name) for name in EVENT] for e in events]),
            before=np.array([[e.P0, e.Q0] for e in events]),
            windows=tuple(e.window for e in events)
            if any(e.window is not None for e in events)
            else (),
        )

    @property
    def names(self) -> tuple[str, ...]:
        """The names (C,) of the compared quantities."""
        return next(names for names in OUTPUTS.values() if len(names) == len(self.measurements))

    @property
    def labels(self) -> tuple[str, ...]:
        """The names (C,) of the compared quantities as a page says them: P and Q, or which
        current.
        """
        return tuple(IN_WORDS.get(name, name) for name in self.names)

    @property
    def of_waves(self) -> bool:
        """Whether it is of sampled waveforms."""
        return len(self.inputs) == len(INPUTS)

    @property
    def channels(self) -> int:
        """The number C of quantities that are compared."""
        return len(self.measurements)

    @property
    def events(self) -> int:
        """The number E of events."""
        return len(self.event)

    @property
    def samples(self) -> int:
        """The number N of samples of all events together."""
        return self.inputs.shape[1]

    def part(self, event: int) -> slice:
        """The samples of one event."""
        return slice(int(self.first[event]), int(self.first[event + 1]))

    @functools.cached_property
    def parts(self) -> list[slice]:
        """The samples of each event."""
        return [self.part(event) for event in range(self.events)]

    def find_phasors(self, event: int) -> NDArray[np.complex128]:
        """The voltage (n,) [pu] of one event's phasors, in a frame of nominal frequency."""
        part = self.part(event)
        angle = self.inputs[INPUTS.index("U_angle"), part]
        return self.inputs[INPUTS.index("U"), part] * np.exp(1j * angle)


def _join(events: Sequence[Excitation | WaveformDrive], name: str) -> np.ndarray:
    """Rows (R, N) of all events end to end."""
    return np.concatenate([getattr(e, name) for e in events], axis=1)
