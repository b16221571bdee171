"""The batched descent of least squares, `descend`, on linear problems."""

import numpy as np

from tractexp.inference.least_squares import descend


def test_descent_solves_many_linear_problems_and_keeps_to_walls_and_frozen_columns():
    rng = np.random.default_rng(2)
    # the last lies beyond the wall
    A, truth = rng.standard_normal((30, 3)), np.array([0.2, 0.9, 1.4])

    def rows(unit, lanes):
        return (unit - truth) @ A.T

    start = np.full((2, 3), 0.5)
    frozen = np.array([[False] * 3, [True, False, False]])
    found = descend(rows, start, frozen, iterations=100, tolerance=1e-12)
    for lane, held in enumerate(([2], [0, 2])):
        fixed = {2: 1.0, 0: 0.5}
        free = [k for k in range(3) if k not in held]
        offset = sum(A[:, k] * (fixed[k] - truth[k]) for k in held)
        expected = truth[free] + np.linalg.lstsq(A[:, free], -offset, rcond=None)[0]
        np.testing.assert_allclose(found.unit[lane][free], expected, atol=1e-5)
        assert found.unit[lane][2] == 1.0
