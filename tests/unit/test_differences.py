"""Differences in place of derivatives, `compute_central_differences`."""

import numpy as np

from tractexp.inference.differences import compute_central_differences


def test_a_difference_is_one_sided_where_the_other_side_is_lost():
    """Rows A x that cannot be simulated above 0.5 in the second, below 0.5 in the third; the fourth
    is on a wall.
    """
    A = np.random.default_rng(1).normal(size=(6, 4))

    def rows(unit, lanes=None):
        made = unit @ A.T
        made[(unit[:, 1] > 0.5) | (unit[:, 2] < 0.5)] = np.nan
        return made

    at = np.array([0.3, 0.5, 0.5, 1.0])
    found, J = compute_central_differences(rows, at[None], np.zeros(1, dtype=int))
    np.testing.assert_allclose(found[0], A @ at)
    np.testing.assert_allclose(J[0].T, A, rtol=1e-6, atol=1e-9)
