"""A load's power as phasors show it that are averages over a window; see `tractexp.record.deconvolution`."""

import numpy as np


@np.errstate(invalid="ignore")  # what diverges stays what is not finite
def mean(y: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Mean of y (..., N) with weights (odd,) about each sample.

    Beyond its ends y goes on as over its last window, with the trend from one window to the next: a ring of whole
    cycles, such as the offset of a stator flux, would not average out at the ends of a y that stood still there.
    """
    most, cycle = len(weights) // 2, max(round(1 / float(weights.max())), 1)
    if y.shape[-1] < 2 * cycle or most > cycle:
        wide = np.pad(y, [(0, 0)] * (y.ndim - 1) + [(most, most)], "edge")
    else:
        first, second, third, last = (
            y[..., part].mean(axis=-1, keepdims=True)
            for part in (slice(cycle), slice(cycle, 2 * cycle), slice(-2 * cycle, -cycle), slice(-cycle, None))
        )
        before = y[..., cycle - most : cycle] - (second - first)
        after = y[..., y.shape[-1] - cycle :][..., :most] + (last - third)
        wide = np.concatenate([before, y, after], axis=-1)
    return np.lib.stride_tricks.sliding_window_view(wide, len(weights), axis=-1) @ weights


def seen(power: np.ndarray, u: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The power (..., N) that a load draws at the voltage u (N,), as phasors of these weights show it."""
    return mean(power / u, weights) * mean(u, weights)
