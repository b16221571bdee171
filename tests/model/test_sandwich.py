"""The scatter of least squares where what is left is no noise, by `scatter` and `conclude`: against
its formula, refits, and how often its intervals hold.
"""

import numpy as np
import pytest
import uncertainty as study
from written_out import dense, printed_dip

import tractexp
from tractexp.identification.uncertainty import conclude, threshold
from tractexp.inference.blocks import LENGTH, blocks_of
from tractexp.inference.interval import interval_factor
from tractexp.inference.least_squares import descend
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.problem import Problem
from tractexp.inference.sandwich import scatter

NOISE = 0.004


def problem(error=None, depth=0.5, seed=5):
    """A record of the printed equations with white noise, and an `error` (2, N) besides."""
    t, U = study.Shape(depth).voltage()
    power = printed_dip(depth, tuple(study.TYPICAL), 0.35)
    power = power + NOISE * np.random.default_rng(seed).standard_normal(power.shape)
    return Problem(study.model(), [study.event(t, U, power + (0 if error is None else error))])


def least_squares(case, deviation=NOISE):
    """Eq. (8) in units of a deviation, and its minimum (d,)."""
    squares = Likelihood.of_squares(case, deviation)
    ended = descend(squares.rows, squares.to_unit(study.TYPICAL), tolerance=1e-8)
    return squares, ended.unit[0]


def test_eq_8_is_the_sum_of_squares_and_holds_the_power_before():
    case = problem()
    squares = Likelihood.of_squares(case, 0.01)
    unit = squares.to_unit(study.TYPICAL)
    assert unit.shape == (1, 7)
    rows = squares.rows(unit)[0]
    assert rows @ rows * 0.01**2 / case.drive.samples == pytest.approx(
        case.objective(study.TYPICAL[None])[0], rel=1e-9
    )
    assert squares.separable_columns.count == 0
    assert squares.with_initial_power.place_parameters(unit).shape == (1, 9)


def test_blocks_hold_every_sample_once_and_begin_with_the_dip():
    case = problem()
    (event,) = case.events
    blocks = blocks_of(case.events, case.drive, 7)
    assert np.array_equal(
        np.concatenate([np.arange(b.start, b.stop) for b in blocks]), np.arange(case.drive.samples)
    )
    assert event.start in [b.start for b in blocks]
    (length,) = {round((b.stop - b.start) * event.record.step, 3) for b in blocks[1:-1]}
    assert 0.9 * LENGTH < length <= LENGTH
    later = blocks_of(case.events, case.drive, 7, from_dip=True)
    assert later[0].start == event.start
    many = blocks_of(case.events, case.drive, 60)  # three for each parameter
    assert len(many) > 2.5 * 60


def test_leaving_out_a_block_is_what_a_refit_without_it_gives():
    """The influence of each block, to first order, against least squares without its samples."""
    case = problem()
    squares, unit = least_squares(case)
    scattered = scatter(squares, unit)
    blocks, moved = blocks_of(case.events, case.drive, 7), []
    (event,) = case.events
    for block in blocks:
        known = squares.valid.copy()
        known[:, block] = False
        before = np.arange(event.steady.start, event.steady.stop)
        rest = before[(before < block.start) | (before >= block.stop)]
        other = Problem(case.model, [event], substeps=int(case.step.substeps[0]))
        other.drive.before[0] = other.drive.measurements[:, rest].mean(axis=1)
        part = Likelihood(problem=other, noise=squares.noise, valid=known, initial_power=False)
        moved.append(descend(part.rows, unit[None], tolerance=1e-9).unit[0] - unit)
    errors = np.sqrt((len(blocks) - 1) / len(blocks) * np.sum(np.square(moved), axis=0)) * (
        case.upper - case.lower
    )
    ratio = scattered.information.standard_errors / errors
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
            squares, unit = least_squares(problem(error, seed=seed))
            left = float(np.sqrt(np.mean(squares.rows(unit[None])[0] ** 2)))
            each.append(scatter(squares.scale_noise(left), unit).ratio)
        ratios.append(np.median(each, axis=0))
    assert (ratios[0] < 1.6).all()
    assert (ratios[1][[0, 3, 4, 5]] > 1.5 * ratios[0][[0, 3, 4, 5]]).all()


def test_intervals_hold_the_truth_under_a_correlated_error_that_the_usual_ones_miss():
    """A slow random error, thrice the noise: 10 records, the parameters that one dip tells."""
    told, usual = [], []
    own = [0, 3, 4, 5]  # T', M, T_m, p_v
    for seed in range(10):
        rng = np.random.default_rng([seed, 4])
        case = problem(study.noise(rng, 1000, 3 * NOISE, 0.97), seed=seed)
        squares, unit = least_squares(case)
        known = conclude(squares, unit, squares.with_initial_power)
        off = np.abs(known.values - study.TYPICAL)[own]
        told.append(off <= known.half[own])
        rows, J = squares.jacobian(unit)[0], dense(squares.jacobian(unit)[1])
        plain = np.sqrt(np.diag(np.linalg.inv(J.T @ J)) * np.mean(rows**2)) * (
            case.upper - case.lower
        )
        usual.append(off <= 1.96 * plain[own])
    assert np.mean(told) > 0.8
    assert np.mean(usual) < 0.6


def test_a_parameter_on_a_bound_is_held_for_the_others_and_has_an_error_of_its_own():
    t, U = study.Shape(0.5).voltage()
    power = printed_dip(0.5, tuple(study.TYPICAL), 0.35)
    power = power + NOISE * np.random.default_rng(1).standard_normal(power.shape)
    # the truth is 0.006
    case = Problem(study.model(), [study.event(t, U, power)], {"M": [0.001, 0.005]})
    squares = Likelihood.of_squares(case, NOISE)
    unit = descend(
        squares.rows, squares.to_unit(np.minimum(study.TYPICAL, case.upper)), tolerance=1e-8
    ).unit[0]
    assert unit[3] == 1.0
    errors = scatter(squares, unit).information.standard_errors
    assert np.isfinite(errors).all()
    assert errors[3] < 0.1 * 0.005


def test_the_deviance_rises_to_its_limit_where_the_interval_ends():
    """Of a parameter by itself, others free: the parabola of the sandwich, by the likelihood as
    wide as the scatter.
    """
    squares, unit = least_squares(problem())
    known = conclude(squares, unit, squares.with_initial_power)
    j = known.names.index("T_m")
    moved = unit.copy()
    moved[j] += known.half[j] / (known.upper[j] - known.lower[j])
    held = np.zeros((1, len(unit)), dtype=bool)
    held[0, j] = True
    rise = (
        descend(known.likelihood.rows, moved[None], held, tolerance=1e-8).deviance[0]
        - known.deviance
    )
    assert rise == pytest.approx(known.limits[j], rel=0.25)
    assert known.limits[j] != pytest.approx(threshold(), rel=0.01)


def test_students_t_of_few_blocks_is_wide():
    assert interval_factor(4) == pytest.approx(2.776, abs=1e-3)
    assert interval_factor(999) == pytest.approx(1.96, abs=5e-3)


def test_a_parameter_on_a_bound_that_changes_nothing_is_not_known_and_ruins_nothing():
    """Reactive power of the static part is none, so that q_v means nothing; it rests on a bound."""
    t, U = study.Shape(0.5).voltage()
    power = printed_dip(0.5, tuple(study.TYPICAL), 0.0)
    power = power + NOISE * np.random.default_rng(1).standard_normal(power.shape)
    case = Problem(study.model(), [study.event(t, U, power)])
    squares = Likelihood.of_squares(case, NOISE)
    unit = squares.to_unit(study.TYPICAL)[0]
    unit[-1] = 0.0
    frozen = np.zeros((1, 7), dtype=bool)
    frozen[0, -1] = True
    unit = descend(squares.rows, unit[None], frozen).unit[0]
    silent = Silent(problem=case, noise=squares.noise, valid=squares.valid, initial_power=False)
    errors = scatter(silent, unit).information.standard_errors
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


def test_the_power_before_is_free_around_what_was_measured_and_stands_there_at_first():
    case = problem()
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
    case = problem()
    free = Likelihood.of_squares(case, NOISE).free_set
    assert free.names == case.space.names
    assert not len(free.before)


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
