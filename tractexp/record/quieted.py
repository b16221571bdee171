"""Noise taken out of a sampled voltage, which a model is driven by and which shows in all that it calculates.

Within a cycle nothing tells noise from voltage for sure, but away from the edges of a dip a voltage departs from its
periodic course slowly, and what is faster is noise. It stays where it is louder than noise: at the edges.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

PASSED, BETWEEN = 7.0, 4.0  # times the frequency: up to where all is kept, and how wide the filter falls about it
RIPPLE = 80.0  # dB below one: what the filter may change of what it keeps
LOUD = 2.5  # of the variance of fast noise, below which it is taken for noise
NEAR = 8  # of a cycle: the stretch in which its loudness is told


@dataclass(frozen=True, eq=False)
class Quieting:
    """A filter of weights (2 m + 1,) without delay, and over how many samples loudness is told."""

    weights: np.ndarray
    near: int

    @classmethod
    def at(cls, rate: float, frequency: float) -> "Quieting":
        """That for a sampling rate and a frequency [Hz], which it keeps; where nothing is faster it keeps all."""
        from scipy.signal import firwin, kaiserord

        edge, width = PASSED * frequency, BETWEEN * frequency
        near = max(5, round(rate / frequency / NEAR))
        if edge + width / 2 >= rate / 2:
            return cls(np.ones(1), near)
        taps, beta = kaiserord(RIPPLE, 2 * width / rate)
        half = taps // 2 + 1
        window: Any = ("kaiser", beta)  # SciPy's type of it is inferred from its default, a name
        weights = firwin(2 * half + 1, edge, window=window, fs=rate)
        kept = weights @ np.cos(2 * np.pi * frequency / rate * np.arange(-half, half + 1))
        return cls(weights / kept, near)

    def __call__(self, departure: np.ndarray, noise: float) -> np.ndarray:
        """Departures (N,) from a periodic course, real or complex, whose samples have white noise of a variance."""
        if len(self.weights) == 1 or len(departure) <= 2 * len(self.weights):
            return departure
        half = len(self.weights) // 2
        slow = np.convolve(_beyond(departure, half), self.weights, "valid")
        fast = departure - slow
        loud = np.convolve(np.abs(fast) ** 2, np.ones(self.near) / self.near, "same")
        left = noise * (1 - 2 * self.weights[half] + float(self.weights @ self.weights))
        return slow + np.clip(1 - LOUD * left / np.maximum(loud, 1e-300), 0.0, 1.0) * fast


def _beyond(x: np.ndarray, n: int) -> np.ndarray:
    """(N + 2 n,): turned about its first and its last value."""
    return np.concatenate([2 * x[0] - x[n:0:-1], x, 2 * x[-1] - x[-2 : -n - 2 : -1]])
