"""A line through samples that hang together, and how far it moves where blocks of them are left
out.
"""

import numpy as np

LEFT_OUT_BLOCKS = 20  # in turn: the delete-a-block jackknife, Kunsch 1989


def fit_line(X: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least squares of samples in order of time.

    Parameters
    ----------
    X : (n, k)
        Columns.
    y : (n,)
        What they are to give.

    Returns
    -------
    (k,) array
        The coefficients.
    (k,) array
        Their standard errors.
    """
    fit = np.linalg.lstsq(X, y, rcond=None)[0]
    count = min(LEFT_OUT_BLOCKS, len(y) // 2)
    squares = np.zeros_like(fit)
    for block in np.array_split(np.arange(len(y)), count):
        some = np.delete(X, block, axis=0)
        rest = np.delete(y, block)
        without = np.linalg.lstsq(some, rest, rcond=None)[0]
        squares += (without - fit) ** 2
    share = (count - 1) / count
    return fit, np.sqrt(share * squares)
