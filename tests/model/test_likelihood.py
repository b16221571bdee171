"""The `Likelihood` of records: its derivatives by an independent solution, and normal equations
that fall apart by event.
"""

from dataclasses import replace

import numpy as np
import pytest
import uncertainty as study
from printed_events import records
from written_out import dense_normal

from tractexp.inference.least_squares import normal
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
        normal(likelihood.rows, unit, base, lanes, apart)
        for apart in (NOT_SEPARABLE, likelihood.separable_columns)
    )
    for one, other in (alone[0], together[0]), (dense_normal(alone[1]), dense_normal(together[1])):
        assert other == pytest.approx(one, rel=1e-6, abs=1e-6 * np.abs(one).max())
    assert (dense_normal(together[1]) == np.swapaxes(dense_normal(together[1]), 1, 2)).all()
