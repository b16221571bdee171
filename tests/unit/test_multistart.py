"""Which local minima are told apart, `select_distinct`."""

import numpy as np

from tractexp.inference.least_squares import Descent
from tractexp.inference.multistart import select_distinct


def test_valleys_are_told_apart_and_the_best_comes_first():
    unit = np.array([[0.1, 0.1], [0.12, 0.1], [0.9, 0.9]])
    ends = Descent(unit, np.array([5.0, 4.0, 3.0]), 0)
    np.testing.assert_array_equal(select_distinct(ends, 2), unit[[2, 1]])
