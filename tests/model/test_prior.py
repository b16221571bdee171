"""What machines usually are, `compute_departures`: its numbers, and rows beside those of the
records.
"""

from dataclasses import replace

import numpy as np
import pytest
from printed_events import minimum

import tractexp
from tractexp.configuration.plugin import get
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.prior import compute_departures, describe_prior
from tractexp.inference.problem import Problem
from tractexp.inference.sandwich import estimate_scatter

# R_s, X_s, X_m, R_r, X_r, H, load factor of the seven types of the source
TYPES = (
    (0.031, 0.10, 3.2, 0.018, 0.18, 0.7, 0.6), (0.013, 0.067, 3.8, 0.009, 0.17, 1.5, 0.8),
    (0.013, 0.14, 2.4, 0.009, 0.12, 0.8, 0.7), (0.013, 0.14, 2.4, 0.009, 0.12, 1.5, 0.7),
    (0.077, 0.107, 2.22, 0.079, 0.098, 0.74, 0.46), (0.035, 0.094, 2.8, 0.048, 0.163, 0.93, 0.6),
    (0.064, 0.091, 2.23, 0.059, 0.071, 0.34, 0.8),
)  # fmt: skip
OMEGA = 2 * np.pi * 60


def parameters(R_s, X_s, X_m, R_r, X_r, H, load):
    """Of a motor of rating 1/load, which draws 1."""
    X, X_prime = X_s + X_m, X_s + X_m * X_r / (X_m + X_r)
    T_prime = X_prime / X * (X_r + X_m) / (OMEGA * R_r)
    own = {"X_prime": X_prime * load, "R_s": R_s * load, "M": 2 * H / OMEGA / load}
    return {"T_prime": T_prime, "C": 1 - X_prime / X, "T_m": 1.0, **own}


def test_medians_and_factors_are_those_of_the_seven_types():
    motor = get("model/motor", "stator_flux")()
    rows = [motor.usual(**parameters(*one)) for one in TYPES]
    logs = np.log([[quantity for quantity, _, _ in row] for row in rows])
    medians, factors = np.array([[median, factor] for _, median, factor in rows[0]]).T
    assert medians == pytest.approx(np.exp(logs.mean(axis=0)), rel=0.02)
    assert factors == pytest.approx(np.exp(1.5 * logs.std(axis=0, ddof=1)), rel=0.03)


@pytest.mark.parametrize(
    ("motor", "known"),
    [
        ("double_cage", 4),
        ("double_cage_stator_flux", 5),
        (["double_cage", "electromechanical"], 8),
    ],
)
def test_a_motor_says_what_is_usual_of_some_of_its_parameters(motor, known):
    (event,) = tractexp.read("tibet_50pct")
    model = tractexp.compose(motor=motor).model
    values = np.array([[p.default for p in model.parameters]])
    rows = compute_departures(Problem(model, [event], priors=True), values)
    assert rows.shape == (1, known)
    assert np.isfinite(rows).all()


@pytest.fixture(scope="module")
def problem():
    (event,) = tractexp.read("tibet_50pct")
    model = tractexp.compose().model
    return Problem(model, [event], fixed={"p_v": 1.5, "q_v": 2.5}, priors=True)


def test_a_quantity_at_its_median_departs_by_nothing_and_at_its_factor_by_one(problem):
    values = {
        "T_prime": 0.027,
        "C": 1 - 0.082 * 1.33,
        "T_m": 0.5,
        "X_prime": 0.15 / 0.5,
        "M": 0.0068 * 0.5 / 2.2,
    }
    row = np.array([[values[name] for name in problem.space.names]])
    assert compute_departures(problem, row)[0] == pytest.approx([1.0, 0.0, 0.0, -1.0], abs=1e-9)
    assert describe_prior(problem, row[0]).endswith(
        "and is 1 standard deviations off where it is farthest"
    )


def test_a_motor_of_which_nothing_is_known_is_held_by_nothing(problem):
    other = Problem(tractexp.compose(motor="none").model, problem.events, priors=True)
    assert compute_departures(other, other.defaults[None]).shape == (1, 0)


def test_rows_of_the_records_are_the_same_beside_a_prior(problem):
    squares = Likelihood.of_squares(problem, 0.01)
    held, unit = replace(squares, prior=3.0), np.full((2, problem.space.dimension), 0.4)
    rows, beside = squares.rows(unit), held.rows(unit)
    np.testing.assert_array_equal(beside[:, : rows.shape[1]], rows)
    np.testing.assert_allclose(
        beside[:, rows.shape[1] :], 3 * compute_departures(problem, squares.values(unit))
    )
    np.testing.assert_array_equal(held.of_records.rows(unit), rows)
    assert held.scale_noise(2.0).prior == 1.5


def test_a_parameter_that_the_prior_alone_holds_scatters_as_it_says(problem):
    """However much it weighs: log(1 - C) by log 1.33, and so on; a jackknife is some
    percent off.
    """
    for prior in (1e4, 1e5):
        held = replace(Likelihood.of_squares(problem, 0.01), prior=prior)
        start = problem.space.to_unit(problem.defaults)
        unit = minimum(held, start, iterations=200, tolerance=1e-9, central=True)
        information, *_ = estimate_scatter(held, unit)
        values = dict(zip(problem.space.names, information.values, strict=True))
        errors = dict(zip(problem.space.names, information.standard_errors, strict=True))
        assert errors["C"] == pytest.approx((1 - values["C"]) * np.log(1.33), rel=0.05)
        assert errors["T_prime"] == pytest.approx(values["T_prime"] * np.log(5.2), rel=0.05)
