"""A load that no formula describes exactly: `investigate` names by what sets predict of held-out
events, `predict_held_out`, and tells what is left.
"""

import json
from dataclasses import replace
from html import unescape

import numpy as np
import pytest
from conftest import MOTOR

import tractexp
from tractexp.blocks import Report
from tractexp.discrepancy.investigate import _complete_row as complete_row
from tractexp.discrepancy.precision import compute_standard_errors
from tractexp.discrepancy.prediction import SHARING, predict_held_out
from tractexp.identification.verdict import UNIDENTIFIED
from tractexp.report.predicted import add_prediction_section

SAMPLES, STEP = 200, 4e-3
RESISTANCE = "stator_resistance"
EFFECTS = (RESISTANCE, "dc_link_lag")


def dips(depths=(0.5, 0.35, 0.6), R_s=0.05, swing=0.03):
    """Dips of a motor with a stator resistance and, unknown to all, a power that swings after each
    dip, as a share of its depth.
    """
    rng, made = np.random.default_rng(11), []
    load = tractexp.compose(effects=[RESISTANCE])
    t = np.arange(SAMPLES) * STEP
    shape = np.clip((t - 0.1) / 0.02, 0, 1) - np.clip((t - 0.25) / 0.02, 0, 1)
    since = np.maximum(t - 0.1, 0)
    for k, depth in enumerate(depths):
        U = 1 - depth * shape
        bus = tractexp.read(t=t, U=U, P=np.ones(SAMPLES), Q=0.6 * np.ones(SAMPLES))
        response = tractexp.simulate(load, MOTOR | {"R_s": R_s}, records=bus).responses[0]
        unknown = swing * depth * np.sin(2 * np.pi * 3.1 * since) * np.exp(-since / 0.5)
        noise = 2e-4 * rng.standard_normal((2, SAMPLES))
        P, Q = np.array([response.P, response.Q]) + unknown + noise
        made += tractexp.read(t=t, U=U, P=P, Q=Q, name=f"dip{k + 1}")
    return made


@pytest.fixture(scope="module")
def found():
    """Of two dips and one held out; the swing is a hundred and fifty times the noise."""
    made = dips()
    return tractexp.investigate(made[:2], validate=made[2:], effects=EFFECTS, progress=False)


@pytest.fixture(scope="module")
def alone():
    """The identification of the base model from the two dips that are fitted."""
    return tractexp.identify(dips()[:2], progress=False)


def test_a_name_that_leaves_more_than_noise_is_named_and_what_it_leaves_is_told(found):
    assert (found.verdict, found.names, found.complete) == ("named", (RESISTANCE,), False)
    assert "the held-out events were used to choose" in found.reason
    assert found.reason.endswith("; each event, left out in turn, confirms it")
    assert found.gap.validate.closed > 0.95
    assert found.content["remainder"]["of_names"]
    assert f"beside {RESISTANCE} this is left" in str(found)


def test_its_size_is_right_though_the_model_is_not_exact(found):
    assert found.fit.parameters["R_s"].value == pytest.approx(0.05, rel=0.02)


def test_all_is_told_by_the_noise_of_the_records(found):
    """Fits are by least squares, under which the noise is as large as what they leave: nothing
    would stand out.
    """
    assert found.gap.train.before.chi2_per_sample > 100
    assert found.gap.validate.after.chi2_per_sample > 2
    assert "times as loud as the noise" in found.content["adequacy"]["sentence"]
    assert found.content["remainder"]["p"] < 1e-6


def test_the_base_model_is_as_it_is_identified(found, alone):
    assert found.gap.train.before.model_error["value"] == pytest.approx(
        alone.model_error.value, rel=0.03
    )


def test_the_powers_before_events_are_those_measured(found):
    base, at = found.steps.evidence.base, found.steps.context.coordinates
    assert (base.fit.unit[at.before] == 0.5).all()


def test_leads_are_told_by_blocks_that_share_the_response(found):
    """A dip of 0.15 s in 0.7 s has two of the seven blocks of a tenth of a second, and fourteen of
    20 ms.
    """
    response = found.steps.evidence.base.prediction.response
    assert len(response) == 35
    assert response.sum() ** 2 >= SHARING * np.sum(response**2)


def test_errors_are_wider_where_residuals_are_correlated(found):
    """By blocks left out in turn, against those of residuals that are independent."""
    tests, noise = found.steps.tests, found.steps.evidence.noise
    independent = replace(tests, robust=tests.tangent.build_score_test(noise).R)
    wide, narrow = compute_standard_errors(tests), compute_standard_errors(independent)
    assert np.median([wide[name] / narrow[name] for name in wide]) > 1.5


def test_no_set_is_fitted_by_least_squares_where_none_could_be_named(found):
    """The table of the search by likelihood stands then: it tells what the fitted events say."""
    explained = found.steps.explanations
    context = explained.base.context
    strict = replace(context, criteria=replace(context.criteria, divides=1e6))
    none = replace(explained, base=replace(explained.base, context=strict))
    begun = context.effort.simulations
    assert predict_held_out(none, found.steps.grader, 0) is None
    assert context.effort.simulations - begun < 20_000


def test_a_size_that_is_known_no_better_than_its_bounds_is_told(found):
    assert found.steps.open_sizes == ()
    blind = replace(found.steps)
    vars(blind)["final_estimates"] = [
        replace(e, verdict=UNIDENTIFIED) if e.parameter.name == "R_s" else e
        for e in found.steps.final_estimates
    ]
    assert blind.open_sizes == ("of R_s the events know no more than the bounds",)


def test_an_effect_whose_size_rests_on_a_bound_is_a_candidate(found, monkeypatch):
    monkeypatch.setattr("tractexp.discrepancy.findings.list_at_bound", lambda *_: ["R_s", "T_m"])
    (told,) = replace(found.steps).open_sizes
    assert told.startswith("R_s rests on its bound, 0.0")
    again = complete_row(replace(found.steps), found.steps.withheld)
    assert again.verdict.word == "candidate"
    assert again.reason.endswith(f"{told}: so it is no name")


def test_the_files_say_what_is_left(found, tmp_path):
    found.write(tmp_path)
    made = json.loads((tmp_path / "discrepancy.json").read_text())
    assert (made["verdict"], made["complete"], made["effects"]) == ("named", False, [RESISTANCE])
    left, gap = made["remainder"], made["gap"]["validate"]
    assert left["model_error"]["value"] == pytest.approx(gap["after"]["model_error"]["value"])
    before, after = (gap[stage]["model_error"]["value"] for stage in ("before", "after"))
    assert gap["closed"] == pytest.approx(1 - (after / before) ** 2, abs=1e-3)
    assert left["share"] == pytest.approx(1 - gap["closed"])
    assert [step["effects"] for step in made["contributions"]] == [[], [RESISTANCE]]
    assert left["best_term"]["words"] in made["reason"]
    extended = (tmp_path / "conf" / "model" / "extended.yaml").read_text()
    assert "Something is missing still" in extended
    assert (tmp_path / "unexplained.csv").exists()
    assert "What is left" in (tmp_path / "discrepancy.html").read_text()


def test_what_chose_is_not_told_as_held_out(found):
    page = found.report().html
    assert "The held-out events took part in choosing: what they say is no test of it." in page
    assert "model error, not fitted" in page
    assert "model error, held out" not in page


def candidates_on_the_page(steps, tmp_path):
    page = Report("candidates", "")
    add_prediction_section(page, steps)
    return unescape(page.save(tmp_path / "page.html").read_text(encoding="utf-8"))


def test_the_page_shows_what_is_named_however_many_leave_less(found, tmp_path, monkeypatch):
    monkeypatch.setattr("tractexp.report.predicted.MOST_SHOWN_SETS", 0)
    shown = candidates_on_the_page(found.steps, tmp_path)
    assert RESISTANCE in shown
    assert "the base model" in shown
    assert "dc_link_lag" not in shown
    assert "the best term of the library" in shown
    assert found.content["remainder"]["best_term"]["words"] in shown


def test_the_page_has_no_chart_where_all_sets_diverge(found, tmp_path):
    base = found.steps.evidence.base
    nothing = replace(base.prediction, squares=np.full_like(base.prediction.squares, np.inf))
    lost = replace(base, prediction=nothing)
    evidence = replace(found.steps.evidence, base=lost, rows=(), others=(), term=None)
    shown = candidates_on_the_page(replace(found.steps, evidence=evidence), tmp_path)
    assert "No set has a steady state and survives the held-out events." in shown


@pytest.mark.long
@pytest.mark.usefixtures("no_proposal")
def test_where_nothing_predicts_the_nearest_is_told_by_least_squares():
    """The resistance is not among the effects that are tried."""
    made = dips()
    none = tractexp.investigate(
        made[:2], validate=made[2:], effects=["dc_link_lag"], progress=False
    )
    assert none.verdict == "unexplained"
    assert "a name must divide that by 2.25" in none.reason
    gap = none.content["nearest"]["gap"]["validate"]
    before, after = (gap[stage]["model_error"]["value"] for stage in ("before", "after"))
    told = "{:.2g} % of the response there, where the base model misses {:.2g} %"
    assert told.format(100 * after, 100 * before) in none.reason
    assert 1 - (after / before) ** 2 == pytest.approx(gap["closed"], abs=1e-3)


@pytest.mark.long
def test_what_is_less_than_matters_is_not_missing_though_noise_leaves_less():
    """A swing of fifty times the noise beside nothing else."""
    made = dips(R_s=0.0, swing=0.01)
    none = tractexp.investigate(
        made[:2], validate=made[2:], effects=["dc_link_lag"], progress=False
    )
    assert none.verdict == "none", none.reason
    assert none.steps.evidence.base.p_left < 1e-3
    assert "of the held-out ones: more than noise, but no effect is sought in less than 1%" in (
        none.reason
    )


@pytest.mark.long
def test_without_held_out_events_nothing_incomplete_is_named():
    none = tractexp.investigate(dips((0.5, 0.35)), effects=EFFECTS, progress=False)
    assert (none.verdict, none.complete) == ("unexplained", False)
