"""The averaging window of a record's phasors."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

LONGEST = 10.0  # s about a time stamp: far more than any recorder averages over


@dataclass(frozen=True, eq=False)
class Window:
    """A linear average: each phasor is the sum of weights times what was there at times about its stamp."""

    name: str  # of the estimator
    at: np.ndarray  # (W,) s, about the time stamp, increasing
    weights: np.ndarray  # (W,), of sum 1

    @property
    def length(self) -> float:
        """From its first to its last weight [s]."""
        return float(self.at[-1] - self.at[0]) * len(self.at) / (len(self.at) - 1)

    def on(self, step: float) -> np.ndarray:
        """Weights (odd,) of samples `step` [s] apart, for what is linear between them."""
        reach = int(np.ceil(np.abs(self.at).max() / step - 1e-9))
        weights = np.zeros(2 * reach + 2)
        whole, part = np.divmod(self.at / step, 1)
        np.add.at(weights, whole.astype(int) + reach, (1 - part) * self.weights)
        np.add.at(weights, whole.astype(int) + reach + 1, part * self.weights)
        return weights[:-1]

    def to_dict(self) -> dict[str, Any]:
        """As plain data."""
        return {"name": self.name, "at": self.at.tolist(), "weights": self.weights.tolist()}

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> "Window":
        """From the content of `to_dict`; any other raises `ValueError`, `TypeError`, `KeyError` or `OverflowError`."""
        at, weights = (np.array(content[key], dtype=float) for key in ("at", "weights"))
        if at.ndim != 1 or at.shape != weights.shape or len(at) < 2 or not np.isfinite(weights).all():
            raise ValueError("times and weights are two lists of as many numbers")
        if not (np.abs(at) <= LONGEST).all() or not (np.diff(at) > 0).all():
            raise ValueError("times increase")
        return cls(str(content["name"]), at, weights)
