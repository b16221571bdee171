"""A load's power as phasors show it that are averages over a window; see `tractexp.record.through`."""

import numpy as np


def mean(y: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Mean of y (..., N) with weights (odd,) about each sample, y constant beyond its ends."""
    ends = [(0, 0)] * (y.ndim - 1) + [(len(weights) // 2,) * 2]
    return np.lib.stride_tricks.sliding_window_view(np.pad(y, ends, "edge"), len(weights), axis=-1) @ weights


def seen(power: np.ndarray, u: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The power (..., N) that a load draws at the voltage u (N,), as phasors of these weights show it."""
    return mean(power / u, weights) * mean(u, weights)
