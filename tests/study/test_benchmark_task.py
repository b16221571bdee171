"""The benchmark on BBOB: ioh's own values and counts, known optima, running times worked out by
hand, refusals.
"""

import base64
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from command_line import run_command
from pages import read

from tractexp.extend import UserError, build
from tractexp.extend.search import Limits, search
from tractexp.studies.api.benchmark import BenchmarkResult
from tractexp.studies.bbob import page as report
from tractexp.studies.bbob import runs as bbob
from tractexp.studies.bbob.runs import (
    GROUPS,
    Bbob,
    BbobPlan,
    BbobRun,
    BbobRuns,
    compute_seed,
    perform,
    run,
)

TARGETS = tuple(10.0**k for k in range(2, -9, -1))
SMALL = BbobPlan((1,), (2,), (1,), 500, TARGETS, 0)


@pytest.fixture(scope="module")
def ioh():
    return pytest.importorskip("ioh", reason="the extra [benchmark] is not installed")


@pytest.fixture(scope="module")
def cma():
    return pytest.importorskip("cma", reason="the extra [benchmark] is not installed")


def optimizer(name="random_search", **settings):
    return build("optimizer", {"name": name, **settings})


@pytest.mark.parametrize("function", range(1, 25))
def test_a_problem_has_iohs_values_box_and_optimum(ioh, function):
    theirs = ioh.get_problem(function, 2, 4, ioh.ProblemClass.BBOB)
    ours = Bbob(function, 4, 2, TARGETS)
    x = np.random.default_rng(function).uniform(-5, 5, (20, 4))
    assert ours.objective(x).tolist() == [theirs(row.tolist()) for row in x]
    assert ours.objective(x[:1]).shape == (1,)
    assert (ours.lower == -5).all()
    assert (ours.upper == 5).all()
    assert ours.objective(np.array([theirs.optimum.x]))[0] == pytest.approx(ours.optimum, abs=1e-12)
    assert ours.is_solved


def test_the_groups_hold_every_function_once():
    assert [f for group in GROUPS.values() for f in group] == list(range(1, 25))


@pytest.mark.parametrize("name", ["issa", "pso", "differential_evolution", "random_search"])
def test_evaluations_are_those_that_ioh_counts(ioh, name):
    problem = Bbob(8, 3, 1, TARGETS)
    found = search(problem, optimizer(name), 0, Limits(simulations=777))
    assert problem.problem.state.evaluations == problem.evaluations == found.simulations == 777
    assert (
        problem.best
        == problem.problem.state.current_best_internal.y + problem.optimum
        == found.objective
    )


def test_a_target_is_met_at_the_evaluation_that_met_it_not_at_the_end_of_its_batch(ioh):
    problem = Bbob(1, 2, 1, (10.0, 1.0, 0.01, 1e-8))
    best = np.array(problem.problem.optimum.x)
    east = np.array([1.0, 0.0])
    # the sphere: 16, 0.81, 0.0025 above it
    far, near, nearer = best + 4 * east, best + 0.9 * east, best + 0.05 * east
    problem.objective(np.array([far, far]))
    assert np.isinf(problem.hits).all()
    problem.objective(np.array([far, near, far, nearer, near]))
    assert problem.hits.tolist() == [4, 4, 6, np.inf]
    problem.objective(np.array([near, best]))
    assert problem.hits.tolist() == [4, 4, 6, 9]
    assert problem.is_solved


def test_cmaes_reaches_the_known_optimum_of_the_sphere(ioh, cma):
    done = run("cmaes", optimizer("cmaes"), (1, 2, 1), SMALL)
    assert 0 <= done.distance <= 1e-8
    # within its last population of 6
    assert done.evaluations - 6 < done.hits[-1] <= done.evaluations < 1000
    assert list(done.hits) == sorted(done.hits)


def test_a_search_that_ends_is_started_anew_until_the_budget_is_spent(ioh):
    brief = optimizer("pso", iterations=3, population=10)
    done = run("pso", brief, (24, 2, 1), SMALL)
    assert done.evaluations == 1000
    assert done.searches == 25  # of 40 evaluations
    alone = Bbob(24, 2, 1, TARGETS)
    for restart in range(25):
        search(alone, brief, compute_seed(0, 24, 2, 1, restart))
    assert alone.best - alone.optimum == done.distance


def test_runs_are_the_same_on_any_number_of_processes_and_differ_by_seed(ioh):
    plan = BbobPlan((1, 15), (2,), (1, 2), 100, TARGETS, 3)
    tried = {name: optimizer(name) for name in ("pso", "random_search")}
    one, two = perform(tried, plan, 1), perform(tried, plan, 2)
    assert one.runs == two.runs
    assert [(r.optimizer, r.function, r.instance) for r in one.runs] == [
        (name, f, i) for name in tried for f in (1, 15) for i in (1, 2)
    ]
    other = perform(tried, BbobPlan((1, 15), (2,), (1, 2), 100, TARGETS, 4), 1)
    assert all(a.distance != b.distance for a, b in zip(one.runs, other.runs, strict=True))


@pytest.fixture
def by_hand():
    """Two optimizers on two functions and two instances, budget 100; `a` solves f1 always and f16
    once.
    """
    inf = float("inf")
    plan = BbobPlan((1, 16), (2,), (1, 2), 50, (1.0, 1e-8), 0)
    rows = [
        ("a", 1, 1, 30, (10.0, 30.0)),
        ("a", 1, 2, 50, (20.0, 50.0)),
        ("a", 16, 1, 80, (40.0, 80.0)),
        ("a", 16, 2, 100, (90.0, inf)),
        ("b", 1, 1, 100, (60.0, inf)),
        ("b", 1, 2, 100, (inf, inf)),
        ("b", 16, 1, 100, (inf, inf)),
        ("b", 16, 2, 100, (inf, inf)),
    ]
    runs = [BbobRun(name, f, 2, i, spent, 1, 0.5, hits) for name, f, i, spent, hits in rows]
    return BbobRuns(plan, ("a", "b"), {1: "Sphere", 16: "Weierstrass"}, runs)


def test_running_times_and_shares_are_those_worked_out_by_hand(by_hand):
    assert by_hand.ert("a", 2, 1, 1) == (40.0, 2)  # (30 + 50) / 2
    assert by_hand.ert("a", 2, 16, 1) == (180.0, 1)  # (80 + 100) / 1
    assert by_hand.ert("b", 2, 1, 0) == (160.0, 1)  # (60 + 100) / 1
    assert by_hand.ert("b", 2, 16, 0) == (float("inf"), 0)
    assert by_hand.share("a", 2, (1, 16)) == 7 / 8
    assert by_hand.share("b", 2, (1, 16)) == 1 / 8
    assert (by_hand.count_solved("a", 2), by_hand.count_solved("b", 2)) == (1, 0)
    assert by_hand.hits("a", 2, [16]).tolist() == [40.0, 80.0, 90.0, float("inf")]
    assert by_hand.groups() == {"separable": [1], "many valleys": [16]}


def test_page_and_json_hold_the_numbers_and_load_nothing_from_elsewhere(by_hand, tmp_path):
    result = BenchmarkResult(by_hand, {"a": {}, "b": {}})
    path = result.report().save(tmp_path / "benchmark.html")
    page = read(path)
    assert "Take a in dimension 2: it met most targets, 88% against 12% of b." in page.words
    # over all functions, and over each of two groups
    assert path.read_text().count('class="chart"') == 3
    for part in ("180 (1/2)", "160 (1/2)", "–", "88%", "12%", "f16 Weierstrass", "1 of 2"):
        assert part in page.words, part
    content = json.loads(result.write_results(tmp_path)[0].read_text())
    assert content["running_times"][1] == {
        "optimizer": "a",
        "dimension": 2,
        "function": 16,
        "ert": [65.0, 180.0],
    }
    assert content["running_times"][3]["ert"] == [None, None]
    assert content["runs"][3]["hits"] == [90.0, None]
    assert content["sentences"] == [
        "On BBOB in dimension 2, 2 runs of 100 evaluations on each function, a met 88% of the"
        " targets and solved 1"
        " of 2 functions; b met 12% of the targets and solved 0 of 2 functions."
    ]


def test_curves_are_drawn_where_no_target_was_met_at_all(tmp_path):
    plan = BbobPlan((1,), (2,), (1,), 50, (1e-8,), 0)
    nothing = BbobRuns(
        plan, ("a",), {1: "Sphere"}, [BbobRun("a", 1, 2, 1, 100, 1, 3.0, (float("inf"),))]
    )
    ((whole, each),) = report.draw_charts(nothing, 2).values()
    (curve,) = whole.plain()["data"]
    assert (np.frombuffer(base64.b64decode(curve["y"]["bdata"]), "<f4") == 0).all()
    assert each == []


def test_the_answer_tells_where_another_was_better(by_hand):
    runs = [
        replace(r, hits=(5.0, 6.0)) if (r.optimizer, r.function) == ("b", 16) else r
        for r in by_hand.runs
    ]
    told = report.answer(replace(by_hand, runs=runs), 2)
    assert told == (
        "Take a in dimension 2: it met most targets, 88% against 62% of b."
        " Another did better in a group of functions: many valleys (b 100%, a 75%)."
    )


def test_the_package_absent_is_told_with_its_pip_line(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "ioh", None)  # what makes an import fail
    with pytest.raises(
        UserError, match=r"'ioh', which is not installed: pip install 'tractexp\[benchmark\]'"
    ):
        Bbob(1, 2, 1, TARGETS)


def test_least_squares_are_told_that_there_are_no_residuals(ioh):
    with pytest.raises(UserError, match="no sum of squares"):
        run("multistart_least_squares", optimizer("multistart_least_squares"), (1, 2, 1), SMALL)


def test_an_optimizer_that_never_evaluates_is_refused_not_waited_for(ioh, monkeypatch):
    idle = optimizer("random_search")
    monkeypatch.setattr(type(idle), "search", lambda *_: iter(()))
    with pytest.raises(UserError, match="never called `evaluate`"):
        run("idle", idle, (1, 2, 1), SMALL)


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        (
            {"functions": [1, 25]},
            "task.functions=25 is out of range: it must be at least 1 and at most 24",
        ),
        ({"functions": []}, "task.functions is empty"),
        ({"functions": [3, 3]}, "task.functions names 3 twice"),
        ({"instances": [0]}, "task.instances=0 is out of range"),
        ({"dimensions": [1]}, "task.dimensions=1 is out of range: it must be at least 2"),
        ({"multiplier": 0}, "task.multiplier=0 is out of range"),
        ({"targets": [0.0]}, "task.targets=0.0 is out of range"),
        ({"against": ["cmeas"]}, "there is no optimizer 'cmeas'; did you mean 'cmaes'?"),
        ({"cores": 0}, "task.cores=0 is out of range"),
    ],
)
def test_a_setting_out_of_range_is_refused_in_one_sentence(settings, sentence):
    with pytest.raises(UserError, match=f"^{re.escape(sentence)}"):
        build("task", {"name": "benchmark", **settings})


TINY = (
    "task=benchmark",
    "task.functions=[1,15]",
    "task.dimensions=[2]",
    "task.instances=[1]",
    "task.multiplier=50",
    "task.cores=1",
    "tracking.enabled=false",
    "hydra.run.dir=run",
)


def test_the_task_runs_from_the_command_line(ioh, tmp_path):
    done = run_command(*TINY, "optimizer=issa_no_levy", "task.against=[pso]", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for part in (
        "issa_no_levy",
        "pso",
        " f1 ",
        " f15 ",
        "of 2",
        "benchmark.html",
        "benchmark.json",
    ):
        assert part in done.stdout, part
    content = json.loads((tmp_path / "run" / "benchmark.json").read_text())
    assert content["optimizers"]["issa_no_levy"]["levy"] is False
    assert [(r["optimizer"], r["function"], r["evaluations"]) for r in content["runs"]] == [
        ("issa_no_levy", 1, 100),
        ("issa_no_levy", 15, 100),
        ("pso", 1, 100),
        ("pso", 15, 100),
    ]
    assert "to see it" not in done.stdout


@pytest.mark.parametrize(
    ("extra", "sentence"),
    [
        ("budget=100", "budget=100 is not read by task=benchmark; set task.multiplier instead"),
        ("optimizer.polish=true", "optimizer issa polishes by least squares"),
    ],
)
def test_what_the_task_cannot_use_is_refused(ioh, tmp_path, extra, sentence):
    done = run_command(*TINY, "task.against=[]", extra, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(f"tractexp: {sentence}")
    assert not (tmp_path / "run").exists()


def test_ours_against_the_same_with_other_settings_has_a_name_of_its_own(ioh):
    from tractexp.api.job import Job

    task = build("task", {"name": "benchmark", "against": ["pso"]})
    config = {"optimizer": {"name": "pso", "population": 20}}
    assert list(task.optimizers(Job(config, {"optimizer": "pso"}, None))) == [
        "pso",
        "pso by default",
    ]
    assert list(
        task.optimizers(Job({"optimizer": {"name": "pso"}}, {"optimizer": "pso"}, None))
    ) == ["pso"]


def test_a_function_has_the_name_that_ioh_gives_it(ioh):
    assert Bbob(8, 2, 1, TARGETS).name == "Rosenbrock"
    assert bbob.import_package() is ioh
