"""The scatter of least squares where what is left is no noise, by `estimate_scatter`: against
refits, and of white and correlated residuals.
"""

import numpy as np
import pytest
import uncertainty as study
from printed_events import NOISE, minimum, one_dip

import tractexp
from tractexp.inference.blocks import LENGTH, cut_blocks
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.problem import Problem
from tractexp.inference.sandwich import (
    compute_moves_without_blocks,
    compute_robust_root,
    estimate_scatter,
)


def least_squares(case, deviation=NOISE):
    """Eq. (8) in units of a deviation, and its minimum (d,)."""
    squares = Likelihood.of_squares(case, deviation)
    return squares, minimum(squares, squares.to_unit(study.TYPICAL)[0])


def test_blocks_hold_every_sample_once_and_begin_with_the_dip():
    case = one_dip()
    (event,) = case.events
    blocks = cut_blocks(case.events, case.drive, 7)
    assert np.array_equal(
        np.concatenate([np.arange(b.start, b.stop) for b in blocks]), np.arange(case.drive.samples)
    )
    assert event.start in [b.start for b in blocks]
    (length,) = {round((b.stop - b.start) * event.record.step, 3) for b in blocks[1:-1]}
    assert 0.9 * LENGTH < length <= LENGTH
    later = cut_blocks(case.events, case.drive, 7, from_dip=True)
    assert later[0].start == event.start
    many = cut_blocks(case.events, case.drive, 60)  # three for each parameter
    assert len(many) > 2.5 * 60


def test_of_a_linear_model_leaving_out_a_block_moves_it_as_a_refit_does():
    rng = np.random.default_rng(1)
    J, rows = rng.standard_normal((1, 60, 3)), 0.01 * rng.standard_normal((1, 60))
    blocks = [slice(k, k + 20) for k in (0, 20, 40)]
    whole = np.linalg.lstsq(J[0], -rows[0])[0]
    moves = compute_moves_without_blocks(J, rows + J @ whole, blocks, J[0].T @ J[0])
    for block, move in zip(blocks, moves, strict=True):
        rest = np.setdiff1d(np.arange(60), np.arange(60)[block])
        assert np.linalg.lstsq(J[0, rest], -rows[0, rest])[0] - whole == pytest.approx(move)


def test_no_error_is_less_than_that_of_independent_residuals():
    """Where blocks hardly move the estimate, as by chance a few may."""
    J = np.random.default_rng(2).standard_normal((40, 3))
    root, ratio, spread = compute_robust_root(J, np.zeros((4, 3)))
    assert root.T @ root == pytest.approx(J.T @ J)
    assert [*ratio, spread] == pytest.approx([1.0] * 4)


def test_leaving_out_a_block_is_what_a_refit_without_it_gives():
    """The influence of each block, to first order, against least squares without its samples."""
    case = one_dip()
    squares, unit = least_squares(case)
    information, *_ = estimate_scatter(squares, unit)
    blocks, moved = cut_blocks(case.events, case.drive, 7), []
    (event,) = case.events
    for block in blocks:
        known = squares.valid.copy()
        known[:, block] = False
        before = np.arange(event.steady.start, event.steady.stop)
        rest = before[(before < block.start) | (before >= block.stop)]
        other = Problem(case.model, [event], substeps=int(case.step.substeps[0]))
        other.drive.before[0] = other.drive.measurements[:, rest].mean(axis=1)
        part = Likelihood(problem=other, noise=squares.noise, valid=known, initial_power=False)
        moved.append(minimum(part, unit, tolerance=1e-9) - unit)
    errors = np.sqrt((len(blocks) - 1) / len(blocks) * np.sum(np.square(moved), axis=0)) * (
        case.upper - case.lower
    )
    ratio = information.standard_errors / errors
    assert np.median(ratio) == pytest.approx(1.0, abs=0.15)
    assert (ratio > 0.85).all()  # in no direction less than that of independent residuals
    assert (ratio < 1.6).all()


def test_of_white_noise_it_is_near_the_usual_error_and_of_correlated_residuals_above():
    ratios = []
    for phi in (0.0, 0.97):
        each = []
        for seed in range(6):
            rng = np.random.default_rng([seed, 9])
            error = study.noise(rng, 1000, NOISE, phi)
            squares, unit = least_squares(one_dip(error, seed=seed))
            left = float(np.sqrt(np.mean(squares.rows(unit[None])[0] ** 2)))
            _, _, ratio, _ = estimate_scatter(squares.scale_noise(left), unit)
            each.append(ratio)
        ratios.append(np.median(each, axis=0))
    assert (ratios[0] < 1.6).all()
    assert (ratios[1][[0, 3, 4, 5]] > 1.5 * ratios[0][[0, 3, 4, 5]]).all()


def test_a_parameter_on_a_bound_is_held_for_the_others_and_has_an_error_of_its_own():
    case = one_dip(seed=1, bounds={"M": [0.001, 0.005]})  # the truth is 0.006
    squares = Likelihood.of_squares(case, NOISE)
    unit = minimum(squares, squares.to_unit(np.minimum(study.TYPICAL, case.upper))[0])
    assert unit[3] == 1.0
    errors = estimate_scatter(squares, unit)[0].standard_errors
    assert np.isfinite(errors).all()
    assert errors[3] < 0.1 * 0.005


def test_a_parameter_on_a_bound_that_changes_nothing_is_not_known_and_ruins_nothing():
    """Reactive power of the static part is none, so that q_v means nothing; it rests on a bound."""
    case = one_dip(seed=1, Q_s0=0.0)
    squares = Likelihood.of_squares(case, NOISE)
    unit = squares.to_unit(study.TYPICAL)[0]
    unit[-1] = 0.0
    unit = minimum(squares, unit, held=[6])
    silent = Silent(problem=case, noise=squares.noise, valid=squares.valid, initial_power=False)
    errors = estimate_scatter(silent, unit)[0].standard_errors
    assert np.isinf(errors[-1])
    assert np.isfinite(errors[:-1]).all()


class Silent(Likelihood):
    """One whose last parameter changes nothing."""

    @property
    def with_initial_power(self):
        return Silent(problem=self.problem, noise=self.noise, valid=self.valid, initial_power=True)

    def jacobian(self, unit):
        rows, J = super().jacobian(unit)
        J.columns[self.free - 1] = 0.0
        return rows, J


def test_a_fit_whose_parameters_all_stand_on_bounds_is_told():
    """Nothing is left inside, as where bounds are narrow and the load is another."""
    t = np.arange(300) * 0.01
    U = np.where((t > 1.0) & (t < 1.3), 0.7, 1.0)
    noise = 1e-4 * np.random.default_rng(0).standard_normal((2, len(t)))
    columns = {"t": t, "U": U, "P": U + noise[0], "Q": 0.5 * U + noise[1]}
    found = tractexp.identify(
        tractexp.read(columns),
        "static_exponential",
        bounds={"p_v": (4.0, 5.0), "q_v": (4.0, 5.0)},
        optimizer="multistart_least_squares",
        progress=False,
    )
    assert [found.parameters[name].value for name in ("p_v", "q_v")] == [4.0, 4.0]
    assert str(found.grade) == "wrong_model"
