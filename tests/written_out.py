"""Derivatives and normal equations that fall apart by event, with every entry written out."""

import numpy as np

from tractexp.inference.separable import NormalMatrix, Sensitivities


def dense(J: Sensitivities) -> np.ndarray:
    """(R, k + m E)."""
    m = len(J.columns) - J.k
    whole = np.zeros((J.columns.shape[1], J.k + m * len(J.rows)))
    whole[:, : J.k] = J.shared_columns
    for e, rows in enumerate(J.rows):
        whole[rows, J.k + e * m : J.k + (e + 1) * m] = J.own(e)
    return whole


def dense_normal(matrix: NormalMatrix) -> np.ndarray:
    """(n, D, D)."""
    at, own = matrix.positions, matrix.columns.coordinates
    n, size = matrix.diagonal.shape
    entries = np.zeros((n, size, size))
    entries[:, at[:, None], at] = matrix.shared
    for e, mine in enumerate(own):
        entries[:, mine[:, None], mine] = matrix.own[:, e]
        entries[:, mine[:, None], at] = matrix.cross[:, e]
        entries[:, at[:, None], mine] = np.swapaxes(matrix.cross[:, e], 1, 2)
    return entries
