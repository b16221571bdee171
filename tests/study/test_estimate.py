"""The estimate and its grade, `estimate` and `grade_errors`: one answer whatever was searched with,
silent on noise, outspoken on what is missing.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
import uncertainty as study
from written_out import dense, printed_dip

import tractexp
from tractexp.blocks import Table
from tractexp.identification import adequacy
from tractexp.identification.adequacy import Grade, Surprise, grade_errors
from tractexp.identification.estimate import estimate, estimate_without_search
from tractexp.inference import goodness_of_fit
from tractexp.inference.least_squares import Descent
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.model_error import ModelError
from tractexp.inference.multistart import distinct
from tractexp.inference.observed import Observed
from tractexp.inference.problem import Problem
from tractexp.noise import Noise
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


def test_equal_numbers_have_equal_digests_and_others_have_not():
    from tractexp.cache.provenance import hash_record

    one, two = recorded().record, recorded(seed=6).record
    assert hash_record(one) == hash_record(replace(one, name="renamed"))
    assert hash_record(one) != hash_record(two)


def test_a_commit_is_that_of_the_package_not_of_the_folder_one_stands_in(tmp_path, monkeypatch):
    import subprocess

    from tractexp.cache.provenance import find_commit

    subprocess.run(["git", "init", "-q", str(tmp_path)], check=True)
    assert find_commit(tmp_path) == ""  # a repository that does not keep these files
    monkeypatch.chdir(tmp_path)
    find_commit.cache_clear()
    here = find_commit()
    assert here == "" or len(here.removesuffix("-dirty")) == 40


def test_nothing_missing_is_graded_adequate_and_a_step_of_the_load_is_not():
    grades = [identified(recorded(seed=seed)).grade for seed in range(6)]
    assert grades == ["adequate"] * 6
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


def test_two_dips_whose_loads_differ_are_told_by_parameters_of_each_event():
    """Two dips of one load whose shaft torque was 15 % higher the second time, and twice of the
    same load.
    """
    t, U = study.Shape(0.5).voltage()
    changed = TRUTH * np.where(np.array(study.model().names) == "T_m", 1.15, 1.0)
    pushed = []
    for second in (changed, TRUTH):
        rng = np.random.default_rng(4)
        events = [
            study.event(
                t, U, study.printed(truth, t, U, 0.35) + study.noise(rng, len(t), 0.002, 0.0), name
            )
            for truth, name in ((TRUTH, "first"), (second, "second"))
        ]
        pushed.append(estimate_without_search(Problem(study.model(), events)).surprise)
    assert (pushed[0].loudest, pushed[0].p < 1e-6) == (adequacy.PER_EVENT, True)
    assert pushed[1].p > goodness_of_fit.ADEQUATE_P


def test_what_is_judged_is_the_estimate_against_all_draws(fit, monkeypatch):
    known, judged = fit.details.uncertainty, []

    def count_draws(draws, value, scale=None):
        judged.append((len(draws), len(value)))
        return 1.0

    monkeypatch.setattr(goodness_of_fit, "tail", count_draws)
    adequacy.surprise(Observed.from_problem(known.likelihood.problem), known.likelihood, known.unit)
    assert {*judged} == {(adequacy.FIT_DRAWS, 1)}


def test_p_of_noise_alone_is_no_smaller_than_it_says():
    """60 judgements of noise drawn anew: one in ten below 0.1, give or take."""
    observed = Observed.from_problem(Problem(study.model(), [recorded()]))
    known = estimate_without_search(observed.problem).uncertainty
    clean = known.likelihood.residuals(known.unit[None])[0] + observed.drive.measurements
    rng, p = np.random.default_rng(2), []
    for _ in range(60):
        drive = replace(
            observed.drive, measurements=clean + 0.004 * rng.standard_normal(clean.shape)
        )
        problem = observed.problem.driven_by(observed.problem.events)
        problem.drive = drive
        again = replace(known.likelihood, problem=problem)
        p.append(adequacy.surprise(replace(observed, problem=problem), again, known.unit).p)
    assert 0.0 <= np.mean(np.array(p) < 0.1) < 0.25
    assert min(p) > goodness_of_fit.ADEQUATE_P


def test_the_thresholds_of_the_grades_are_where_they_are_said_to_be():
    """Loosened, each of these would give another grade."""
    small, large = (ModelError(e, (0.9 * e, 1.1 * e), 0.1 * e) for e in (0.19, 0.21))
    seen, unseen = Surprise(0.0009, "", 2.0, "P"), Surprise(0.0011, "", 2.0, "P")
    assert grade_errors(unseen, small).grade is Grade.ADEQUATE
    assert grade_errors(seen, small).grade is Grade.EFFECT_MISSING
    assert grade_errors(seen, large).grade is Grade.WRONG_MODEL
    assert grade_errors(seen, small, large).grade is Grade.WRONG_MODEL
    assert grade_errors(Surprise(None, "", None, ""), small).grade is Grade.EFFECT_MISSING
    # where noise leaves as much, a held-out dip must be off by more than chance
    assert grade_errors(unseen, small, large).grade is Grade.ADEQUATE
    assert (
        grade_errors(unseen, small, ModelError(0.3, (0.21, 0.4), 0.03)).grade is Grade.WRONG_MODEL
    )


def test_a_headline_tells_the_size_and_the_bounds_that_hold_a_parameter():
    error = ModelError(0.0567, (0.05, 0.06), 0.0078)
    told = grade_errors(
        Surprise(0.0009, "", 2.0, "P of dip"),
        error,
        ModelError(0.074, (0.07, 0.08), 0.011),
        ["T_m at 1"],
    )
    assert told.sentence == (
        "the model describes this load within 5.7 % of its response (0.78 % of S), the held-out"
        " dips within 7.4 % of"
        " its response (1.1 % of S); an effect is missing, P of dip is 2 times as loud as the"
        " noise; a bound holds"
        " T_m at 1"
    )


def test_of_held_out_dips_a_headline_does_not_say_that_noise_alone_leaves_as_much():
    small, chance = ModelError(0.01, (0.0, 0.02), 0.001), Surprise(0.5, "", 1.0, "P of dip")
    assert grade_errors(chance, small).sentence.endswith(": noise alone leaves as much")
    told = grade_errors(chance, small, ModelError(0.05, (0.03, 0.07), 0.01)).sentence
    assert told.endswith("(1 % of S): noise alone leaves as much of the fitted dips")


def test_correlated_noise_of_p_and_q_is_seen_and_used():
    t, U = study.Shape(0.5).voltage()
    rng = np.random.default_rng(4)
    common = 0.004 * rng.standard_normal(len(t))
    power = study.printed(TRUTH, t, U, 0.35) + common * np.array([[1.0], [0.8]])
    power += 0.0005 * rng.standard_normal(power.shape)
    known = estimate_without_search(Problem(study.model(), [study.event(t, U, power)])).uncertainty
    assert known.noise[0]["between_P_and_Q"] > 0.95
    apart = Likelihood.from_problem(known.likelihood.problem, Noise.white(0.004, 0.0032))
    J = dense(apart.jacobian(known.unit)[1])
    loose = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))[: apart.free] * (known.upper - known.lower)
    assert (known.information.standard_errors < loose).all()
    assert np.median(known.information.standard_errors / loose) < 0.6


def test_noise_of_the_voltage_widens_the_intervals():
    clean = recorded(0.001)
    rng = np.random.default_rng(8)
    noisy = clean.record.U + 0.003 * rng.standard_normal(clean.record.samples)
    spoiled = study.event(clean.record.t, noisy, np.array([clean.record.P, clean.record.Q]))
    quiet, loud = (
        estimate_without_search(Problem(study.model(), [e])).uncertainty for e in (clean, spoiled)
    )
    assert quiet.noise[0]["of_the_voltage"] == 0.0
    assert loud.noise[0]["of_the_voltage"] > 0.5
    assert (loud.half > quiet.half).all()
    assert (np.abs(loud.values - TRUTH) < 2 * loud.half).all()


def test_valleys_are_told_apart_and_the_best_comes_first():
    unit = np.array([[0.1, 0.1], [0.12, 0.1], [0.9, 0.9]])
    ends = Descent(unit, np.array([5.0, 4.0, 3.0]), 0)
    np.testing.assert_array_equal(distinct(ends, 2), unit[[2, 1]])


def test_a_search_that_found_a_better_valley_leads_to_the_estimate(monkeypatch):
    """Where the box shows only a bad valley, the estimate comes from where the search ended."""
    from tractexp.identification import estimate as module

    problem = Problem(study.model(), [recorded(seed=77)])
    whole = estimate_without_search(problem).uncertainty

    def one_bad_start(likelihood, points):
        from tractexp.inference.least_squares import descend

        bad = likelihood.to_unit(TRUTH * np.array([1, 0.4, 0.45, 1, 1, 1, 0.5]))
        return descend(likelihood.rows, bad, np.ones_like(bad, dtype=bool))

    monkeypatch.setattr(module, "explore_minima", one_bad_start)
    monkeypatch.setattr(module, "along_least_certain", lambda likelihood, unit: unit[None])
    monkeypatch.setattr(module, "_remembered", type(module._remembered)())
    found = estimate(problem, TRUTH)
    np.testing.assert_allclose(found.uncertainty.values, whole.values, rtol=1e-3)
    assert found.starts[0]["from"] in ("search", "beside the best")


def test_a_model_that_takes_its_error_for_slow_noise_is_found_out_by_least_squares():
    """Had least squares left half as much, the likelihood would give up far more of Eq. (8) than it
    does on draws.
    """
    fit = estimate_without_search(Problem(study.model(), [recorded()]))
    known, likelihood = fit.uncertainty, fit.uncertainty.of_noise
    squares = Likelihood.of_squares(likelihood.problem, 0.004)
    rows = squares.with_initial_power.rows(known.unit[None])[0]
    least = float(rows @ rows)
    observed = Observed.from_problem(likelihood.problem)
    agree = adequacy.surprise(observed, likelihood, known.unit, squares, least)
    apart = adequacy.surprise(observed, likelihood, known.unit, squares, least / 2)
    assert agree.p > goodness_of_fit.ADEQUATE_P
    assert (apart.loudest, apart.p < goodness_of_fit.ADEQUATE_P) == (adequacy.APART, True)


def test_a_quiet_start_of_a_record_tells_the_noise_of_one_whose_end_is_louder():
    from tractexp.noise.quiet import louder

    rng = np.random.default_rng(1)
    calm, same, loud = 0.001 * rng.standard_normal((3, 200))
    assert not louder([same], [calm])
    assert louder([2 * loud], [calm])
    # colored alike: few samples tell, and ends may differ by chance
    slow = study.noise(rng, 4000, 0.001, 0.95)
    wrong = [
        louder([row[a : a + 200]], [row[a + 400 : a + 600]])
        for row in slow
        for a in range(0, 3200, 200)
    ]
    assert np.mean(wrong) < 0.1
