"""What a Jacobian tells of its parameters, `Information`."""

import numpy as np
import pytest

from tractexp.inference.information import Information


def test_information_of_a_straight_line_is_the_textbooks():
    """y = a + b x: the variances of regression, once with the level as a nuisance."""
    x = np.linspace(0, 1, 50)
    J = np.column_stack((np.ones(50), x))
    whole = Information.from_jacobian(("a", "b"), np.ones(2), np.ones(2), J, np.zeros((50, 1)))
    np.testing.assert_allclose(whole.covariance, np.linalg.inv(J.T @ J), rtol=1e-9)
    slope = Information.from_jacobian(("b",), np.ones(1), np.ones(1), J[:, 1:], J[:, :1])
    assert slope.standard_errors[0] == pytest.approx(whole.standard_errors[1], rel=1e-9)
