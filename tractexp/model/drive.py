"""What drives a simulation: recorded voltage and the steady state before it, laid out for the kernel."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

INPUTS = ("U", "omega_s", "U_rate", "U2", "t")  # rows of `Drive.inputs`; U_rate is the slope of U there [pu/s]
EVENT = ("U0", "omega_s0", "U20", "omega_n", "step")  # columns of `Drive.event`


@dataclass(frozen=True, eq=False)
class Excitation:
    """One event: uniformly sampled input, and measured power where there is any.

    U [pu] (N,); P, Q [pu] (N,), nan where missing; step [s]; U0, P0, Q0 [pu] and omega_s0 are the steady state
    before the event; omega_s (N,) is the synchronous speed relative to nominal [rad/s]; omega_n is nominal;
    U2 (N,) and U20 are the negative-sequence voltage [pu], where recorded.
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
    window: np.ndarray | None = None  # (odd,) weights of the recorder's window, through which power is looked at


def slopes(y: np.ndarray) -> np.ndarray:
    """Slope at each sample (N,), per sample, of the smooth curve through them: Akima's, which does not overshoot.

    Between samples the kernel reads the voltage off the cubics these slopes define. A straight line would round
    the edges of a dip recorded every 10 ms by more than the noise of a good recorder.

    Source: Akima 1970, with the weights that keep flat stretches flat (makima).
    """
    if len(y) < 3:
        return np.gradient(y) if len(y) > 1 else np.zeros(len(y))
    m = np.diff(y)
    before = [2 * m[0] - m[1], 3 * m[0] - 2 * m[1]]
    after = [2 * m[-1] - m[-2], 3 * m[-1] - 2 * m[-2]]
    m = np.concatenate((before[::-1], m, after))  # m[k + 2] is the slope after sample k
    spread = np.abs(np.diff(m)) + np.abs(m[1:] + m[:-1]) / 2
    left, right = spread[2:], spread[:-2]  # weights of the slopes before and after each sample
    total = left + right
    return np.where(total > 0, (left * m[1:-2] + right * m[2:-1]) / np.where(total > 0, total, 1.0), 0.0)


@dataclass(frozen=True, eq=False)
class Drive:
    """One or several events end to end. Shapes: N samples in all, E events."""

    inputs: np.ndarray  # (5, N), rows as in INPUTS; omega_s is 0 and U2 nan where not recorded
    measured: np.ndarray  # (2, N): P, Q, gaps filled with 0
    weights: np.ndarray  # (2, N): 0 in a gap
    first: np.ndarray  # (E + 1,)
    event: np.ndarray  # (E, 5), columns as in EVENT
    before: np.ndarray  # (E, 2): P0, Q0
    windows: tuple[np.ndarray | None, ...] = ()  # of each event, where any has one

    @classmethod
    def of(cls, events: Sequence[Excitation]) -> "Drive":
        """Lay events end to end."""

        def joined(channel: Callable[[Excitation], np.ndarray]) -> np.ndarray:
            return np.concatenate([channel(e) for e in events])

        inputs = np.stack(
            [
                joined(lambda e: e.U),
                joined(lambda e: np.zeros(len(e.U)) if e.omega_s is None else e.omega_s),
                joined(lambda e: slopes(e.U) / e.step),
                joined(lambda e: np.full(len(e.U), np.nan) if e.U2 is None else e.U2),
                joined(lambda e: np.arange(len(e.U)) * e.step),
            ]
        )
        measured = np.stack([joined(lambda e: e.P), joined(lambda e: e.Q)])
        lengths = [len(e.U) for e in events]
        weights = np.repeat([[e.weight_P for e in events], [e.weight_Q for e in events]], lengths, axis=1)
        gaps = np.isnan(measured)
        return cls(
            inputs=np.ascontiguousarray(inputs, dtype=float),
            measured=np.where(gaps, 0.0, measured),
            weights=np.where(gaps, 0.0, weights),
            first=np.concatenate([[0], np.cumsum(lengths)]),
            event=np.array([[getattr(e, name) for name in EVENT] for e in events]),
            before=np.array([[e.P0, e.Q0] for e in events]),
            windows=tuple(e.window for e in events) if any(e.window is not None for e in events) else (),
        )

    @property
    def events(self) -> int:
        return len(self.event)

    @property
    def samples(self) -> int:
        return self.inputs.shape[1]

    def part(self, event: int) -> slice:
        """The samples of one event."""
        return slice(int(self.first[event]), int(self.first[event + 1]))
