"""The `estimate` and its grade: one answer whatever was searched with, silent on noise, outspoken
on what is missing.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
import uncertainty as study
from printed_events import one_dip, problem
from written_out import printed_dip

import tractexp
from tractexp.blocks import Table
from tractexp.identification import estimate as module
from tractexp.inference.least_squares import descend
from tractexp.report.fit_sentences import describe_search_end
from tractexp.report.fit_tables import tabulate_search_end

TRUTH = study.TYPICAL


def recorded(deviation=0.004, seed=5, correlation=0.0, depth=0.5, spoil=None, name="dip"):
    """An event of the printed equations with noise; `spoil` changes the clean power (2, N) at times
    t.
    """
    t, U = study.Shape(depth).voltage()
    power = printed_dip(depth, tuple(TRUTH), 0.35)
    if spoil is not None:
        power = spoil(t, power)
    return study.event(
        t, U, power + study.noise(np.random.default_rng(seed), len(t), deviation, correlation), name
    )


def stepped(size):
    """A load that is switched on 0.3 s after the dip: nothing of the model can do that."""

    def spoil(t, power):
        return power + size * (t > 0.85) * np.array([[1.0], [0.0]])

    return spoil


def identified(event, **settings):
    chosen = {
        "model": "third_order_exponential",
        "optimizer": "pso",
        "budget": 3000,
        "progress": False,
    }
    return tractexp.identify(event, **chosen | settings)


@pytest.fixture(scope="module")
def fit():
    return identified(recorded())


def test_the_estimate_does_not_depend_on_the_search(fit):
    others = [
        identified(recorded(), optimizer=name, seed=seed)
        for name, seed in (("ssa", 3), ("random_search", 1))
    ]
    for other in others:
        assert other.result.search["parameters"] != fit.result.search["parameters"]
        assert other.result.parameters == fit.result.parameters
        assert other.result.intervals == fit.result.intervals


def test_the_estimate_fits_no_worse_than_any_search_by_its_own_likelihood(fit):
    known = fit.details.uncertainty
    likelihood = known.likelihood
    ended = np.array([fit.result.search["parameters"][n] for n in known.names])
    rows = likelihood.rows(likelihood.to_unit(ended))[0]
    assert known.deviance <= rows @ rows


def test_result_json_tells_estimate_search_and_origin(fit, tmp_path):
    fit.write_results(tmp_path)
    told = json.loads((tmp_path / "result.json").read_text())
    assert (
        told["parameters"].keys() == told["intervals"].keys() == told["search"]["parameters"].keys()
    )
    assert set(told["search"]) >= {"objective", "epsilon_p", "epsilon_q", "simulations", "seconds"}
    assert told["search"]["objective"] == fit.end.objective
    assert told["adequacy"]["grade"] == "adequate"
    assert told["tractexp_version"]
    (record,) = told["records"]
    assert len(record["sha256"]) == 64
    assert told["starts"][0]["above"] == 0.0
    assert {start["from"] for start in told["starts"]} == {"box", "beside the best", "search"}


def test_result_and_page_hold_correlations_and_the_number_of_samples(fit, tmp_path):
    """As the fit reports that users know from elsewhere do."""
    known = json.loads(fit.result.write(tmp_path / "result.json").read_text())["uncertainty"]
    d = len(fit.details.uncertainty.names)
    assert known["names"] == list(fit.details.uncertainty.names)
    matrix = np.array(known["correlation"])
    assert matrix.shape == (d, d)
    assert np.diag(matrix) == pytest.approx(np.ones(d))
    (record,) = (fit.event.record for fit in fit.details.fits)
    compared = np.isfinite(record.P).sum() + np.isfinite(record.Q).sum()
    assert (known["samples"], known["parameters"]) == (compared, d)
    assert compared - d - 2 <= known["freedom"] <= compared - d  # P0 and Q0 may be estimated, too
    assert f"{compared} samples compared, {d} parameters searched" in repr(fit)
    table = next(
        b for b in fit.report().blocks if isinstance(b, Table) and b.columns[:1] == ["correlation"]
    )
    assert table.rows[1][1] == f"{matrix[1, 0]:+.3f}"


def test_the_end_of_a_search_and_the_estimate_stand_in_one_table_with_a_word_where_they_differ(fit):
    table = tabulate_search_end(fit)
    by_name = {row[0]: row for row in table.rows}
    assert by_name["objective"][1:3] == [fit.result.search["objective"], fit.result.objective]
    assert {n for n in fit.result.verdicts if by_name[n][4]} == {*fit.parameters.outside_interval}
    far = replace(
        fit.result,
        search=fit.result.search
        | {
            "objective": 2 * fit.result.objective,
            "parameters": {**fit.result.search["parameters"], "T_m": 10.0},
        },
    )
    away = replace(fit, result=far, behind=fit.behind)
    assert {row[0] for row in tabulate_search_end(away).rows if row[4]} >= {"T_m"}
    assert "T_m" in describe_search_end(away)
    assert "it stopped short of the minimum, at 2 times its objective" in describe_search_end(away)


def test_nothing_missing_is_graded_adequate_and_a_step_of_the_load_is_not():
    grades = [identified(recorded(seed=seed)).grade for seed in range(3)]
    assert grades == ["adequate"] * 3
    missing = identified(recorded(spoil=stepped(0.02)))
    assert missing.grade == "effect_missing"
    assert missing.result.adequacy["p"] < 1e-6
    assert "an effect is missing" in missing.headline
    assert "95 % interval" in missing.table().columns
    assert missing.advice[0] == "find the missing effect: tractexp.investigate(dips)"
    assert "interval" in repr(missing.parameters["M"])


def test_a_model_that_is_off_by_more_than_eq_20_allows_is_the_wrong_one():
    wrong = identified(recorded(), model="static_exponential")
    assert wrong.grade == "wrong_model"
    assert wrong.headline.startswith("this model does not describe this load: ")
    assert not any("further dip" in sentence or "T_m" in sentence for sentence in wrong.advice)


def test_noise_of_the_voltage_widens_the_intervals():
    clean = recorded(0.001)
    rng = np.random.default_rng(8)
    noisy = clean.record.U + 0.003 * rng.standard_normal(clean.record.samples)
    spoiled = study.event(clean.record.t, noisy, np.array([clean.record.P, clean.record.Q]))
    quiet, loud = (study.judged(problem([e]), TRUTH).uncertainty for e in (clean, spoiled))
    assert quiet.noise[0]["of_the_voltage"] == 0.0
    assert loud.noise[0]["of_the_voltage"] > 0.5
    assert (loud.half > quiet.half).all()
    assert (np.abs(loud.values - TRUTH) < 2 * loud.half).all()


def test_a_search_that_found_a_better_valley_leads_to_the_estimate(monkeypatch):
    """Where the box shows only a bad valley, the estimate comes from where the search ended."""
    case = one_dip(seed=77)
    whole = module.estimate_without_search(case).uncertainty

    def one_bad_start(likelihood, points):
        bad = likelihood.to_unit(TRUTH * np.array([1, 0.4, 0.45, 1, 1, 1, 0.5]))
        return descend(likelihood.rows, bad, np.ones_like(bad, dtype=bool))

    monkeypatch.setattr(module, "explore_minima", one_bad_start)
    monkeypatch.setattr(module, "place_along_least_certain", lambda likelihood, unit: unit[None])
    monkeypatch.setattr(module, "_remembered", type(module._remembered)())
    found = module.estimate(case, TRUTH)
    np.testing.assert_allclose(found.uncertainty.values, whole.values, rtol=1e-3)
    assert found.starts[0]["from"] in ("search", "beside the best")
