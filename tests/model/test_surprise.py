"""Whether noise leaves as much as a fit does, as `adequacy` judges it: silent on noise, outspoken
on what is missing.
"""

from dataclasses import replace

import numpy as np
import pytest
import uncertainty as study
from printed_events import one_dip, problem, records

from tractexp.identification import adequacy
from tractexp.inference import goodness_of_fit
from tractexp.inference.likelihood import Likelihood


@pytest.fixture(scope="module")
def known():
    """The estimate of one dip."""
    return study.judged(one_dip(), study.TYPICAL).uncertainty


def test_two_dips_whose_loads_differ_are_told_by_parameters_of_each_event():
    """Two dips of one load whose shaft torque was 15 % higher the second time, and twice of the
    same load.
    """
    changed = study.TYPICAL * np.where(np.array(study.model().names) == "T_m", 1.15, 1.0)
    pushed = []
    for second in (changed, study.TYPICAL):
        (one,) = records((0.5,), 0.002, seed=4)
        (other,) = records((0.5,), 0.002, seed=5, truth=second)
        other = replace(other, record=replace(other.record, name="second"))
        pushed.append(study.judged(problem([one, other]), study.TYPICAL).surprise)
    assert (pushed[0].loudest, pushed[0].p < 1e-6) == (adequacy.PER_EVENT, True)
    assert pushed[1].p > goodness_of_fit.ADEQUATE_P


def test_what_is_judged_is_the_estimate_against_all_draws(known, monkeypatch):
    judged = []

    def count_draws(draws, value, scale=None):
        judged.append((len(draws), len(value)))
        return 1.0

    monkeypatch.setattr(goodness_of_fit, "compute_tail_p", count_draws)
    adequacy.run_residual_test(known.likelihood, known.unit)
    assert {*judged} == {(goodness_of_fit.NULL_DRAWS, 1)}


def test_p_of_noise_alone_is_no_smaller_than_it_says(known):
    """40 judgements of noise drawn anew: one in ten below 0.1, give or take."""
    problem = known.likelihood.problem
    clean = known.likelihood.residuals(known.unit[None])[0] + problem.drive.measurements
    rng, p = np.random.default_rng(2), []
    for _ in range(40):
        drive = replace(
            problem.drive, measurements=clean + 0.004 * rng.standard_normal(clean.shape)
        )
        noisy = problem.driven_by(problem.events)
        noisy.drive = drive
        again = replace(known.likelihood, problem=noisy)
        p.append(adequacy.run_residual_test(again, known.unit).p)
    assert 0.0 <= np.mean(np.array(p) < 0.1) < 0.25
    assert min(p) > goodness_of_fit.ADEQUATE_P


def test_a_model_that_takes_its_error_for_slow_noise_is_found_out_by_least_squares(known):
    """Had least squares left half as much, the likelihood would give up far more of Eq. (8) than it
    does on draws.
    """
    likelihood = known.of_noise
    squares = Likelihood.of_squares(likelihood.problem, 0.004)
    rows = squares.with_initial_power.rows(known.unit[None])[0]
    least = float(rows @ rows)
    agree = adequacy.run_residual_test(likelihood, known.unit, squares, least)
    apart = adequacy.run_residual_test(likelihood, known.unit, squares, least / 2)
    assert agree.p > goodness_of_fit.ADEQUATE_P
    assert (apart.loudest, apart.p < goodness_of_fit.ADEQUATE_P) == (adequacy.APART, True)
