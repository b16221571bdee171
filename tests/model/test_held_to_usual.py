"""Fits that are `add_usual_prior`: the same rows in an identification and in an investigation."""

from pathlib import Path

import numpy as np
import pytest
from made_context import bench

import tractexp
from tractexp.identification.estimate import add_usual_prior
from tractexp.inference.blocks import cut_blocks
from tractexp.inference.likelihood import Likelihood
from tractexp.noise import Noise


@pytest.fixture(scope="module")
def contactors():
    """Two dips that the plain model misses by far, and another."""
    folder = Path(tractexp.__file__).parent / "data"
    return [tractexp.read(folder / f"contactors_{depth}pct.csv")[0] for depth in (50, 30, 65)]


def context(dips, *, priors):
    return bench(tractexp.compose().model, dips, ["stator_resistance"], priors=priors)


def test_a_block_of_samples_counts_as_one_row_of_the_prior(contactors):
    problem = context(contactors, priors=True).kernels.bare
    squares = Likelihood.of_squares(problem, 0.01)
    held, unit = add_usual_prior(squares), np.full((1, problem.space.dimension), 0.4)
    blocks = cut_blocks(problem.events, problem.drive, problem.space.dimension)
    assert held.prior**2 * len(blocks) == pytest.approx(squares.samples)
    np.testing.assert_array_equal(held.of_records.rows(unit), squares.rows(unit))


def test_an_investigation_holds_the_motor_by_the_rows_of_an_identification(contactors):
    """Eq. (8) with what machines usually are: the same rows at the same parameters."""
    investigated = context(contactors, priors=True).with_measured_power.held_to_usual
    squares = add_usual_prior(Likelihood.of_squares(investigated.kernels.bare, 0.02))
    at, free = investigated.coordinates, np.linspace(0.3, 0.6, squares.free)[None]
    unit = at.null[None].copy()
    unit[:, at.base] = free
    level = Noise(Noise.white(0.02, 0.02).pairs, np.eye(2))
    ours, theirs = investigated.rows(unit, level, (), [()]), squares.rows(free)
    assert investigated.prior > 1
    assert ours.shape == theirs.shape
    np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-12)
    held = squares.prior_rows(free)
    np.testing.assert_allclose(ours[:, -held.shape[1] :], held)


def test_an_investigation_without_priors_has_no_such_rows(contactors):
    free = context(contactors, priors=False)
    assert free.held_to_usual is free
    assert free.prior == 0.0
