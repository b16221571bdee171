"""The differences of residuals at one point: what each coordinate would change by a small step."""

from collections.abc import Sequence

import numpy as np

from tractexp.discrepancy.context import Context
from tractexp.noise import Noise

STEP = 1e-4  # of a coordinate's range


def two_sided(unit: np.ndarray, columns: Sequence[int] | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (k, D) a small step above and below in each of the columns."""
    up, down = (np.tile(unit, (len(columns), 1)) for _ in "ud")
    for row, k in enumerate(columns):
        up[row, k] = min(unit[k] + STEP, 1.0)
        down[row, k] = max(unit[k] - STEP, 0.0)
    return up, down


def linearised(
    context: Context, unit: np.ndarray, noise: Noise, columns: Sequence[int], names: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (C, N) of a fit with the named effects, and rows (1 + k, R): they and their differences, whitened.

    R = C N rows of the records, then those of the priors of the faults of the measurement.
    """
    at = context.coordinates
    up, down = two_sided(unit, columns)
    raw = context.residuals(np.concatenate([unit[None], up, down]), names)
    k = len(columns)
    width = np.array([u[c] - d[c] for u, d, c in zip(up, down, columns, strict=True)])
    moved = np.nan_to_num((raw[1 : 1 + k] - raw[1 + k :]) / width[:, None, None])
    white = context.whiten(noise, np.concatenate([raw[:1], moved]))
    held = [(i, c) for i, c in enumerate(columns) if c in at.prior_deviation]
    prior = np.zeros((1 + k, len(held)))
    for row, (i, c) in enumerate(held):
        prior[1 + i, row] = 1 / at.prior_deviation[c]
        prior[0, row] = (unit[c] - at.null[c]) / at.prior_deviation[c]
    return raw[0], np.concatenate([white, prior], axis=1)
