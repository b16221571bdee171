"""What a few rows span."""

import numpy as np


def compute_basis(rows: np.ndarray, distinct: float, least: float = 0.0) -> np.ndarray:
    """An orthonormal basis of what rows span.

    Parameters
    ----------
    rows : (k, R)
        Each is scaled to length one first.
    distinct : float
        Directions weaker than this times the strongest are left out.
    least : float
        Rows of at most this length do not count.

    Returns
    -------
    (m, R) array

    Examples
    --------
    >>> compute_basis(np.array([[2.0, 0.0], [4.0, 0.0]]), 1e-6).shape
    (1, 2)
    """
    length = np.linalg.norm(rows, axis=1)
    rows = rows[length > least] / length[length > least, None]
    if not len(rows):
        return rows
    _, values, basis = np.linalg.svd(rows, full_matrices=False)
    return basis[values > distinct * values[0]]


def project_out(rows: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """Rows (..., R) without what orthonormal rows (m, R) span.

    Examples
    --------
    >>> project_out(np.array([[3.0, 4.0]]), np.array([[1.0, 0.0]])).tolist()
    [[0.0, 4.0]]
    """
    return rows - (rows @ basis.T) @ basis
