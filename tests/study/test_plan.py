"""Plans: what `forecast_intervals` says is what the record then gives, deeper tells more, and
`choose_best_events` are the best.
"""

import itertools
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import uncertainty as study
from command_line import run_command
from pages import charts, read, unpacked
from screens import LINES, count_rows
from written_out import printed_dip

import tractexp as public
from tractexp.errors import UserError
from tractexp.identification.plan import (
    DipShape,
    add_information,
    choose_best_events,
    compute_event_informations,
    find_depth_needed,
    forecast_intervals,
    forecast_over_depth,
)
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.problem import Problem
from tractexp.report.plan import list_marks

SHAPE = DipShape(depth=0.4, duration=0.2, rate=500.0, noise_P=0.004, noise_Q=0.004, P0=1.0, Q0=1.0)


def recorded(depth, deviation=0.004, seed=5, name="dip"):
    t, U = study.Shape(depth).voltage()
    clean = printed_dip(depth, tuple(study.TYPICAL), 0.35)
    return study.event(
        t, U, clean + study.noise(np.random.default_rng(seed), len(t), deviation, 0.0), name
    )


@pytest.fixture(scope="module")
def problem():
    return Problem(study.model(), [recorded(0.4)])


def test_the_forecast_is_what_the_record_then_gives(problem):
    known = study.judged(problem, study.TYPICAL).uncertainty
    event = problem.events[0]
    shape = replace(
        DipShape.from_event(event), duration=0.2, noise_P=0.004, noise_Q=0.004, memory=0.0
    )
    planned = forecast_intervals(problem, study.TYPICAL, shape)
    # The plan's trapezoid has edges of 20 ms, the record's of 30 ms; q_v and C are at other
    # estimates.
    np.testing.assert_allclose(planned.half[[0, 3, 4, 5]], known.half[[0, 3, 4, 5]], rtol=0.25)


def test_deeper_longer_faster_and_quieter_tell_more(problem):
    def half(**changes):
        return forecast_intervals(problem, study.TYPICAL, replace(SHAPE, **changes)).half

    assert (half(depth=0.5) < half(depth=0.2)).all()
    assert (half(rate=1000.0) < half(rate=250.0)).all()
    np.testing.assert_allclose(half(noise_P=0.008, noise_Q=0.008), 2 * half(), rtol=1e-6)
    assert (half(memory=0.01)[[0, 3, 4, 5]] > half()[[0, 3, 4, 5]]).all()


def test_the_depth_needed_gives_just_the_precision_asked_for(problem):
    needed = find_depth_needed(forecast_over_depth(problem, study.TYPICAL, SHAPE), "H", 0.01)
    at = forecast_intervals(problem, study.TYPICAL, replace(SHAPE, depth=needed.depth))
    assert at.relative[study.NAMES.index("M")] == pytest.approx(0.01, rel=0.03)
    assert str(needed) == f"a dip of {100 * needed.depth:.0f} % gives H within 1 %"


def test_what_no_dip_can_give_is_said_with_the_best_there_is(problem):
    forecasts = forecast_over_depth(
        problem, study.TYPICAL, replace(SHAPE, noise_P=0.05, noise_Q=0.05)
    )
    needed = find_depth_needed(forecasts, "q_v", 0.01)
    assert needed.depth is None
    assert "no dip of this kind gives q_v within 1 %: the best, of" in str(needed)


def test_the_best_two_events_are_those_of_all_pairs():
    depths = (0.1, 0.5, 0.25, 0.6)
    archive = Problem(
        study.model(), [recorded(d, seed=k, name=f"{d:g}") for k, d in enumerate(depths)]
    )
    chosen = choose_best_events(archive, study.TYPICAL, least=0.0, most=2)
    informations = compute_event_informations(archive, study.TYPICAL)
    pairs = itertools.combinations(range(4), 2)
    J = {pair: add_information([informations[e] for e in pair]).J for pair in pairs}
    volumes = {pair: np.linalg.slogdet(rows.T @ rows)[1] for pair, rows in J.items()}
    assert {c.event for c in chosen} == set(max(volumes, key=volumes.get))
    assert choose_best_events(archive, study.TYPICAL, least=0.0)[-1].name == "0.1"
    everything = choose_best_events(archive, study.TYPICAL, least=0.0)
    assert len(everything) == 4
    assert all(a.gain >= b.gain for a, b in itertools.pairwise(everything))
    stopped = choose_best_events(archive, study.TYPICAL, least=everything[2].gain + 1e-6)
    assert [c.event for c in stopped] == [c.event for c in everything[:2]]


def test_a_plan_stands_on_the_numbers_of_the_identification():
    """Estimate and noise are those of `identify`, and so is what the recorded dip is
    said to tell.
    """
    fit = public.identify(
        recorded(0.4),
        model="third_order_exponential",
        optimizer="pso",
        budget=2000,
        frequency_swing=0.0,
        unbalance=0.0,
        progress=False,
    )
    planned = public.plan(recorded(0.4), model="third_order_exponential", parameter="M")
    assert fit.grade == "adequate"
    for name, value in planned.content["parameters"].items():
        assert value == fit.parameters[name].value
    rows = planned.content["half_intervals"]["depth"]
    there = min(rows, key=lambda row: abs(row["at"] - 0.4))
    for name in ("T_prime", "M", "T_m", "p_v"):  # the plan's edges are straight and shorter
        low, high = fit.parameters[name].interval
        assert there[name] == pytest.approx((high - low) / 2 / fit.parameters[name].value, rel=0.3)


def test_shapes_that_cannot_be_recorded_are_refused():
    for changes, sentence in (
        (
            {"depth": 0.99},
            "task.depth=0.99 is out of range: it must be at least 0.03 and at most 0.95",
        ),
        ({"rate": 1.0}, "task.duration=0.2 is out of range"),
        ({"noise_P": 0.0}, "the records show no noise before the dip.*give it as task.noise"),
        ({"noise_P": float("nan")}, "the records show no noise before the dip"),
    ):
        with pytest.raises(UserError, match=sentence):
            replace(SHAPE, **changes).check()


def test_marks_of_a_logarithmic_axis_are_few_and_round():
    assert list_marks(0.3, 250.0) == [0.1, 1.0, 10.0, 100.0, 1000.0]
    assert list_marks(0.9, 12.0) == [
        0.1,
        0.2,
        0.5,
        1.0,
        2.0,
        5.0,
        10.0,
        20.0,
        50.0,
        100.0,
        200.0,
        500.0,
    ]


def plan_command(*arguments, cwd):
    return run_command("tracking.enabled=false", *arguments, cwd=cwd, COLUMNS="160")


def test_the_plan_task_answers_with_a_number_and_a_figure(tmp_path):
    done = plan_command(
        "task=plan", "task.parameter=M", "task.within=0.1", "hydra.run.dir=run", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    content = json.loads((tmp_path / "run" / "plan.json").read_text())
    assert 0.05 < content["depth_needed"] < 0.5
    assert done.stdout.startswith(f"how deep? {content['answer']}\n")
    assert "next: until then, what these dips tell: tractexp task=profile" in done.stdout
    assert len(count_rows(done.stdout)) <= LINES
    assert not list((tmp_path / "run").glob("*.svg"))
    scans = {"depth", "duration [s]", "samples per second", "noise, of P before the dip"}
    assert set(content["half_intervals"]) == scans
    page = read(tmp_path / "run" / "plan.html")
    assert page.tags.count("svg") == 0
    assert page.tags.count("table") == 1 + len(scans)
    first, *others = charts((tmp_path / "run" / "plan.html").read_text(encoding="utf-8"))
    assert len(others) == len(scans) - 1
    (curve,) = [trace for trace in first["data"] if trace["name"] == "M"]
    told = [100 * row["M"] for row in content["half_intervals"]["depth"]]
    np.testing.assert_allclose(unpacked(curve["y"]), told, rtol=1e-6)
    level, edge = first["layout"]["shapes"]
    assert (level["y0"], edge["x0"]) == (10.0, pytest.approx(100 * content["depth_needed"]))
    assert first["layout"]["yaxis"]["ticktext"][:3] == ["1", "10", "100"]
    axes = {c["layout"]["xaxis"]["title"]["text"]: c["layout"]["xaxis"] for c in others}
    assert axes["samples per second"]["ticktext"] == ["25", "50", "100", "200", "500", "1000"]
    assert [c["layout"]["showlegend"] for c in (first, *others)] == [True, False, False, False]
    answer = f"{content['answer'][0].upper()}{content['answer'][1:]}."
    for part in (
        answer,
        "How deep must a dip be for M to be known within ± 10 %?",
        "the estimate of tibet_50pct, though more than noise is left there",
        "inertia constant M omega_s / 2",
        "kinetic energy at synchronous speed",
        "transient reactance on the record's base",
        *scans,
    ):
        assert part in page.words


def test_the_page_of_a_plan_ranks_the_archive(tmp_path):
    shipped = ",".join(f"pkg://tractexp.data/tibet_{depth}pct.csv" for depth in (30, 50, 65))
    arguments = (
        "data=csv",
        f"data.train=[{shipped}]",
        "task.within=1e-4",
        "task.least=0.3",
        "model.fixed.q_v=3",
    )
    done = plan_command(
        "task=plan", "task.values=default", *arguments, "hydra.run.dir=run", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    content, page = (
        json.loads((tmp_path / "run" / "plan.json").read_text()),
        read(tmp_path / "run" / "plan.html"),
    )
    assert content["depth_needed"] is None
    assert 0 < len(content["best_events"]) < 3
    assert page.tags.count("table") == 6
    for part in (
        "No dip of this kind gives H within 0.01 %",
        "for H, which is known as well as M, to be known",
        "the model's default values",
        "fixed",
        "the next would narrow them by less than 30%.",
        *(event["name"] for event in content["best_events"]),
    ):
        assert part in page.words


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (
            ["task.parameter=X_prim"],
            "task.parameter=X_prim is not a free parameter; did you mean 'X_prime'?",
        ),
        (["task.depth=0.99"], "task.depth=0.99 is out of range"),
        (["task.within=0"], "task.within=0.0 is out of range"),
        (["task.values=nowhere.json"], "there is no result file nowhere.json"),
    ],
)
def test_the_plan_task_refuses_bad_input_in_one_sentence(arguments, sentence, tmp_path):
    done = plan_command("task=plan", *arguments, "hydra.run.dir=run", cwd=tmp_path)
    assert done.returncode != 0
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1, done.stderr


def test_a_dip_in_which_the_model_diverges_tells_nothing(problem, monkeypatch):
    """A motor that stalls: sensitivities beyond all numbers overflow nowhere, and add nothing to
    what is known.
    """
    (known,) = compute_event_informations(problem, study.TYPICAL)
    computed = Likelihood.jacobian

    def diverging(self, unit):
        rows, J = computed(self, unit)
        return rows, replace(J, columns=J.columns * 1e200)

    monkeypatch.setattr(Likelihood, "jacobian", diverging)
    planned = forecast_intervals(problem, study.TYPICAL, SHAPE, known)
    alone = forecast_intervals(problem, study.TYPICAL, SHAPE)
    monkeypatch.undo()
    assert planned.half == pytest.approx(
        add_information([known]).standard_errors * planned.half[0] / known.standard_errors[0]
    )
    assert not np.isfinite(alone.half).any()


def test_what_a_model_misses_makes_a_plan_promise_less(problem):
    """Every interval grows alike; where the model's error is all there is, to sample faster tells
    no more.
    """

    def half(**changes):
        return forecast_intervals(problem, study.TYPICAL, replace(SHAPE, **changes)).half

    grown = half(error=0.05) / half()
    assert grown.min() > 1.5
    np.testing.assert_allclose(grown, grown[0], rtol=1e-6)
    np.testing.assert_allclose(half(error=0.8, rate=1000.0), half(error=0.8), rtol=0.1)
    np.testing.assert_allclose(half(error=0.8), 2 * half(error=0.4), rtol=0.02)


def test_a_plan_says_what_the_model_missed_of_the_record_it_is_planned_at():
    """Of a load that the model does not have the estimate misses something, and the plan counts
    it.
    """
    folder = Path(public.__file__).parent / "data"
    dips = public.read(folder / "contactors_50pct.csv")
    planned = public.plan(dips, parameter="M")
    assert re.search(r"a model that misses [\d.]+ % of its response", planned.content["dip"])
    exact = public.plan(dips, parameter="M", values="default")
    assert "misses" not in exact.content["dip"]
