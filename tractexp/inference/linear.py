"""The differences of residuals at one point: what each coordinate would change by a small step."""

from collections.abc import Sequence

import numpy as np

from tractexp.inference.context import Context, finite
from tractexp.noise import Noise

STEP = 1e-4  # of a coordinate's range


def two_sided(unit: np.ndarray, columns: Sequence[int] | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (2 k, D) a small step above in each of the columns, then below, and how far they are apart (k,)."""
    points, at = np.tile(unit, (2, len(columns), 1)), (np.arange(len(columns)), np.asarray(columns, dtype=int))
    points[0][at] = np.minimum(unit[at[1]] + STEP, 1.0)
    points[1][at] = np.maximum(unit[at[1]] - STEP, 0.0)
    return points.reshape(-1, len(unit)), points[0][at] - points[1][at]


def slopes(rows: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Difference quotients (k, ...) of what there is (2 k, ...) at such points; 0 where that diverges."""
    k = len(width)
    with np.errstate(over="ignore", invalid="ignore"):
        quotients = (rows[:k] - rows[k:]) / width.reshape(k, *[1] * (rows.ndim - 1))
    return finite(quotients)


def linearised(
    context: Context, unit: np.ndarray, noise: Noise, columns: Sequence[int], names: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (C, N) of a fit with the named effects, and rows (1 + k, R): they and their differences, whitened.

    R = C N rows of the records, then those of the priors of the faults of the measurement.
    """
    at = context.coordinates
    points, width = two_sided(unit, columns)
    raw = context.residuals(np.concatenate([unit[None], points]), names)
    k = len(columns)
    white = context.whiten(noise, np.concatenate([raw[:1], slopes(raw[1:], width)]))
    held = [(i, c) for i, c in enumerate(columns) if c in at.prior_deviation]
    prior = np.zeros((1 + k, len(held)))
    for row, (i, c) in enumerate(held):
        prior[1 + i, row] = 1 / at.prior_deviation[c]
        prior[0, row] = (unit[c] - at.null[c]) / at.prior_deviation[c]
    return raw[0], np.concatenate([white, prior], axis=1)
