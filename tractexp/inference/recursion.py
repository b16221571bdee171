"""The recursive filter of one pole, for what reads records by many poles."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def sum_with_decay(values: ArrayLike, factor: complex) -> NDArray[np.complex128]:
    """The sum of what came before, fading by one factor a sample.

        y[k] = x[k] + factor y[k - 1],  y[-1] = 0

    Parameters
    ----------
    values : (n,)
        x.
    factor : complex
        The pole of this recursive filter; its modulus below 1 is stable.

    Returns
    -------
    (n,) complex array
        y.

    Examples
    --------
    >>> sum_with_decay([1.0, 0.0, 0.0], 0.5).real.tolist()
    [1.0, 0.5, 0.25]
    """
    # as fast as scipy.signal's filter, which takes a second to import
    from scipy.linalg.blas import ztbsv  # pyright: ignore[reportAttributeAccessIssue]

    x = np.asarray(values, dtype=np.complex128)
    bands = np.repeat(np.array([[1.0], [-factor]]), len(x), axis=1)
    return np.asarray(ztbsv(1, bands, x, lower=1, diag=1))
