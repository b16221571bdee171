"""What a few rows span."""

import numpy as np


def compute_basis(rows: np.ndarray, distinct: float, least: float = 0.0) -> np.ndarray:
    """Orthonormal basis (m, R) of what rows (k, R) span, each scaled to length one; those of at
    most `least` are none.

    Directions weaker than `distinct` times the strongest are left out.
    """
    length = np.linalg.norm(rows, axis=1)
    rows = rows[length > least] / length[length > least, None]
    if not len(rows):
        return rows
    _, values, basis = np.linalg.svd(rows, full_matrices=False)
    return basis[values > distinct * values[0]]
