"""What is periodic in waveforms before an event: an offset, the fundamental and its harmonics, by
least squares.
"""

from dataclasses import dataclass, replace

import numpy as np

HIGHEST_HARMONIC = 25  # harmonic that is fitted


@dataclass(frozen=True, eq=False)
class Periodic:
    """Offset, fundamental and harmonics (2 H + 1, channels) of channels before an event, about the
    time `origin`.
    """

    coefficients: np.ndarray
    frequency: float
    origin: float
    rest: np.ndarray  # (channels,) standard deviation of what is not periodic

    @classmethod
    def from_samples(
        cls, t: np.ndarray, x: np.ndarray, frequency: float, rate: float
    ) -> "Periodic":
        """Fitted to channels x (channels, n) at times t (n,) [s]."""
        highest = max(
            1, min(HIGHEST_HARMONIC, int(0.45 * rate / frequency), (len(t) // 3 - 1) // 2)
        )
        series = cls(np.zeros((2 * highest + 1, len(x))), frequency, float(t[0]), np.zeros(len(x)))
        basis = series.basis(t)
        coefficients = np.linalg.lstsq(basis, x.T, rcond=None)[0]
        residual = x.T - basis @ coefficients
        scale = np.sqrt((residual**2).sum(axis=0) / max(len(t) - len(coefficients), 1))
        return replace(series, coefficients=coefficients, rest=scale)

    def basis(self, t: np.ndarray) -> np.ndarray:
        """(n, 2 H + 1): one, then cosine and sine of each harmonic."""
        angle = (
            2
            * np.pi
            * self.frequency
            * np.outer(t - self.origin, 1 + np.arange(len(self.coefficients) // 2))
        )
        waves = np.stack([np.cos(angle), np.sin(angle)], axis=2).reshape(len(t), -1)
        return np.concatenate([np.ones((len(t), 1)), waves], axis=1)

    def evaluate_at(self, t: np.ndarray) -> np.ndarray:
        """The channels (channels, n), without their offsets."""
        return (self.basis(t)[:, 1:] @ self.coefficients[1:]).T

    @property
    def offsets(self) -> np.ndarray:
        """The constant part of each channel."""
        return self.coefficients[0]

    @property
    def fundamentals(self) -> np.ndarray:
        """Peak phasors (channels,) about the origin."""
        return self.coefficients[1] - 1j * self.coefficients[2]
