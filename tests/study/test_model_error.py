"""The size of a model's error, `compute_model_error`: known answers, noise and drift told from it,
the headline, `result.json` and MLflow.
"""

import functools
import json
from dataclasses import replace

import numpy as np
import pytest
import uncertainty as study
from scipy import stats

import tractexp
from tractexp.identification.fit import Fit
from tractexp.inference.model_error import (
    ModelError,
    compute_model_error,
    estimate_noise_variance,
    format_percent,
    sum_blocks,
)
from tractexp.noise.random_walk import WANDERING_COSINES
from tractexp.report.fit_sentences import describe_rivals, find_rival_moves


@functools.cache
def shaped(depth):
    """t, U and the power (2, N) of the printed equations in a dip."""
    t, U = study.Shape(depth).voltage()
    return t, U, study.printed(study.TYPICAL, t, U, 0.35)


def played(off_P=0.0, off_Q=0.0, noise=0.0, drift=0.0, seed=0, depth=0.5, name="dip", base=1.0):
    """An event of the printed equations, and a model that is off by a share of the response in P
    and in Q.
    """
    t, U, clean = shaped(depth)
    rng = np.random.default_rng(seed)
    power = (
        clean
        + noise * rng.standard_normal(clean.shape)
        + drift * np.array([[1.0], [0.0]]) * (t - 0.15)
    )
    event = study.event(t, U, base * power, name)
    response = clean - clean[:, :1]
    P, Q = base * (clean[0] + off_P * response[0]), base * (clean[1] + off_Q * response[1])
    return Fit(event=event, role="train", P=P, Q=Q, epsilon_p=0.0, epsilon_q=0.0)


def test_a_model_that_follows_nine_tenths_of_the_response_is_off_by_a_tenth():
    error = compute_model_error([played(-0.1, -0.1)])
    assert error.value == pytest.approx(0.1, rel=1e-3)
    assert error.interval == pytest.approx((0.1, 0.1), rel=2e-3)  # the same share of every block
    fit = played()
    S = (fit.P + 1j * fit.Q)[fit.event.start :]
    response = np.abs(S - S_before(fit))
    assert error.of_S == pytest.approx(
        0.1 * np.sqrt(np.mean(response**2) / np.mean(np.abs(S) ** 2)), rel=1e-3
    )


def S_before(fit):
    return fit.event.P0 + 1j * fit.event.Q0


def test_a_static_load_that_never_answers_is_off_by_all_of_it():
    assert compute_model_error([played(-1.0, -1.0)]).value == pytest.approx(1.0, rel=1e-3)


def test_noise_is_not_counted_and_chance_is_in_the_interval():
    errors = [compute_model_error([played(noise=0.01, seed=seed)]) for seed in range(20)]
    assert np.median([e.value for e in errors]) < 0.025  # where noise alone is 7 % of the response
    assert all(e.interval[0] == 0.0 for e in errors)
    half = [compute_model_error([played(-0.1, -0.1, noise=0.01, seed=seed)]) for seed in range(20)]
    assert np.mean([e.value for e in half]) == pytest.approx(0.1, rel=0.05)
    assert np.mean([e.interval[0] <= 0.1 <= e.interval[1] for e in half]) > 0.7


def test_a_drift_before_the_dip_is_no_noise():
    quiet, drifting = (
        estimate_noise_variance(played(noise=4e-3, drift=d).event) for d in (0.0, 0.05)
    )
    assert drifting == pytest.approx(quiet, rel=0.1)
    assert np.sqrt(quiet) == pytest.approx(np.sqrt(2) * 4e-3, rel=0.2)


def test_a_short_record_has_as_many_blocks_as_one_of_a_second():
    """0.24 s of it has ten blocks of 24 ms; together with a long one it has blocks of a tenth of a
    second.
    """
    long = played(-0.1, -0.1)
    end = long.event.start + 120
    record = long.event.record
    cut = {name: getattr(record, name)[:end] for name in ("t", "U", "P", "Q")}
    short = replace(
        long,
        event=replace(long.event, record=replace(record, **cut)),
        P=long.P[:end],
        Q=long.Q[:end],
    )
    assert [len(sums) for sums in sum_blocks([short])] == [10]
    assert [len(sums) for sums in sum_blocks([short, long])] == [3, len(sum_blocks([long])[0])]


def test_blocks_are_shortened_until_so_many_share_the_response():
    """A dip of a tenth of a second is one block in seventeen; ten share it at a cycle, which is the
    shortest.
    """
    fit = played(-0.1, -0.1)
    record, start = fit.event.record, fit.event.start
    response = np.abs(
        (record.P + 1j * record.Q)[start:] - S_before(fit)
    ) ** 2 - estimate_noise_variance(fit.event)

    def sharing(sums):
        return sums[0][:, 1].sum() ** 2 / np.sum(sums[0][:, 1] ** 2)

    whole, some, cycles = (
        sum_blocks([fit], blocks) for blocks in (0.0, 1.5 * sharing(sum_blocks([fit])), 1e9)
    )
    assert sharing(some) >= 1.5 * sharing(whole)
    assert len(whole[0]) < len(some[0]) < len(cycles[0]) == -(-len(response) // 10)
    assert cycles[0][:, 1].sum() == pytest.approx(response.sum())
    assert whole[0].sum(axis=0) == pytest.approx(cycles[0].sum(axis=0))


def test_one_block_tells_nothing_of_chance(monkeypatch):
    monkeypatch.setattr("tractexp.inference.model_error.LENGTH", 100.0)
    monkeypatch.setattr("tractexp.inference.model_error.BLOCKS", 1)
    error = compute_model_error([played(-0.1, -0.1)])
    assert error.value == pytest.approx(0.1, rel=1e-3)
    assert error.interval == (0.0, np.inf)


def test_events_count_by_the_size_of_their_responses():
    one, two = played(-0.1, -0.1), played(-0.3, -0.3, depth=0.2, name="mild")
    error, alone = compute_model_error([one, two]), compute_model_error([two])
    assert alone.value == pytest.approx(0.3, rel=1e-3)
    assert 0.1 < error.value < 0.2
    assert error.interval[0] < error.value < error.interval[1]


def test_what_is_missing_of_the_record_counts_nowhere_and_what_diverged_counts_without_bounds():
    fit = played(-0.1, -0.1)
    P = fit.event.record.P.copy()
    P[300:320] = np.nan
    gaps = replace(fit, event=replace(fit.event, record=replace(fit.event.record, P=P)))
    assert compute_model_error([gaps]).value == pytest.approx(0.1, rel=1e-3)
    assert (
        compute_model_error([replace(fit, P=np.where(fit.event.record.t > 1, np.nan, fit.P))]).value
        == np.inf
    )


def test_the_interval_is_that_of_leaving_out_each_block_in_turn():
    """By hand, over blocks of 0.1 s; Student's t has the freedom of the blocks."""
    fit = played(-0.1, -0.05, noise=0.01, seed=3)
    record, start = fit.event.record, fit.event.start
    S, noise = (record.P + 1j * record.Q)[start:], estimate_noise_variance(fit.event)
    left = np.abs((fit.P + 1j * fit.Q)[start:] - S) ** 2 - noise
    response = np.abs(S - S_before(fit)) ** 2 - noise
    block = np.arange(len(S)) // 50
    squares = [left[block != b].sum() / response[block != b].sum() for b in range(block[-1] + 1)]
    whole, count = left.sum() / response.sum(), len(squares)
    reach = stats.t.ppf(0.975, count - 1) * np.sqrt(
        (count - 1) / count * np.sum((squares - whole) ** 2)
    )
    error = compute_model_error([fit])
    assert error.square == pytest.approx(whole)
    assert error.interval == pytest.approx((np.sqrt(max(whole - reach, 0)), np.sqrt(whole + reach)))


def test_an_error_depends_on_no_base_and_comes_back_as_it_was_stored():
    error, small = (compute_model_error([played(-0.1, -0.1, base=base)]) for base in (1.0, 1e-9))
    assert (small.value, small.of_S) == pytest.approx((error.value, error.of_S), rel=1e-6)
    back = ModelError.from_content(error.to_dict())
    assert back.to_dict() == error.to_dict()
    assert back.square == pytest.approx(error.square)
    assert str(ModelError(0.1, (0.0, 0.2), 0.05)) == "10 % of its response (5 % of S)"


def test_too_few_samples_before_a_dip_show_no_noise():
    event = played(noise=4e-3).event
    shorter = [
        replace(event, steady=slice(0, n))
        for n in (4 * WANDERING_COSINES, 4 * WANDERING_COSINES + 1)
    ]
    assert estimate_noise_variance(shorter[0]) == 0.0 < estimate_noise_variance(shorter[1])


def test_shares_are_told_to_two_digits():
    assert [format_percent(x) for x in (0.00571, 0.0567, 0.12345, 1.004, 12.3, np.inf)] == [
        "0.57 %",
        "5.7 %",
        "12 %",
        "100 %",
        "1230 %",
        "over 10000 %",
    ]


@pytest.fixture(scope="module")
def fit():
    t, U = study.Shape(0.5).voltage()
    rng = np.random.default_rng(3)
    dips = []
    for k, depth in enumerate((0.5, 0.3)):
        t, U = study.Shape(depth).voltage()
        power = study.printed(study.TYPICAL, t, U, 0.35) + 0.02 * (t > 0.85) * np.array(
            [[1.0], [0.0]]
        )
        dips.append(
            study.event(t, U, power + 0.002 * rng.standard_normal(power.shape), f"dip {k + 1}")
        )
    small = {
        "model": "third_order_exponential",
        "optimizer": "pso",
        "budget": 2000,
        "progress": False,
    }
    return tractexp.identify(dips[:1], validate=dips[1:], **small, check_intervals=False)


def test_result_json_and_the_headline_tell_it(fit, tmp_path):
    fit.write_results(tmp_path)
    told = json.loads((tmp_path / "result.json").read_text())["model_error"]
    assert [(e["name"], e["role"]) for e in told["events"]] == [
        ("dip 1", "train"),
        ("dip 2", "validate"),
    ]
    assert told["value"] == told["events"][0]["value"] == fit.model_error.value
    assert told["held_out"]["value"] == told["events"][1]["value"] == fit.model_error_held_out.value
    low, high = told["interval"]
    assert low <= told["value"] <= high
    assert f"within {format_percent(told['value'])} of its response" in fit.headline
    assert f"the held-out dips within {format_percent(told['held_out']['value'])}" in fit.headline
    assert ModelError.from_content(told) == fit.model_error


def test_a_small_reactive_power_is_told_where_its_error_is_divided_by_it(fit):
    assert fit.result.acceptance.endswith("holds")
    events = [e | {"Q_over_S": 0.12} for e in fit.result.events]
    small = replace(fit.result, events=events, epsilon_q=0.2)
    assert small.acceptance.endswith("does NOT hold (epsilon_q divides by Q alone, here 12 % of S)")
    large = replace(fit.result, epsilon_q=0.2)
    assert large.acceptance.endswith("does NOT hold")


def test_a_rival_structure_is_told_of_the_parameters_that_it_moves_by_more_than_they_scatter(fit):
    error, value = fit.result.standard_errors, fit.result.parameters
    near, far = value["M"] + 1.9 * error["M"], value["T_m"] - 2.1 * error["T_m"]
    rivals = [
        {
            "name": "zip",
            "objective_ratio": 1.0,
            "parameters": {"M": near, "T_m": value["T_m"] - 2.05 * error["T_m"]},
        },
        {"name": "second_cage", "objective_ratio": 0.9, "parameters": {"M": near, "T_m": far}},
    ]
    told = replace(fit, result=replace(fit.result, rival_structures=rivals))
    assert find_rival_moves(told) == {"T_m": ("second_cage", far)}
    assert describe_rivals(told) == [f"with second_cage, which fits as well: T_m {far:.4g}"]
    assert describe_rivals(fit) == []
