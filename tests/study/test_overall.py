"""Comparisons on several problems: planted effects and ranks, on records and on BBOB; the end of a
sweep.
"""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from test_compare import (
    SEEDS,
    SWITCHES,
    TARGETS,
    ablation_runs,
    compare_command,
    samples,
    subsets,
    write_sweep,
)

from tractexp.errors import UserError
from tractexp.studies.bbob.runs import BbobPlan, BbobRun, BbobRuns
from tractexp.studies.comparison import judging, overall_claims
from tractexp.studies.comparison.ablation import VariantFamily
from tractexp.studies.comparison.comparison import _find_median
from tractexp.studies.comparison.load import _refuse_unreadable
from tractexp.studies.comparison.overall import rank_on_functions
from tractexp.studies.comparison.runs import part_runs
from tractexp.sweep import sweeper

JUDGING = {"targets": TARGETS, "ties": 1e-3, "floor": 1e-9, "reference": None}


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    monkeypatch.setattr(judging, "list_plain_optimizers", lambda: {"issa": "ssa", "ssa": ""})


def moved(runs, data, factors=None, budget=None):
    """The same runs on other data, under another budget, the objective multiplied by a factor for
    each switch on.
    """
    made = []
    for run in runs:
        factor = np.prod(
            [f for switch, f in (factors or {}).items() if run.config[f"optimizer.{switch}"]]
        )
        config = run.config | {"budget": budget}
        made.append(replace(run, data=data, config=config, objective=run.objective * factor))
    return made


def several(runs, **more):
    return judging.judge_problems(
        part_runs(runs, ["budget"]),
        "the test",
        JUDGING,
        **{"folder": None, "bbob": 0, "cores": 1, "progress": False, **more},
    )


def test_effects_over_records_are_the_mean_of_those_on_each():
    runs = ablation_runs(subsets(range(5)))
    made = several([*runs, *moved(runs, "b", {"levy": 4.0})])
    (overall,) = made.overall
    assert overall.columns == ("tibet_50pct", "b")
    levy = [
        next(e for e in a.effects if e.switches == ("levy",))
        for a in (*overall.each.values(), overall.ablation)
    ]
    assert [e.factor for e in levy] == pytest.approx(
        [10**-0.3, 4 * 10**-0.3, 2 * 10**-0.3], rel=0.01
    )
    assert [e.seeds for e in levy] == [len(SEEDS)] * 3
    assert levy[0].better[0] == 1.0  # ten times the noise: in every pair
    assert levy[1].better == (0.0, 0.0, 0.0)
    assert overall.ranks.seeds == 2 * len(SEEDS)


def test_a_switch_without_effect_helps_in_half_of_the_pairs():
    (overall,) = several(ablation_runs(subsets(range(5)))).overall
    effect = next(e for e in overall.ablation.effects if e.switches == ("tent_initialization",))
    share, low, high = effect.better
    assert low < 0.5 < high
    assert high - low < 0.3
    assert share == pytest.approx(0.5, abs=0.15)


def test_budgets_are_terms_of_their_own_and_never_pooled():
    runs = ablation_runs(subsets(range(5)))
    made = several([*moved(runs, "a", budget=15000), *moved(runs, "a", {"gaussian": 100.0})])
    assert [overall.terms for overall in made.overall] == ["15,000 simulations", "2 iterations"]
    harms = [
        next(e for e in o.ablation.effects if e.switches == ("gaussian",)).factor
        for o in made.overall
    ]
    assert harms == pytest.approx([10**0.1, 100 * 10**0.1], rel=0.01)
    told = overall_claims.describe_agreement(made)
    assert told.startswith("Over all terms together, levy helps everywhere")
    assert "gaussian" in told.partition("everywhere")[2]


def test_the_best_mean_rank_and_what_is_not_told_from_it():
    (overall,) = several([*samples({"good": 1.0, "bad": 3.0, "alike": 1.0}, spread=0.1)]).overall
    told = overall_claims.describe_mean_ranks(overall)
    assert {overall.ranks.names[k] for k in np.argsort(overall.ranks.mean)[:2]} == {"good", "alike"}
    assert "not told from it: " in told
    assert "bad" not in told


def test_what_a_switch_costs_is_counted():
    """50 simulations an iteration, and 50 more with the Gaussian variation."""
    runs = []
    for run in ablation_runs(subsets(range(5))):
        more = 50.0 * run.config["optimizer.gaussian"]
        runs.append(
            replace(run, simulations=run.simulations + more * np.arange(len(run.simulations)))
        )
    (overall,) = several(runs).overall
    assert overall.cost == pytest.approx({s: 50.0 * (s == "gaussian") for s in SWITCHES})
    assert "gaussian +50.0" in overall_claims.describe_costs(overall)


def test_a_search_that_ended_with_its_first_population_tells_no_cost_of_an_iteration():
    runs = ablation_runs(subsets(range(5)))
    first = runs[0]
    runs[0] = replace(
        first,
        history=first.history[:1],
        simulations=first.simulations[:1],
        seconds=first.seconds[:1],
    )
    (overall,) = several(runs).overall
    assert overall.cost == pytest.approx(dict.fromkeys(SWITCHES, 0.0))


@pytest.mark.parametrize(
    ("values", "median"), [([5, 1, 2], 2), ([4, 1, 3, 2], 2.5), ([1, np.inf, np.inf], np.inf)]
)
def test_the_median_of_an_odd_and_an_even_number_of_runs(values, median):
    variant = SimpleNamespace(objectives=dict(enumerate(map(float, values))))
    assert _find_median(variant, range(len(values))) == median


def test_a_job_that_cannot_be_read_says_why_in_the_first_line_of_the_reason():
    with (
        pytest.raises(
            UserError, match=r"a/b\.csv cannot be read: a column is missing; run this job again"
        ),
        _refuse_unreadable(Path("a/b.csv")),
    ):
        raise ValueError("a column is missing\nand more")


def test_on_bbob_a_function_is_a_block():
    """Levy divides every distance by ten, on three instances; what has been met counts as met and
    no closer.
    """
    family = VariantFamily(("levy",), {frozenset(): "ssa", frozenset({"levy"}): "flying"})
    plan = BbobPlan(tuple(range(1, 25)), (5,), (1, 2, 3), 3000, (1.0, 1e-8), 0)
    rng = np.random.default_rng(4)
    runs = []
    for f in plan.functions:
        for i in plan.instances:
            near = 10 ** rng.uniform(-4, 0) if f > 1 else 1e-13
            for name, distance in (("ssa", near), ("flying", near / 10)):
                runs.append(BbobRun(name, f, 5, i, 15000, 1, distance, (3.0, np.inf)))
    benchmark = BbobRuns(plan, ("ssa", "flying"), {f: str(f) for f in plan.functions}, runs)
    made = rank_on_functions(benchmark, family)
    (levy,) = made.ablation.effects
    assert levy.seeds == 24
    assert levy.factor == pytest.approx(10 ** (-23 / 24))
    assert levy.better[0] == pytest.approx((23 + 0.5) / 24)
    assert made.columns[0] == "all"
    assert made.figures["ssa"][0] == 0.5


@pytest.fixture
def folder(tmp_path):
    runs = samples({"ssa": 1.0, "pso": 2.0}, seeds=range(8))
    return write_sweep(tmp_path / "sweep", [*runs, *(replace(r, data="tibet_30pct") for r in runs)])


def test_the_command_compares_several_records_on_one_page(folder):
    done = compare_command("task.sweep=sweep", "hydra.run.dir=out", cwd=folder.parent)
    assert done.returncode == 0, done.stderr
    told = json.loads((folder / "comparison.json").read_text())
    assert [len(p["variants"]) for p in told["problems"].values()] == [2, 2]
    assert told["overall"][0]["columns"] == ["tibet_50pct", "tibet_30pct"]
    assert "Each problem by itself" in (folder / "comparison.html").read_text()
    assert "median objective over the floor" in done.stdout


def test_the_variants_run_on_bbob_once_and_without_its_package_the_records_are_told(
    folder, monkeypatch
):
    pytest.importorskip("ioh", reason="the extra [benchmark] is not installed")
    from tractexp.studies.bbob import runs as bbob
    from tractexp.studies.comparison import load

    runs = [replace(r, config=r.config | {"budget": 60}) for r in load.read_sweep(folder)]
    made = several(runs, folder=folder, bbob=1)
    assert "BBOB: 24 functions in dimension 5, 1 instances each" in made.overall[-1].where
    assert set(made.overall[-1].figures) == {"ssa", "pso"}

    def absent():
        raise judging.UserError("task=benchmark needs the package 'ioh', which is not installed")

    monkeypatch.setattr(bbob, "import_package", absent)
    again = several(runs, folder=folder, bbob=1)  # read back: nothing is run
    assert again.overall[-1].figures == made.overall[-1].figures
    left = several(runs, folder=folder, bbob=2)
    assert len(left.overall) == 1
    assert (
        left.notes[-1]
        == "BBOB was left out: task=benchmark needs the package 'ioh', which is not installed."
    )


@pytest.mark.parametrize(
    ("terminal", "display", "opened"), [(True, ":0", 1), (True, "", 0), (False, ":0", 0)]
)
def test_the_page_opens_for_a_person_at_a_desktop_only(
    terminal, display, opened, tmp_path, monkeypatch
):
    shown = []
    monkeypatch.setattr(sweeper.webbrowser, "open", shown.append)
    monkeypatch.setattr(sweeper.sys, "platform", "linux")
    monkeypatch.setattr(sweeper.sys.stdout, "isatty", lambda: terminal, raising=False)
    monkeypatch.setenv("DISPLAY", display)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    sweeper.open_page(tmp_path / "comparison.html")
    assert len(shown) == opened
