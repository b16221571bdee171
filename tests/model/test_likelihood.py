"""The `Likelihood` of records: its derivatives by an independent solution, and normal equations
that fall apart by event.
"""

from dataclasses import replace

import numpy as np
import pytest
import uncertainty as study
from printed_events import NOISE, one_dip, records
from written_out import dense_normal

from tractexp.inference.least_squares import build_normal_matrix
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.problem import Problem
from tractexp.inference.separable import NOT_SEPARABLE


def test_jacobian_agrees_with_the_printed_equations():
    """Central differences of an independent solution of Eqs. (1)-(7), not of the model's own
    kernel.
    """
    # the mean before a smooth fall is a little lower
    events = [replace(records((0.5,), 0.005)[0], U0=1.0)]
    problem = Problem(study.model(), events, substeps=16)
    likelihood = Likelihood.of_squares(problem, 1.0)
    t, U = events[0].record.t, events[0].record.U
    _, J = likelihood.jacobian(likelihood.to_unit(study.TYPICAL)[0])
    for j, name in enumerate(study.NAMES):
        h = 1e-3 * study.TYPICAL[j]  # well above the reference's own error of 1e-8
        sides = []
        for sign in (1, -1):
            moved = study.TYPICAL.copy()
            moved[j] += sign * h
            P, Q = study.printed(moved, t, U, 0.0, P0=events[0].P0)
            sides.append(np.concatenate((P, Q + (events[0].Q0 - Q[0]) * U ** moved[6])))
        expected = (sides[0] - sides[1]) / (2 * h) * (problem.upper - problem.lower)[j]
        np.testing.assert_allclose(
            J.shared_columns[:, j], expected, atol=1e-4 * np.abs(expected).max(), err_msg=name
        )


def test_the_normal_equations_of_the_likelihood_are_those_of_every_column_by_itself():
    """P0 and Q0 of each event stand in columns of their own, which are never written out."""
    likelihood = Likelihood.from_problem(Problem(study.model(), records((0.3, 0.5), 0.003)))
    unit, lanes = likelihood.to_unit(study.TYPICAL), np.zeros(1, dtype=int)
    base = likelihood.rows(unit)
    alone, together = (
        build_normal_matrix(likelihood.rows, unit, base, lanes, apart)
        for apart in (NOT_SEPARABLE, likelihood.separable_columns)
    )
    for one, other in (alone[0], together[0]), (dense_normal(alone[1]), dense_normal(together[1])):
        assert other == pytest.approx(one, rel=1e-6, abs=1e-6 * np.abs(one).max())
    assert (dense_normal(together[1]) == np.swapaxes(dense_normal(together[1]), 1, 2)).all()


def test_eq_8_is_the_sum_of_squares_and_holds_the_power_before():
    case = one_dip()
    squares = Likelihood.of_squares(case, 0.01)
    unit = squares.to_unit(study.TYPICAL)
    assert unit.shape == (1, 7)
    rows = squares.rows(unit)[0]
    assert rows @ rows * 0.01**2 / case.drive.samples == pytest.approx(
        case.objective(study.TYPICAL[None])[0], rel=1e-9
    )
    assert squares.separable_columns.count == 0
    assert squares.with_initial_power.place_parameters(unit).shape == (1, 9)


def test_the_power_before_is_free_around_what_was_measured_and_stands_there_at_first():
    case = one_dip()
    free = Likelihood.from_problem(case).free_set
    (P, Q), reach = case.drive.before[0], 0.2 * np.linalg.norm(case.drive.before[0])
    assert free.names[-2:] == ("P0[1]", "Q0[1]")
    assert free.box.lower[free.before] == pytest.approx([P - reach, Q - reach])
    assert free.box.upper[free.before] == pytest.approx([P + reach, Q + reach])
    moved = np.full(free.dimension, 0.25)
    stood = free.at_measured_power(moved)
    assert stood[: free.parameter_count].tolist() == [0.25] * 7
    assert free.box.from_unit(stood)[free.before] == pytest.approx([P, Q])


def test_where_the_power_before_is_held_only_the_parameters_are_free():
    case = one_dip()
    free = Likelihood.of_squares(case, NOISE).free_set
    assert free.names == case.space.names
    assert not len(free.before)
