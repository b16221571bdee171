"""Noise removed from a sampled voltage, which drives the model, so that its noise appears in every
calculated current.

Within a cycle noise and voltage cannot be separated with certainty. But away from the edges of a
dip the voltage departs from its periodic course slowly, so that faster changes are noise. Changes
larger than noise stay: the edges.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

# times the frequency: upper end of the pass band, and width of the transition about it
PASSED, BETWEEN = 7.0, 4.0
RIPPLE = 80.0  # dB below one: ripple in the pass band
LARGEST_NOISE_RATIO = 2.5  # of the variance of fast noise, below which it is taken for noise
AVERAGED_WINDOWS = 8  # windows a cycle in which the power of fast changes is averaged


@dataclass(frozen=True, eq=False)
class NoiseFilter:
    """A low-pass filter of weights (2 m + 1,) without delay; `near` samples average the power of
    fast changes.
    """

    weights: np.ndarray
    near: int

    @classmethod
    def from_rate(cls, rate: float, frequency: float) -> "NoiseFilter":
        """The filter for a sampling rate and a frequency [Hz] in its pass band; at too low a rate
        all passes.
        """
        from scipy.signal import firwin, kaiserord

        edge, width = PASSED * frequency, BETWEEN * frequency
        near = max(5, round(rate / frequency / AVERAGED_WINDOWS))
        if edge + width / 2 >= rate / 2:
            return cls(np.ones(1), near)
        taps, beta = kaiserord(RIPPLE, 2 * width / rate)
        half = taps // 2 + 1
        window: Any = ("kaiser", beta)  # SciPy's type of it is inferred from its default, a name
        weights = firwin(2 * half + 1, edge, window=window, fs=rate)
        gain = weights @ np.cos(2 * np.pi * frequency / rate * np.arange(-half, half + 1))
        return cls(weights / gain, near)

    def __call__(self, departure: np.ndarray, noise: float) -> np.ndarray:
        """Departures (N,) from a periodic course, real or complex, whose samples have white noise
        of a variance.
        """
        if len(self.weights) == 1 or len(departure) <= 2 * len(self.weights):
            return departure
        half = len(self.weights) // 2
        slow = np.convolve(
            np.pad(departure, half, "reflect", reflect_type="odd"), self.weights, "valid"
        )
        fast = departure - slow
        loud = np.convolve(np.abs(fast) ** 2, np.ones(self.near) / self.near, "same")
        rest = noise * (1 - 2 * self.weights[half] + float(self.weights @ self.weights))
        return (
            slow
            + np.clip(1 - LARGEST_NOISE_RATIO * rest / np.maximum(loud, 1e-300), 0.0, 1.0) * fast
        )
