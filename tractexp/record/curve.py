"""The smooth curve through samples."""

import numpy as np


def compute_slopes(y: np.ndarray) -> np.ndarray:
    """The slope at each sample of a smooth curve through them, which does not overshoot.

    Between samples the kernel reads the voltage off the cubics that these slopes define. A straight
    line would round the edges of a dip recorded every 10 ms by more than the noise of a good
    recorder.

    Parameters
    ----------
    y : (N,)
        Values at even times.

    Returns
    -------
    (N,) array
        Per sample.

    Notes
    -----
    Source: Akima 1970, with the weights that keep flat stretches flat (makima).

    Examples
    --------
    >>> compute_slopes(np.array([0.0, 1.0, 2.0, 3.0])).round(9).tolist()
    [1.0, 1.0, 1.0, 1.0]
    """
    if len(y) < 3:
        return np.gradient(y) if len(y) > 1 else np.zeros(len(y))
    m = np.diff(y)
    before = [2 * m[0] - m[1], 3 * m[0] - 2 * m[1]]
    after = [2 * m[-1] - m[-2], 3 * m[-1] - 2 * m[-2]]
    m = np.concatenate((before[::-1], m, after))  # m[k + 2] is the slope after sample k
    spread = np.abs(np.diff(m)) + np.abs(m[1:] + m[:-1]) / 2
    left, right = spread[2:], spread[:-2]  # weights of the slopes before and after each sample
    total = left + right
    return np.where(
        total > 0, (left * m[1:-2] + right * m[2:-1]) / np.where(total > 0, total, 1.0), 0.0
    )
