"""Derivatives and normal equations that fall apart by event, with every entry written out; and what
the printed equations give, solved once in a process.
"""

from functools import cache

import numpy as np
import uncertainty as study

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


@cache
def printed_dip(depth: float, truth: tuple[float, ...], Q_s0: float, P0: float = 1.0) -> np.ndarray:
    """P and Q (2, N) of Eqs. (1)-(7) in a dip of this depth; another solution takes a second."""
    clean = study.printed(np.array(truth), *study.Shape(depth).voltage(), Q_s0, P0)
    clean.flags.writeable = False
    return clean
