"""Comparisons of sweeps whose truth was planted: found where it is, not found where it is not."""

import itertools
import json
import os
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from command_line import run_command
from pages import read

from tractexp.errors import UserError
from tractexp.studies.comparison import claims, floor, load
from tractexp.studies.comparison.comparison import compare
from tractexp.studies.comparison.floor import Floor, find_floor, polish
from tractexp.studies.comparison.runs import PROBLEM, REST, SETTINGS, SearchRun, gather
from tractexp.studies.comparison.runs import select_runs_on as on_data
from tractexp.studies.comparison.summary import (
    ECDF_TARGETS,
    Band,
    compute_band,
    compute_running_time,
    list_runtimes,
    summarize,
)

FLOOR = 8.1e-6
SEEDS = range(30)
SWITCHES = ("gaussian", "levy", "tent_initialization", "tent_perturbation")
TARGETS = (10.0, 2.0, 1.01)
DATA = {"data.name": "csv", "data.train": ["a.csv"]}


def a_run(
    optimizer,
    seed,
    objective,
    settings=None,
    *,
    rate=0.05,
    iterations=100,
    data=None,
    name=None,
    **more,
):
    """A search of 50 simulations and 10 ms an iteration, from 0.1 pu² down to `objective`."""
    steps = np.arange(iterations + 1)
    config = {"optimizer.name": name or optimizer, "seed": seed, "budget": None} | (data or DATA)
    config |= {f"optimizer.{key}": value for key, value in (settings or {}).items()}
    return SearchRun(
        optimizer,
        "tibet_50pct",
        seed,
        config,
        f"{optimizer}-{seed}",
        objective,
        objective**0.5,
        1.3 * objective**0.5,
        50.0 * (1 + steps),
        0.01 * (1 + steps),
        np.maximum(0.1 * np.exp(-rate * 2 * steps), objective),
        **more,
    )


def a_failure(optimizer, seed, why="it burst"):
    whole = a_run(optimizer, seed, FLOOR)
    return SearchRun(whole.optimizer, whole.data, seed, whole.config, whole.where, failure=why)


def samples(factors, spread=0.3, seeds=SEEDS):
    """Runs whose objectives are log-normal about FLOOR times the variant's factor; seeds share
    nothing.
    """
    runs = []
    for k, (optimizer, factor) in enumerate(factors.items()):
        rng = np.random.default_rng(k)
        runs += [
            a_run(optimizer, s, FLOOR * factor * np.exp(spread * rng.standard_normal()))
            for s in seeds
        ]
    return runs


def compared(runs, **more):
    return compare(
        gather(runs, "the test"), targets=TARGETS, ties=1e-3, **{"floor": FLOOR / 10, **more}
    )


def test_a_planted_better_optimizer_is_found():
    result = compared(samples({"good": 1.0, "bad": 2.0, "worse": 4.0}))
    assert [s.name for s in result.summaries] == ["good", "bad", "worse"]
    assert all(pair.significant for pair in result.pairs)
    assert {(p.first, p.second) for p in result.pairs} == {
        ("good", "bad"),
        ("good", "worse"),
        ("bad", "worse"),
    }
    assert min(p.effect for p in result.pairs) > 0.85
    assert result.ranks.p < 1e-6
    assert result.ranks.groups == ()
    assert claims.write_headline(result) == (
        "good has the lowest median objective; it is significantly better than bad and worse."
    )
    assert claims.answer(result) == "Take good: it ends lower than bad and worse."


def test_optimizers_that_do_not_differ_are_not_told_apart():
    """Over 100 comparisons of five alike, about 5 in 100 find any difference, since the errors are
    held per family.
    """
    found = sum(
        any(p.significant for p in compared(runs).pairs)
        for runs in (
            [
                a_run(
                    name,
                    s,
                    FLOOR * np.exp(0.3 * np.random.default_rng([trial, k, s]).standard_normal()),
                    iterations=2,
                )
                for k, name in enumerate("abcde")
                for s in range(12)
            ]
            for trial in range(100)
        )
    )
    assert found <= 11  # 99 % of binomial(100, 0.05)


@pytest.mark.parametrize(("off", "same"), [(1.009, True), (0.991, True), (1.015, False)])
def test_runs_are_of_the_problem_whose_objectives_they_have_within_a_hundredth(off, same):
    runs = [a_run("a", s, FLOOR * (1 + s)) for s in SEEDS]
    problem = SimpleNamespace(
        objective=lambda ends: np.array([FLOOR, *(off * run.objective for run in runs[1:])])
    )
    assert floor._is_same_problem(problem, np.zeros((len(runs), 2)), runs) == same


def test_runs_that_all_reach_the_floor_are_equal_whatever_is_left_of_rounding():
    runs = [a_run("a", s, FLOOR * (1 + 1e-9 * s)) for s in SEEDS] + [
        a_run("b", s, FLOOR * (1 + 1e-7)) for s in SEEDS
    ]
    result = compared(runs, floor=None)
    (pair,) = result.pairs
    assert (pair.p, pair.effect, pair.significant) == (1.0, 0.5, False)
    assert result.floor.value == FLOOR
    assert result.floor.source == "the best of all runs compared, by a"
    assert "is not significant" in claims.quote_pair(result, pair)
    assert claims.write_headline(result).startswith(
        "a and b reach the lowest median objective (equal within 0.10% of the"
    )
    assert claims.answer(result) == "Take a: it ends as low as b, sooner."


def test_the_order_of_the_runs_does_not_matter():
    from tractexp.studies.comparison.page import build_content

    runs = [*samples({"good": 1.0, "bad": 2.0, "other": 1.05}), a_failure("bad", 99)]
    shuffled = [runs[i] for i in np.random.default_rng(0).permutation(len(runs))]
    texts = [json.dumps(build_content(compared(r), "x")) for r in (runs, shuffled)]
    assert texts[0] == texts[1]


def test_a_quotable_sentence_says_what_the_test_said():
    result = compared(samples({"issa": 1.0, "ssa": 2.0}))
    (pair,) = result.pairs
    medians = [
        f"{np.median([r.objective for r in result.gathered[n].runs]):.3g}" for n in ("issa", "ssa")
    ]
    assert claims.quote_pair(result, pair) == (
        f"On 30 seeds and 5,050 simulations, issa reaches a median objective of {medians[0]} pu²"
        f" against {medians[1]} "
        "pu² for ssa; the difference is significant (Wilcoxon signed-rank, Holm-corrected over 1"
        " pair, "
        f"p = {claims.format_p_value(pair.p)}; Vargha-Delaney A = {pair.effect:.2f})."
    )


def test_a_sentence_does_not_hide_that_one_variant_had_more_simulations():
    runs = [a_run("issa", s, FLOOR, iterations=200) for s in SEEDS] + [
        a_run("ssa", s, 2 * FLOOR) for s in SEEDS
    ]
    result = compared(runs)
    told = claims.quote_pair(result, result.pairs[0])
    assert "with 10,050 simulations (median)" in told
    assert "with 5,050 for ssa" in told
    assert claims.answer(result).endswith(
        "It spent 10,050 simulations, where ssa spent 5,050 simulations."
    )


def test_a_summary_is_that_of_the_numbers():
    """Objectives 1 to 5 times 1e-5 with the floor at 1e-5: one run of five is within 1 % of it."""
    runs = [a_run("a", s, (s + 1) * 1e-5) for s in range(5)] + [a_failure("a", 5)]
    (variant,) = gather(runs, "x").variants
    told = summarize(variant, find_floor(variant.runs, None, None), TARGETS)
    assert (told.runs, told.failures) == (6, 1)
    assert vars(told.objective) == pytest.approx(
        {"best": 1e-5, "lower": 2e-5, "median": 3e-5, "upper": 4e-5, "worst": 5e-5}
    )
    assert told.at_floor == pytest.approx(1 / 6)
    assert told.epsilon_p.median == pytest.approx(3e-5**0.5)


def test_at_the_floor_is_what_ends_within_a_hundredth_of_it():
    runs = [a_run("a", s, FLOOR * times) for s, times in enumerate((1.0, 1.009, 1.011, 1.5))]
    (variant,) = gather(runs, "x").variants
    assert summarize(variant, find_floor(variant.runs, None, None), TARGETS).at_floor == 0.5


def test_running_times_are_counted_by_hand():
    """Reached after 3, 5 and never; the one that never did, and one that burst, spend all 101 x 50
    simulations.
    """
    history = {0: 3, 1: 5}
    runs = [
        replace(
            a_run("a", s, 1.0), history=np.where(np.arange(101) >= history.get(s, 999), 1.0, 9.0)
        )
        for s in range(3)
    ]
    (variant,) = gather([*runs, a_failure("a", 3)], "x").variants
    assert compute_running_time(variant, 2.0, "simulations") == (4 * 50 + 6 * 50 + 5050 + 5050) / 2
    assert compute_running_time(variant, 2.0, "seconds") == pytest.approx(
        (0.04 + 0.06 + 1.01 + 1.01) / 2
    )
    assert compute_running_time(variant, 0.5, "simulations") == np.inf
    budgeted = replace(a_failure("a", 3), config=a_failure("a", 3).config | {"budget": 700})
    (variant,) = gather(
        [replace(r, config=r.config | {"budget": 700}) for r in runs] + [budgeted], "x"
    ).variants
    assert compute_running_time(variant, 2.0, "simulations") == (4 * 50 + 6 * 50 + 5050 + 700) / 2


def test_runtimes_hold_every_target_of_every_run():
    (variant,) = gather(
        [a_run("a", s, FLOOR) for s in range(3)] + [a_failure("a", 9)], "x"
    ).variants
    costs = list_runtimes(variant, find_floor(variant.runs, None, None))
    assert costs.shape == (4 * len(ECDF_TARGETS),)
    assert np.isinf(costs).sum() == len(ECDF_TARGETS)
    assert (np.diff(costs[np.isfinite(costs)]) >= 0).all()


def test_a_band_holds_what_a_short_run_had_reached():
    runs = [a_run("a", 0, 1e-5, iterations=10), a_run("a", 1, 3e-5, iterations=100, rate=1.0)]
    (variant,) = gather(runs, "x").variants
    for by, last in (("iterations", 100), ("simulations", 5050)):
        told = compute_band(variant, by)
        assert told.x[-1] == last
        assert told.median[-1] == pytest.approx((runs[0].history[-1] + 3e-5) / 2)
        assert (np.diff(told.median) <= 0).all()
        assert (told.lower <= told.median).all()
        assert (told.median <= told.upper).all()


def test_the_axis_of_a_band_ends_with_what_a_fiftieth_of_the_search_left():
    x, upper = np.arange(100.0, 201.0), np.arange(1000.0, 899.0, -1)
    assert Band(x, upper - 2, upper - 1, upper).top == 998.0


# The ablation: objectives with known effects of each switch, in powers of ten.


def ablation_runs(combinations, interaction=0.0, noise=0.02):
    """log10 of the objective: levy -0.3, gaussian +0.1, both together `interaction` more; the
    others nothing.
    """
    runs = []
    for on in combinations:
        settings = {switch: switch in on for switch in SWITCHES} | {
            "population": 50,
            "polish": False,
        }
        label = "+".join(sorted(on)) or "off"
        for seed in SEEDS:
            rng = np.random.default_rng([seed, *(ord(c) for c in label)])
            shift = (
                -0.3 * ("levy" in on)
                + 0.1 * ("gaussian" in on)
                + interaction * ({"levy", "gaussian"} <= set(on))
            )
            objective = 1e-3 * 10 ** (shift + noise * rng.standard_normal())
            runs.append(a_run(label, seed, objective, settings, name="issa", iterations=2))
    return runs


def subsets(sizes):
    return [on for size in sizes for on in itertools.combinations(SWITCHES, size)]


def test_a_full_factorial_gives_every_effect_and_interaction():
    result = compared(
        ablation_runs(subsets(range(5)), interaction=0.2), floor=1e-9, plain={"issa": "ssa"}
    )
    found = result.ablation
    assert found.unknown == ()
    effects = {e.switches[0]: e for e in found.effects}
    assert {len(e.contrasts) for e in effects.values()} == {8}
    assert effects["levy"].factor == pytest.approx(10 ** (-0.3 + 0.1), rel=0.01)
    assert effects["gaussian"].factor == pytest.approx(10 ** (0.1 + 0.1), rel=0.01)
    assert effects["levy"].low < effects["levy"].factor < effects["levy"].high < 1
    assert effects["levy"].is_significant
    assert effects["gaussian"].is_significant
    interactions = {frozenset(e.switches): e for e in found.interactions}
    assert len(interactions) == 6
    assert interactions[frozenset(("levy", "gaussian"))].factor == pytest.approx(10**0.2, rel=0.01)
    # one is planted; 1 in 20 of the others by chance
    assert sum(e.is_significant for e in interactions.values()) <= 2


def test_one_by_one_from_both_ends_gives_effects_and_says_what_it_cannot_give():
    """The ablation of the paper: all, all but one, none, one; `ssa` stands for none."""
    runs = ablation_runs(subsets((1, 3, 4)), interaction=0.2)
    for r in ablation_runs([()]):
        config = {k: v for k, v in r.config.items() if not k.endswith(SWITCHES)} | {
            "optimizer.name": "ssa"
        }
        runs.append(replace(r, optimizer="ssa", config=config))
    found = compared(runs, floor=1e-9, plain={"issa": "ssa", "ssa": ""}).ablation
    assert len(found.variants) == 10
    assert "ssa" in found.variants
    levy = next(e for e in found.effects if e.switches == ("levy",))
    without = "gaussian+tent_initialization+tent_perturbation"
    assert set(levy.contrasts) == {("levy", "ssa"), ("+".join(SWITCHES), without)}
    # alone -0.3, with gaussian on -0.1
    assert levy.factor == pytest.approx(10 ** ((-0.3 + -0.1) / 2), rel=0.01)
    company = next(e for e in found.company if e.switches == ("levy",))
    assert company.factor == pytest.approx(10**0.2, rel=0.02)
    assert found.interactions == ()
    assert {frozenset(u) for u in found.unknown} == {
        frozenset(p) for p in itertools.combinations(SWITCHES, 2)
    }
    assert "four that differ in those alone" in claims.describe_untold_effects(found)


def test_variants_with_other_settings_stay_out_of_the_ablation():
    runs = ablation_runs(subsets((3, 4)))
    other = [
        replace(r, optimizer="raw", config=r.config | {"optimizer.space": "raw"})
        for r in ablation_runs(subsets((4,)))
    ]
    found = compared([*runs, *other], floor=1e-9, plain={"issa": "ssa"}).ablation
    assert "raw" not in found.variants
    assert compared(samples({"a": 1.0, "b": 2.0}), plain={"a": "", "b": ""}).ablation is None


# Gathering.


def test_settings_make_variants_and_name_them():
    runs = [
        a_run("issa", s, FLOOR, {"population": n, "levy": True}) for s in range(3) for n in (30, 50)
    ]
    assert [v.name for v in gather(runs, "x").variants] == [
        "issa population=30",
        "issa population=50",
    ]
    assert [v.name for v in gather(runs[::2], "x").variants] == ["issa"]


def test_a_repeated_run_counts_once_and_the_newest():
    runs = [a_run("a", 0, 2e-5), a_run("a", 0, 1e-5), a_run("a", 1, 1e-5)]
    gathered = gather(runs, "x")
    assert [r.objective for r in gathered["a"].runs] == [1e-5, 1e-5]
    assert gathered.notes == ("Of runs made more than once, the newest count: 1 left out.",)


def test_failures_count_as_the_worst_and_never_as_missing():
    runs = [a_run("a", s, FLOOR) for s in SEEDS] + [a_failure("b", s) for s in SEEDS[:20]]
    runs += [a_run("b", s, FLOOR) for s in SEEDS[20:]]
    result = compared(runs)
    (pair,) = result.pairs
    assert (pair.first, pair.seeds, pair.significant) == ("a", 30, True)
    assert "against no result for b; the difference is significant" in claims.quote_pair(
        result, pair
    )


def test_a_reference_tests_its_own_pairs_only():
    runs = samples({"a": 1.0, "b": 1.5, "c": 2.0})
    assert len(compared(runs).pairs) == 3
    result = compared(runs, reference="b")
    assert {frozenset((p.first, p.second)) for p in result.pairs} == {
        frozenset("ab"),
        frozenset("bc"),
    }
    with pytest.raises(
        UserError, match="there is no variant 'bb' in this comparison; did you mean 'b'"
    ):
        compared(runs, reference="bb")


def test_too_few_seeds_are_said_and_nothing_is_tested():
    result = compared(samples({"a": 1.0, "b": 5.0, "c": 9.0}, seeds=range(5)))
    assert result.pairs == ()
    assert result.ranks is None
    assert (
        "3 of 3 pairs were not tested, for want of seeds: a and b have 5 in common"
        in result.notes[0]
    )
    assert "needs at least 6" in result.notes[0]
    assert "The variants were not ranked: they have 5 seeds in common" in result.notes[1]
    assert claims.write_headline(result) == "No difference between variants was tested."
    assert claims.answer(result).startswith(
        "Not settled: there are too few seeds to test. a has the lowest median"
    )


def test_seeds_too_few_for_the_correction_are_said():
    """15 pairs on 6 seeds: the smallest corrected p is 15 x 2 / 2^6 = 0.47; 10 seeds give 15 x 2 /
    2^10 = 0.029.
    """
    runs = samples({name: 10.0**k for k, name in enumerate("abcdef")}, seeds=range(6))
    (note,) = compared(runs).notes
    assert "With 15 pairs corrected for, fewer than 10 seeds can show no difference" in note
    assert min(p.corrected for p in compared(runs).pairs) == pytest.approx(15 * 2 / 64)
    assert claims.answer(compared(runs)).startswith("Not settled: there are too few seeds to test.")
    assert (
        compared(samples({name: 10.0**k for k, name in enumerate("abcdef")}, seeds=range(10))).notes
        == ()
    )


def test_one_variant_is_described_and_not_tested():
    result = compared(samples({"a": 1.0}))
    assert result.notes == ("There is one variant only, a: nothing to test it against.",)
    assert claims.answer(result) == "There is one variant only, a: nothing to choose from."


def test_the_lowest_that_had_too_few_seeds_is_not_recommended():
    result = compared(
        [
            *samples({"a": 1.0, "b": 9.0}),
            a_run("lucky", 0, 0.9 * FLOOR),
            a_run("lucky", 1, FLOOR / 2),
        ]
    )
    assert result.summaries[0].name == "lucky"
    assert claims.answer(result) == (
        "lucky has the lowest median objective, but too few seeds to test. Of the others: Take a:"
        " it ends lower than b."
    )


def test_variants_that_are_not_told_apart_are_offered_together():
    result = compared(samples({"a": 1.0, "b": 1.0, "c": 9.0}))
    first, second = (s.name for s in result.summaries[:2])
    assert {first, second} == {"a", "b"}
    assert (
        claims.answer(result)
        == f"Take {first}, or as well {second}: these runs do not tell them apart."
    )


def test_different_problems_are_refused():
    other = [replace(r, data="tibet_30pct") for r in samples({"b": 1.0})]
    with pytest.raises(
        UserError,
        match=r"different data \(tibet_30pct, tibet_50pct\).*choose one, such as task.data=",
    ):
        gather([*samples({"a": 1.0}), *other], "the sweep x")
    assert [
        v.name
        for v in gather(on_data([*samples({"a": 1.0}), *other], "x", "tibet_30pct"), "x").variants
    ] == ["b"]
    with pytest.raises(
        UserError, match=r"task.data=tibet_3: the sweep x has no run.*did you mean 'tibet_30pct'"
    ):
        gather(on_data(other, "the sweep x", "tibet_3"), "the sweep x")
    fixed = [replace(r, config=r.config | {"model.fixed.C": 0.7}) for r in samples({"b": 1.0})]
    with pytest.raises(UserError, match=r"differ in model.fixed.C \(0.7, null\)"):
        gather([*samples({"a": 1.0}), *fixed], "x")
    with pytest.raises(UserError, match=r"none of the 2 runs of x finished.*because: it burst"):
        gather([a_failure("a", 0), a_failure("a", 1)], "x")


def test_every_part_of_the_configuration_makes_a_problem_a_variant_or_neither():
    """A key of no part would be swept and pooled under one name, unseen."""
    import dataclasses

    from tractexp.configuration.schema import Config

    assert {field.name for field in dataclasses.fields(Config)} == {*PROBLEM, *SETTINGS, *REST}


@pytest.mark.parametrize(
    ("key", "value"), [("task.figures", True), ("target", 1e-5), ("time_limit", 2.0)]
)
def test_settings_beside_the_optimizers_make_variants_too(key, value):
    runs = samples({"a": 1.0}, seeds=range(3))
    other = [replace(r, config=r.config | {key: value}) for r in runs]
    plain = [replace(r, config=r.config | {key: None}) for r in runs]
    names = [v.name for v in gather([*plain, *other], "x").variants]
    assert names == [f"a {key}=null", f"a {key}={str(value).lower()}"] or names == sorted(names)
    assert len(names) == 2


def test_another_measure_is_another_problem():
    other = [replace(r, config=r.config | {"objective.weight_Q": 2.0}) for r in samples({"b": 1.0})]
    with pytest.raises(UserError, match=r"differ in objective.weight_Q \(2.0, null\)"):
        gather([*samples({"a": 1.0}), *other], "x")


def interrupted(optimizer, seed):
    return replace(a_failure(optimizer, seed), failure="", interruption="its sweep was interrupted")


def test_an_interrupted_run_is_told_and_not_judged():
    whole = samples({"a": 1.0, "b": 2.0})
    result = compared(
        [*whole, *(interrupted("b", s) for s in (30, 31)), interrupted("c", 0), interrupted("a", 3)]
    )
    assert [(name, run.seed) for name, run in result.gathered.interrupted] == [
        ("b", 30),
        ("b", 31),
        ("c", 0),
    ]
    alone = compared(whole)
    assert result.pairs == alone.pairs
    assert [(s.runs, s.failures, s.at_floor, s.ert) for s in result.summaries] == [
        (s.runs, s.failures, s.at_floor, s.ert) for s in alone.summaries
    ]
    assert (
        "3 runs were interrupted, or still going on, and not judged: see the end of the page."
        in result.notes
    )
    with pytest.raises(
        UserError, match=r"none of the 1 runs of x finished.*; all were interrupted"
    ):
        gather([interrupted("a", 0)], "x")


def test_runs_of_different_code_are_told():
    runs = samples({"a": 1.0, "b": 2.0})
    versions = [replace(r, code=["", "0.4 at 1c2d3e4f"][r.optimizer == "b"]) for r in runs]
    assert gather(versions, "x").notes == ()
    (note,) = gather([replace(r, code=f"0.{r.seed % 2}") for r in runs], "x").notes
    assert note.startswith(
        "The runs were made by different code (0.0, 0.1): a difference between variants may be"
    )
    told = {"tractexp_version": "0.4", "commit": "1c2d3e4f5a6b7c8d-dirty"}
    assert [load.describe_code(t) for t in (told, told | {"commit": ""}, {})] == [
        "0.4 at 1c2d3e4f-dirty",
        "0.4",
        "",
    ]


# The floor: that of the shipped dip is known from several hundred descents.

LOWEST = 3.0858e-5
NODE = {"motor": {"name": "electromechanical"}, "static": {"name": "exponential"}}
SHIPPED = {"data.name": "csv", "data.train": ["pkg://tractexp.data/tibet_50pct.csv"]} | {
    f"model.{part}.name": node["name"] for part, node in NODE.items()
}


@pytest.fixture(scope="module")
def problem():
    from tractexp.api.setup import Setup
    from tractexp.configuration.plugin import build
    from tractexp.record import detect

    (record,) = build("data", {"name": "csv", "train": SHIPPED["data.train"]}).read().train
    return Setup.from_arguments([detect(record)], NODE).problem


def ended_at(problem, optimizer, seed, values, **more):
    """A run on the shipped dip that ended at these parameters."""
    (objective,) = problem.objective(np.array([values]))
    parameters = dict(zip(problem.space.names, map(float, values), strict=True))
    return replace(
        a_run(optimizer, seed, float(objective), data=SHIPPED), parameters=parameters, **more
    )


@pytest.fixture(scope="module")
def polished(problem):
    """Runs that all stop short, six in the floor's valley and one in another, and what polishing
    makes of them.
    """
    lowest = polish(problem, [a_run("a", 0, 1e-3, data=SHIPPED)], lambda n: lambda: None)
    values = np.array([lowest.parameters[name] for name in problem.space.names])
    near = [
        ended_at(problem, "a", s, values * (1 + 0.01 * np.sin(s + np.arange(len(values)))))
        for s in range(6)
    ]
    shallow = dict(lowest.parameters, X_prime=0.45, C=0.45, q_v=1.6)
    far = ended_at(problem, "b", 0, np.array([shallow[name] for name in problem.space.names]))
    return [*near, far], polish(problem, [*near, far], lambda n: lambda: None)


def test_the_floor_is_polished_where_no_run_reached_it(polished):
    runs, found = polished
    assert min(run.objective for run in runs) > 1.05 * LOWEST
    assert found.objective == pytest.approx(LOWEST, rel=1e-4)
    floor = find_floor(runs, None, found)
    assert (floor.value, floor.source) == (
        found.objective,
        f"the lowest that least squares reach from where 7 runs ended and from {found.starts}"
        " starts"
        " all over the bounds",
    )
    assert find_floor(runs, 2e-5, found) == Floor(2e-5, "as given by task.floor")


def test_runs_are_told_apart_by_the_valley_they_ended_in(polished):
    runs, found = polished
    assert [found.in_valley(run) for run in runs] == [True] * 6 + [False]
    assert found.reached[runs[-1]] > 1.2 * LOWEST
    made = compare(gather(runs, "x"), targets=TARGETS, ties=1e-3, polished=found)
    assert {s.name: s.in_valley for s in made.summaries} == {"a": 1.0, "b": 0.0}
    assert claims.describe_valley(made).endswith(
        "from where least squares reach it: a 6 of 6, b 0 of 1."
    )
    assert {
        s.in_valley for s in compare(gather(runs, "x"), targets=TARGETS, ties=1e-3).summaries
    } == {None}


def test_runs_of_records_that_have_changed_since_are_not_polished(problem, polished):
    runs, _ = polished
    assert (
        polish(
            problem, [replace(r, objective=1.1 * r.objective) for r in runs], lambda n: lambda: None
        )
        is None
    )


def test_a_floor_given_too_high_is_said(polished):
    runs, found = polished
    made = compare(gather(runs, "x"), targets=TARGETS, ties=1e-3, polished=found, floor=4e-5)
    assert made.floor.value == 4e-5
    assert any(
        "task.floor=4e-05 lies above what least squares reach" in note for note in made.notes
    )


# The charts.


def drawn(chart, name):
    """The points of one name of a chart: (x, y)."""
    traces = [trace for trace in chart.plain()["data"] if trace["name"] == name]
    return [(x, y) for trace in traces for x, y in zip(trace["x"], trace["y"], strict=True)]


def test_every_run_that_finished_is_drawn():
    from tractexp.studies.comparison.charts import draw_spread

    result = compared([*samples({"a": 1.0, "b": 2.0}), a_failure("b", 77)])
    points = drawn(draw_spread(result.variants, result.floor), "every run")
    assert sorted(x for x, _ in points) == sorted(
        run.objective for v in result.variants for run in v.finished_runs
    )
    assert len(points) == 60
    assert {round(y) for _, y in points} == {0, 1}


def test_every_runs_parameters_are_drawn_as_wide_as_they_scatter(polished, problem):
    from tractexp.studies.comparison.charts import draw_parameters

    runs, found = polished
    chart = draw_parameters(gather(runs, "x").variants, found)
    layout = chart.plain()["layout"]
    n = len(problem.space.names)
    assert len(drawn(chart, "in the floor&#x27;s valley")) == 6 * n
    assert len(drawn(chart, "elsewhere")) == n
    assert layout["xaxis"]["ticktext"] == ["a", "b"]
    for k, name in enumerate(problem.space.names):
        shown = layout["yaxis" + (str(k + 1) if k else "")]["range"]
        ends = [found.parameters[name], *(run.parameters[name] for run in found.reached)]
        assert shown[0] < min(ends) <= max(ends) < shown[1]
        assert shown[1] - shown[0] == pytest.approx(1.16 * np.ptp(ends) or 2e-3 * abs(ends[0]))
    levels = sorted(shape["y0"] for shape in layout["shapes"])
    assert levels == sorted(found.parameters.values())


@pytest.mark.parametrize(("count", "each"), [(3, 0), (7, 0), (20, 20)])
def test_of_many_variants_the_first_are_in_color_and_each_has_a_chart(count, each):
    from tractexp.blocks import style
    from tractexp.studies.comparison.charts import draw_ecdf, draw_fitness

    result = compared(samples({f"v{k:02}": 1.5**k for k in range(count)}, seeds=range(6)))
    for whole, small in (
        draw_fitness(result.variants, "simulations", result.floor),
        draw_ecdf(result.variants, result.floor),
    ):
        curves = [t for t in whole.plain()["data"] if t["name"]]
        assert {t["name"] for t in curves} == {v.name for v in result.variants}
        assert sum(t["showlegend"] for t in curves) == min(count, 7)
        assert sum(t["line"]["color"] == style.BEHIND for t in curves) == max(count - 7, 0)
        assert len(small) == each


def test_mean_ranks_differ_where_their_bars_do_not_overlap():
    from tractexp.studies.comparison.charts import draw_mean_ranks

    ranks = compared(samples({"a": 1.0, "b": 1.02, "c": 9.0, "d": 9.5})).ranks
    (trace,) = draw_mean_ranks(ranks).plain()["data"]
    reach = {
        name: (x - low, x + high)
        for name, x, low, high in zip(
            sorted(ranks.names, key=lambda n: ranks.mean[ranks.names.index(n)]),
            trace["x"],
            trace["error_x"]["arrayminus"],
            trace["error_x"]["array"],
            strict=True,
        )
    }
    for a, b in itertools.combinations(ranks.names, 2):
        apart = (
            abs(ranks.mean[ranks.names.index(a)] - ranks.mean[ranks.names.index(b)])
            >= ranks.critical_difference
        )
        (low, high) = sorted((reach[a], reach[b]))
        assert (low[1] < high[0]) == apart


# Sweep folders and the command line.


def write_sweep(folder: Path, runs) -> Path:
    for number, run in enumerate(runs):
        job = folder / str(number)
        (job / ".hydra").mkdir(parents=True)
        config = {
            "task": {"name": "identify"},
            "seed": run.seed,
            "budget": None,
            "data": {"name": "csv", "train": run.config["data.train"]},
            "model": NODE if run.config["data.train"] == SHIPPED["data.train"] else {},
        }
        config |= {
            "optimizer": {
                k.removeprefix("optimizer."): v
                for k, v in run.config.items()
                if k.startswith("opt")
            }
        }
        choices = {"task": "identify", "optimizer": run.optimizer, "data": run.data}
        (job / ".hydra" / "config.yaml").write_text(json.dumps(config))
        (job / ".hydra" / "hydra.yaml").write_text(
            json.dumps({"hydra": {"runtime": {"choices": choices}}})
        )
        if run.interruption:
            continue
        if run.failure:
            (job / "status.json").write_text(
                json.dumps({"status": "failed", "message": run.failure})
            )
            continue
        figures = {key: getattr(run, key) for key in ("objective", "epsilon_p", "epsilon_q")}
        # as an identification writes them: the estimate, and where its search ended
        if run.parameters:
            figures = {key: 0.5 * value for key, value in figures.items()} | {
                "parameters": {key: 2 * value for key, value in run.parameters.items()},
                "search": figures | {"parameters": run.parameters},
            }
        (job / "result.json").write_text(json.dumps(figures))
        rows = zip(run.simulations, run.seconds, run.history, strict=True)
        lines = [
            f"{k},{int(n)},{s:.4f},{f!r}"
            for k, (n, s, f) in enumerate((n, s, float(f)) for n, s, f in rows)
        ]
        (job / "history.csv").write_text(
            "\n".join(["iteration,simulations,seconds,objective", *lines])
        )
    return folder


def compare_command(*arguments, cwd):
    return run_command("task=compare", *arguments, "tracking.enabled=false", cwd=cwd)


def test_a_sweep_is_read_back_as_it_was_run(tmp_path):
    runs = [
        *samples({"a": 1.0}, seeds=range(12)),
        a_failure("b", 3, "no steady state: widen model.bounds"),
    ]
    back = load.read_sweep(write_sweep(tmp_path / "sweep", runs))
    for run, found in zip(runs, back, strict=True):
        assert (found.optimizer, found.data, found.seed, found.failure) == (
            run.optimizer,
            run.data,
            run.seed,
            run.failure,
        )
        assert found.objective == run.objective
        np.testing.assert_array_equal(found.history, run.history)
        np.testing.assert_array_equal(found.simulations, run.simulations)


def test_a_job_without_a_result_did_not_finish(tmp_path):
    folder = write_sweep(tmp_path, samples({"a": 1.0}, seeds=range(2)))
    (folder / "0" / "result.json").unlink()
    assert (
        load.read_sweep(folder)[0].interruption == "it left no result: it was ended, or still runs"
    )
    for told in (
        {"status": "running"},
        {"status": "interrupted"},
        {"status": "failed", "message": "interrupted"},
    ):
        (folder / "0" / "status.json").write_text(json.dumps(told))
        run = load.read_sweep(folder)[0]
        assert run.interruption, told
        assert not run.failure
    (folder / "0" / "status.json").write_text(
        json.dumps({"status": "failed", "message": "it burst"})
    )
    assert load.read_sweep(folder)[0].failure == "it burst"
    for name, content in (("history.csv", "nonsense"), ("result.json", "{}"), ("result.json", "[")):
        (folder / "1" / name).write_text(content)
        with pytest.raises(UserError, match=rf"{name} cannot be read"):
            load.read_sweep(folder)


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """The command on a sweep of four variants, the newest of two."""
    folder = tmp_path_factory.mktemp("compare")
    runs = [
        *samples({"good": 1.0, "bad <b>": 2.0, "alike": 1.0, "worst": 8.0}),
        a_failure("worst", 77, "it <b>burst</b>"),
    ]
    older = write_sweep(
        folder / "outputs" / "sweeps" / "older", samples({"old": 1.0}, seeds=range(2))
    )
    for path in older.iterdir():
        os.utime(path, (1, 1))
    write_sweep(folder / "outputs" / "sweeps" / "newer", runs)
    return folder, compare_command("hydra.run.dir=out", "--all", cwd=folder)


def test_the_command_compares_the_newest_sweep(swept):
    folder, done = swept
    assert (done.returncode, done.stderr) == (0, "")
    for part in (
        "outputs/sweeps/newer",
        "good",
        "worst",
        "at floor",
        "Holm-corrected over 6 pairs",
        "comparison.html",
    ):
        assert part in done.stdout, part
    assert re.search(r"\nworst +1 +6\.\d+e-05 ", done.stdout)  # one failed, median objective
    beside = folder / "outputs" / "sweeps" / "newer"
    for name in ("comparison.html", "comparison.json"):
        assert (folder / "out" / name).read_bytes() == (beside / name).read_bytes()


def test_the_page_is_self_contained_and_complete(swept):
    reader = read(swept[0] / "out" / "comparison.html")
    text = (swept[0] / "out" / "comparison.html").read_text()
    assert text.count('class="chart"') == 5
    for part in (
        "Where the runs ended",
        "at the end of the search",
        "Take",
        "How fast",
        "Is the difference more than chance?",
        "To quote",
        "Failures: 1",
        "it <b>burst</b>",
        "bad <b>",
        "How to read this page",
        "by iterations",
        "by simulations",
        "Runtimes",
        "critical difference",
    ):
        assert part in reader.words, part


def test_the_json_holds_the_numbers(swept):
    content = json.loads((swept[0] / "out" / "comparison.json").read_text())
    assert {v["name"] for v in content["variants"]} == {"good", "bad <b>", "alike", "worst"}
    pairs = {frozenset((p["first"], p["second"])): p for p in content["pairs"]}
    assert len(pairs) == 6
    assert pairs[frozenset(("good", "worst"))]["significant"]
    assert not pairs[frozenset(("good", "alike"))]["significant"]
    assert content["failures"] == [
        {"variant": "worst", "seed": 77, "job": "120", "message": "it <b>burst</b>"}
    ]
    assert content["ranks"]["seeds"] == 30
    assert len(content["sentences"]) == 4 + 6


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ((), "there is no sweep under outputs/sweeps to compare; make one, such as tractexp -m"),
        (("task.sweep=missing",), "task.sweep=missing is not a folder"),
        (("task.sweep=empty",), "the sweep empty is empty: none of its folders holds a job"),
        (
            ("task.sweep=mixed", "task.floor=1e-5"),
            "task.floor=1e-05 is the floor of one problem, and the sweep mixed has 2",
        ),
        (("task.apart=[seed]",), "task.apart=seed is not one of budget, time_limit, target"),
        (("task.bbob=-1",), "task.bbob=-1 is out of range"),
        (("task.sweep=empty", "task.filter=x"), "task.sweep and task.filter are both given"),
        (("task.floor=0",), "task.floor=0 must be an objective above 0"),
        (("task.targets=[0.5]",), "task.targets=0.5 is out of range: it must be at least 1"),
        (("task.targets=[]",), "task.targets is empty"),
        (("task.ties=2",), "task.ties=2.0 is out of range"),
        (("task.flor=1",), "no key 'flor'; did you mean 'floor'?"),
    ],
)
def test_bad_input_is_one_sentence(tmp_path, arguments, sentence):
    (tmp_path / "empty" / "0").mkdir(parents=True)
    runs = samples({"a": 1.0}, seeds=range(2))
    write_sweep(tmp_path / "mixed", [*runs, *(replace(r, data="tibet_30pct") for r in runs)])
    done = compare_command(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("tractexp: ")
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "outputs" / "runs").exists() or not list(
        (tmp_path / "outputs" / "runs").iterdir()
    )


def test_two_seeds_are_compared_without_a_test_and_say_so(tmp_path):
    write_sweep(tmp_path / "few", samples({"a": 1.0, "b": 2.0}, seeds=range(2)))
    done = compare_command("task.sweep=few", "hydra.run.dir=out", cwd=tmp_path)
    assert done.returncode == 0
    assert (
        "a and b have 2 in common, and the Wilcoxon signed-rank test needs at least 6"
        in done.stdout
    )
    assert (tmp_path / "out" / "comparison.html").read_text().count('class="chart"') == 4


def test_a_job_ended_while_its_folder_was_made_is_interrupted(tmp_path):
    """Its configuration is there, Hydra's account of it is not; who it was stands in its status."""
    folder = write_sweep(tmp_path, [*samples({"a": 1.0}, seeds=range(2)), interrupted("a", 2)])
    (folder / "2" / ".hydra" / "hydra.yaml").unlink()
    with pytest.raises(UserError, match=r"hydra\.yaml cannot be read"):
        load.read_sweep(folder)
    told = {
        "status": "interrupted",
        "message": "",
        "choices": {"optimizer": "a", "data": "tibet_50pct"},
    }
    (folder / "2" / "status.json").write_text(json.dumps(told))
    run = load.read_sweep(folder)[2]
    assert (run.optimizer, run.seed, run.interruption) == ("a", 2, "its sweep was interrupted")


def test_the_search_is_compared_and_not_the_estimate_it_was_polished_to(tmp_path, polished):
    import tractexp

    runs, found = polished
    made = tractexp.compare(
        write_sweep(tmp_path, [*runs, replace(interrupted("b", 1), config=runs[-1].config)]),
        progress=False,
    )
    content = made.content
    assert (
        content["values"] == "objectives, errors and parameters are those at the end of the search"
    )
    assert [r["objective"] for r in content["runs"]] == [r.objective for r in runs]
    assert content["runs"][0]["parameters"] == runs[0].parameters
    assert [r["in_valley"] for r in content["runs"]] == [True] * 6 + [False]
    assert content["floor"]["value"] == pytest.approx(found.objective)
    assert content["floor"]["parameters"] == pytest.approx(found.parameters)
    assert content["interrupted"] == [
        {
            "variant": "b",
            "seed": 1,
            "job": "7",
            "message": "it left no result: it was ended, or still runs",
        }
    ]
    words = read(made.write(tmp_path / "page")[-1]).words
    for part in (
        "The parameters of every run",
        "lead 6 of 7 runs there",
        "Interrupted: not judged: 1",
    ):
        assert part in words, part


def test_records_that_cannot_be_read_any_more_leave_the_best_run_for_a_floor(tmp_path):
    import tractexp

    made = tractexp.compare(write_sweep(tmp_path, samples({"a": 1.0, "b": 2.0}, seeds=range(6))))
    best = min(r["objective"] for r in made.content["runs"])
    assert made.content["floor"]["value"] == best
    assert (
        "nothing lower was looked for, because the problem cannot be put again ("
        in made.content["floor"]["source"]
    )
    assert "a.csv" in made.content["floor"]["source"]
    assert "The parameters of every run" not in read(made.write(tmp_path / "page")[-1]).words


def test_relative_paths_count_from_where_the_sweep_was_run(tmp_path, polished, monkeypatch):
    """The folder is another when it is compared, and may hold another file of that name."""
    import importlib.resources
    import shutil

    import tractexp

    home, elsewhere = tmp_path / "home", tmp_path / "elsewhere"
    for folder in (home, elsewhere):
        folder.mkdir()
    shutil.copy(
        str(importlib.resources.files("tractexp.data") / "tibet_50pct.csv"), home / "dip.csv"
    )
    shutil.copy(
        str(importlib.resources.files("tractexp.data") / "tibet_30pct.csv"), elsewhere / "dip.csv"
    )
    runs, found = polished
    folder = write_sweep(tmp_path / "sweep", runs)
    for job in folder.iterdir():
        config = json.loads((job / ".hydra" / "config.yaml").read_text())
        config["data"]["train"] = ["dip.csv"]
        (job / ".hydra" / "config.yaml").write_text(json.dumps(config))
        told = json.loads((job / ".hydra" / "hydra.yaml").read_text())
        told["hydra"]["runtime"]["cwd"] = str(home)
        (job / ".hydra" / "hydra.yaml").write_text(json.dumps(told))
    monkeypatch.chdir(elsewhere)
    assert tractexp.compare(folder, progress=False).content["floor"]["value"] == pytest.approx(
        found.objective
    )
    shutil.move(elsewhere / "dip.csv", home / "dip.csv")
    changed = tractexp.compare(folder, progress=False).content["floor"]["source"]
    assert "because the records or the model have changed since" in changed
