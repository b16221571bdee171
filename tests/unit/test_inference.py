"""The arithmetic that identifications and investigations share: intervals
(`compute_interval_factor`), errors of what is free (`compute_free_standard_errors`), goodness of
fit (`compare_with_draws`).
"""

import numpy as np
import pytest

from tractexp.inference.free_set import join_boxes
from tractexp.inference.goodness_of_fit import GoodnessOfFit, Scale, compare_with_draws
from tractexp.inference.information import compute_free_standard_errors
from tractexp.inference.interval import ParameterEstimate, compute_interval_factor
from tractexp.parameter import Box, Parameter

SHARE = Parameter(0.5, (0.0, 1.0), "1", "a share", "made up", name="share")


def test_an_error_that_is_known_has_the_normal_interval_and_one_of_few_blocks_a_wider_one():
    assert compute_interval_factor() == pytest.approx(1.959964, abs=1e-6)
    assert compute_interval_factor(9) == pytest.approx(2.262157, abs=1e-6)
    assert compute_interval_factor(0) == compute_interval_factor(
        1
    )  # one block tells no more than two do


def test_an_interval_is_cut_at_the_bounds_and_is_none_without_an_error():
    assert ParameterEstimate(SHARE, 0.9, 0.1).interval == pytest.approx((0.9 - 0.1959964, 1.0))
    assert ParameterEstimate(SHARE, 0.5, 0.1, freedom=9).half == pytest.approx(0.2262157)
    assert np.isnan(ParameterEstimate(SHARE, 0.5, np.nan).interval).all()


def test_a_standard_error_is_that_of_the_inverse_and_of_a_coordinate_changing_nothing_infinite():
    root = np.array([[2.0, 1.0, 0.0], [0.0, 4.0, 0.0]])
    known = np.sqrt(np.diag(np.linalg.inv(root[:, :2].T @ root[:, :2])))
    assert compute_free_standard_errors(root) == pytest.approx([*known, np.inf])


def test_two_coordinates_that_do_the_same_are_not_known_alone():
    assert np.isinf(compute_free_standard_errors(np.array([[1.0, 1.0], [2.0, 2.0]]))).all()


def test_a_fit_is_as_good_as_its_most_significant_test_corrected_for_their_number():
    fit = GoodnessOfFit({"a step": 0.01, "a tone": 0.5, "a window": 0.2})
    assert fit.most_significant_test == "a step"
    assert fit.p == pytest.approx(0.03)
    assert GoodnessOfFit({"a step": 0.6, "a tone": 0.9}).p == 1.0


def test_what_draws_leave_is_no_surprise_and_ten_times_as_much_is():
    draws = {
        "sum": np.random.default_rng(3).chisquare(20, 400),
        "largest": np.random.default_rng(4).random((400, 5)),
    }
    usual = {"sum": np.array([20.0]), "largest": np.full((1, 5), 0.5)}
    p = compare_with_draws(usual, draws)
    assert 0.3 < p["sum"] < 0.6
    assert p["largest"] > 0.9
    p = compare_with_draws({name: 10 * value for name, value in usual.items()}, draws)
    assert p["sum"] < 1e-12
    assert p["largest"] < 1e-6


def test_a_column_counts_in_the_scale_that_is_given_for_it():
    draws = {"largest": np.random.default_rng(4).standard_normal((400, 3))}
    value = {"largest": np.array([[0.0, 0.0, 8.0]])}
    wide = {"largest": Scale(np.zeros(3), np.array([1.0, 1.0, 100.0]))}
    assert compare_with_draws(value, draws)["largest"] < 1e-4
    assert compare_with_draws(value, draws, wide)["largest"] > 0.5


def test_the_box_of_two_has_the_coordinates_of_the_first_before_those_of_the_other():
    both = join_boxes(
        Box(np.zeros(2), np.ones(2), ("a", "b")), Box(np.array([-1.0]), np.array([3.0]), ("P0[1]",))
    )
    assert both.names == ("a", "b", "P0[1]")
    assert both.from_unit(np.array([0.5, 1.0, 0.5])).tolist() == [0.5, 1.0, 1.0]
