"""The stiff source: a voltage that dips, optionally with a negative sequence and a swing in
frequency.
"""

from dataclasses import dataclass

import numpy as np

NOMINAL_FREQUENCY = 50.0  # Hz
OMEGA = 2 * np.pi * NOMINAL_FREQUENCY  # rad/s, the base of all reactances


def smooth(x: np.ndarray | float) -> np.ndarray:
    """Raised cosine from 0 (x <= 0) to 1 (x >= 1)."""
    return 0.5 - 0.5 * np.cos(np.pi * np.clip(x, 0.0, 1.0))


@dataclass(frozen=True)
class Dip:
    """One voltage dip. Edges are raised cosines, because a real network and its protection take
    time.

    The share `sag` of the depth comes back with the time constant `settle`, as it does behind a
    weak network. During the dip the negative-sequence voltage reaches `negative`; from its start
    the frequency swings by `swing` sin(2 pi `swing_rate` x) exp(-x / `swing_decay`), x the time
    since then.
    """

    depth: float  # pu
    start: float  # s, when the fall begins
    duration: float  # s, from the beginning of the fall to the beginning of the rise
    fall: float = 0.03  # s
    rise: float = 0.04  # s
    sag: float = 0.0  # share of the depth
    settle: float = 0.1  # s
    before: float = 1.0  # pu, voltage before the event
    negative: float = 0.0  # pu
    swing: float = 0.0  # Hz
    swing_rate: float = 1.0  # Hz
    swing_decay: float = 1.0  # s

    def shape(self, t: np.ndarray | float) -> np.ndarray:
        """Share of the depth that is missing at times t [s]: 0 before, 1 at the bottom, back
        towards 0.
        """
        back = np.asarray(t) - self.start - self.duration
        soft = self.sag * np.exp(-np.maximum(back, 0.0) / self.settle)
        return smooth((t - self.start) / self.fall) * (
            (1 - self.sag) * (1 - smooth(back / self.rise)) + soft
        )

    def magnitude(self, t: np.ndarray | float) -> np.ndarray:
        """Positive-sequence voltage [pu] at times t [s]."""
        return self.before - self.depth * self.shape(t)

    def frequency(self, t: np.ndarray | float) -> np.ndarray:
        """Frequency [Hz] at times t [s]."""
        x = np.maximum(np.asarray(t) - self.start, 0.0)
        return NOMINAL_FREQUENCY + self.swing * np.sin(2 * np.pi * self.swing_rate * x) * np.exp(
            -x / self.swing_decay
        )

    def phase(self, t: np.ndarray | float) -> np.ndarray:
        """Angle of the positive sequence [rad]: the integral of the frequency in closed form."""
        x = np.maximum(np.asarray(t) - self.start, 0.0)
        a, b = 1 / self.swing_decay, 2 * np.pi * self.swing_rate
        swung = (b - np.exp(-a * x) * (a * np.sin(b * x) + b * np.cos(b * x))) / (a * a + b * b)
        return OMEGA * np.asarray(t) + 2 * np.pi * self.swing * swung

    def sequences(self, t: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        """Space vectors of the positive and the negative sequence [pu] in the stationary frame."""
        turn = np.exp(1j * self.phase(t))
        return self.magnitude(t) * turn, self.negative * self.shape(t) * np.conj(turn)
