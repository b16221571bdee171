"""A comparison as one self-contained page for people, and as one JSON file for machines."""

from dataclasses import asdict
from typing import Any

import numpy as np

from tractexp.blocks import Report
from tractexp.blocks.chart import Chart
from tractexp.storage import files
from tractexp.studies.comparison import charts, claims
from tractexp.studies.comparison.ablation import Ablation, SwitchEffect
from tractexp.studies.comparison.claims import format_number, format_p_value
from tractexp.studies.comparison.comparison import Comparison, VariantPair
from tractexp.studies.comparison.floor import FLOOR_SHARE
from tractexp.studies.comparison.runs import SearchRun, Variant
from tractexp.studies.comparison.statistics import SIGNIFICANCE_LEVEL, describe_effect_size
from tractexp.studies.comparison.summary import Spread

AT_END = "at the end of the search"
WITH_MOST_ON = (
    "With most other switches on against with fewest: the factor by which the effect changes."
)
INTERACTIONS = "Interactions: the factor by which one switch's effect changes when the other is on."
MOST_OPEN_SENTENCES = 12  # more sentences than these about pairs are folded away


def report(comparison: Comparison, source: str) -> Report:
    """The page; `source` says where the runs are from."""
    runs = sum(summary.runs for summary in comparison.summaries)
    title = f"Comparison of {len(comparison.summaries)} optimizers on {comparison.gathered.problem}"
    page = Report(
        title, f"{runs} runs of {source}. Objectives, errors and parameters are those {AT_END}."
    )
    headlines = (
        claims.write_headline,
        claims.describe_floor,
        claims.describe_valley,
        claims.describe_speed,
    )
    page.verdict(
        claims.answer(comparison), *(text for claim in headlines if (text := claim(comparison)))
    )
    if comparison.notes:
        page.heading("Mind").items(comparison.notes)
    add_quality(page, comparison)
    _add_parameters(page, comparison)
    _add_speed(page, comparison)
    _add_differences(page, comparison)
    if comparison.ablation:
        add_ablation(page, comparison.ablation)
    _add_unjudged_runs(page, comparison)
    _add_reading(page, comparison)
    return page


def _format_spread(spread: Spread, scale: float = 1.0) -> list[str]:
    """Best, quartiles and worst as cells."""
    return [
        format_number(x * scale, 4)
        for x in (spread.best, spread.lower, spread.median, spread.upper, spread.worst)
    ]


def add_quality(page: Report, comparison: Comparison) -> None:
    """Add where the runs ended."""
    page.heading("Where the runs ended")
    drawn = charts.draw_spread(comparison.variants, comparison.floor)
    page.chart(drawn, f"Objective {AT_END} of every run that finished. Dashed: the floor.")
    columns = [
        "variant",
        "runs",
        "failed",
        "best",
        "lower quartile",
        "median",
        "upper quartile",
        "worst",
        "at floor",
    ]
    rows = [
        [
            s.name,
            str(s.runs),
            str(s.failures),
            *_format_spread(s.objective),
            f"{s.at_floor:.0%}",
            _share(s.in_valley),
        ]
        for s in comparison.summaries
    ]
    floor = f"the floor, {format_number(comparison.floor.value, 5)} pu² ({comparison.floor.source})"
    page.table(
        [*columns, "in its valley"],
        rows,
        f"Objective of Eq. (8) [pu²] {AT_END}. At floor: share of runs within {FLOOR_SHARE:.0%} of"
        f" {floor}. In its valley: share of the finished runs from whose end least squares reach"
        " it.",
    )
    for name in ("epsilon_p", "epsilon_q"):
        rows = [[s.name, *_format_spread(getattr(s, name), 100.0)] for s in comparison.summaries]
        with page.fold_blocks(f"{name} of Eq. (20)"):
            page.table(["variant", *columns[3:-1]], rows, f"{name} {AT_END}, in percent.")


def _share(value: float | None) -> str:
    """A share in percent; "-" for none."""
    return "-" if value is None else f"{value:.0%}"


def _add_parameters(page: Report, comparison: Comparison) -> None:
    """Every run's parameters against the floor's; nothing where the problem could not
    be put again.
    """
    polished = comparison.polished
    if polished is None or not polished.reached:
        return
    page.heading("The parameters of every run")
    drawn = charts.draw_parameters(comparison.variants, polished)
    inside = sum(polished.in_valley(run) is True for run in polished.reached)
    page.chart(
        drawn,
        f"Parameters {AT_END}, each axis as wide as the runs scatter; dashed: those of the lowest"
        f" objective, {format_number(polished.objective, 5)} pu². Least squares from where they"
        f" ended lead {inside} of {len(polished.reached)} runs there, and the others to higher"
        " valleys.",
    )
    rows = [
        [
            name,
            polished.units[name],
            format_number(value, 4),
            *(format_number(bound, 4) for bound in polished.bounds[name]),
        ]
        for name, value in polished.parameters.items()
    ]
    with page.fold_blocks("the values of the lowest objective"):
        page.table(["parameter", "unit", "value", "lower bound", "upper bound"], rows)


def _add_speed(page: Report, comparison: Comparison) -> None:
    """Add how fast the variants reach the targets."""
    page.heading("How fast")
    goals = [f"{target:g} x floor" for target in comparison.targets]
    columns = [
        "variant",
        "simulations",
        *(f"{g} [simulations]" for g in goals),
        *(f"{g} [s]" for g in goals),
    ]
    rows = [
        [
            s.name,
            format_number(s.simulations.median),
            *map(format_number, np.round(s.ert["simulations"]).tolist()),
            *map(format_number, s.ert["seconds"]),
        ]
        for s in comparison.summaries
    ]
    few = len(comparison.summaries) <= charts.TOGETHER
    for by in ("simulations", "iterations"):
        lines = "the median and the quartiles" if few else "the median"
        caption = f"Best objective by {by}: {lines}."
        costs = " An iteration may cost several populations." if by == "iterations" else ""
        _draw_variants(
            page,
            comparison,
            charts.draw_fitness(comparison.variants, by, comparison.floor),
            caption + costs,
        )
    caption = (
        f"Runtimes: the share of {charts.describe_targets()} reached by all runs, by simulations."
    )
    _draw_variants(
        page, comparison, charts.draw_ecdf(comparison.variants, comparison.floor), caption
    )
    page.table(
        columns,
        rows,
        "Median of all simulations made, and expected running time (ERT) to each target: what all"
        " runs spent until they reached it, those that did not all they had, per run that did.",
    )


def _draw_variants(
    page: Report, comparison: Comparison, drawn: tuple[Chart, list[Chart]], caption: str
) -> None:
    """Add a chart of all variants, the first of `drawn`, and folded away one for each, the others;
    there are some only where variants are more than colors.
    """
    whole, each = drawn
    about_colors = (
        f" In color the first {charts.TOGETHER}; gray ones are named when pointed at."
        if each
        else ""
    )
    page.chart(whole, caption + about_colors)
    if each:
        with page.fold_blocks("each variant in a chart of its own"):
            page.charts(each, f"In gray: {comparison.summaries[0].name}.")


def _add_differences(page: Report, comparison: Comparison) -> None:
    """Add which differences are more than chance."""
    page.heading("Is the difference more than chance?")
    if comparison.ranks:
        page.text(claims.describe_friedman_test(comparison))
        page.chart(
            charts.draw_mean_ranks(comparison.ranks),
            "Mean ranks over seeds, with half of Nemenyi's critical difference to either side:"
            " variants whose bars do not overlap differ significantly at"
            f" {SIGNIFICANCE_LEVEL:.0%}.",
        )
    if not comparison.pairs:
        return
    main, rest = claims.split_pairs(comparison)
    _add_pairs(page, main)
    if rest:
        with page.fold_blocks(
            f"the other {len(rest)} pairs" if len(rest) > 1 else "the other pair"
        ):
            _add_pairs(page, rest)
    sentences = [claims.quote_pair(comparison, pair) for pair in (*main, *rest)]
    page.heading("To quote", 3).items(sentences[:MOST_OPEN_SENTENCES])
    if sentences[MOST_OPEN_SENTENCES:]:
        with page.fold_blocks(f"{len(sentences) - MOST_OPEN_SENTENCES} more sentences"):
            page.items(sentences[MOST_OPEN_SENTENCES:])


def _add_pairs(page: Report, pairs: list[VariantPair]) -> None:
    """Add the table of tested pairs."""
    rows = [
        [
            pair.first,
            pair.second,
            str(pair.seeds),
            *map(format_number, pair.medians),
            *map(format_p_value, (pair.p, pair.corrected)),
            f"{pair.effect:.2f}",
            describe_effect_size(pair.effect),
            "yes" if pair.significant else "no",
        ]
        for pair in pairs
    ]
    page.table(
        [
            "lower",
            "higher",
            "seeds",
            "median",
            "median",
            "p",
            "p (Holm)",
            "A",
            "effect",
            "significant",
        ],
        rows,
        "p: Wilcoxon signed-rank test over paired seeds, two-sided, as it is and after Holm's"
        " correction. A: probability that a run of the first ends lower than one of the second"
        " (Vargha-Delaney).",
        words=(1, 8),
    )


def add_ablation(page: Report, ablation: Ablation) -> None:
    """Add the tables of an ablation: by which factor the objective changes where a switch of an
    optimizer is on, how that depends on how many others are, and on each other one.
    """
    page.heading("What each ingredient does")
    page.items([claims.describe_effect(effect) for effect in ablation.effects])
    columns = ["switched on", "factor", "from", "to", "seeds", "shown", "contrasts"]
    groups = (
        (
            ablation.effects,
            "Main effects: the factor by which the objective is multiplied; below 1 it is lowered.",
        ),
        (ablation.company, WITH_MOST_ON),
        (ablation.interactions, INTERACTIONS),
    )
    for effects, caption in groups:
        rows = [
            [
                *format_factor(e),
                str(e.seeds),
                "yes" if e.is_significant else "no",
                str(len(e.contrasts)),
            ]
            for e in effects
        ]
        if rows:
            page.table(columns, rows, f"{caption} 95 % bootstrap intervals over seeds.")
    if unknown := claims.describe_untold_effects(ablation):
        page.text(unknown)


def format_factor(effect: SwitchEffect) -> list[str]:
    """The switches and what they multiply the objective by, with its interval."""
    return [
        " with ".join(effect.switches),
        *map(format_number, (effect.factor, effect.low, effect.high)),
    ]


def _add_unjudged_runs(page: Report, comparison: Comparison) -> None:
    """Add the runs that failed or were interrupted."""
    for title, rows in zip(
        ("Failures", "Interrupted: not judged"), _list_runs_without_result(comparison), strict=True
    ):
        if rows:
            page.heading(f"{title}: {len(rows)}")
            page.table(
                ["variant", "seed", "job", "because"],
                [[str(v) for v in row.values()] for row in rows],
                words=(2, 3),
            )


def _list_runs_without_result(comparison: Comparison) -> list[list[dict[str, Any]]]:
    """The runs that failed, and those that were interrupted: variant, seed, job and why."""
    failed = [
        (v.name, run, run.failure) for v in comparison.variants for run in v.runs if run.failure
    ]
    interrupted = [(name, run, run.interruption) for name, run in comparison.gathered.interrupted]
    return [
        [
            {"variant": name, "seed": run.seed, "job": run.where, "message": why}
            for name, run, why in rows
        ]
        for rows in (failed, interrupted)
    ]


def _add_reading(page: Report, comparison: Comparison) -> None:
    """Add how the page is read."""
    page.heading("How to read this page").items(
        [
            f"Objectives within {comparison.ties:g} of the floor count as equal in the tests: what"
            " is left there is rounding, not quality. The tables show them as they are.",
            "A failed run counts as worse than any other in the tests; its budget counts as spent"
            " in the ERT; quartiles and curves are those of the finished runs. An interrupted run"
            " counts as nothing.",
            "The optimizer is judged by where its own search ended. An identification goes on from"
            " there: its estimate is polished by least squares from several starts, and mostly the"
            " same whichever optimizer is taken.",
            "A target counts as reached at the end of the iteration in which it was, so running"
            " times are at most one iteration too long.",
            "Not significant means that these runs do not show a difference, not that there is"
            " none.",
            "Wilcoxon 1945; Holm 1979; Vargha and Delaney 2000; Friedman 1937 and Nemenyi 1963"
            " after Demsar 2006; ERT after Hansen et al. 2021 (COCO); bootstrap intervals after"
            " Efron 1979.",
        ]
    )


def build_content(comparison: Comparison, source: str) -> dict[str, Any]:
    """The content of `comparison.json`: every number of the page. What is not finite is None."""
    failed, interrupted = _list_runs_without_result(comparison)
    polished = comparison.polished
    return files.make_plain(
        {
            "source": source,
            "problem": comparison.gathered.problem,
            "values": f"objectives, errors and parameters are those {AT_END}",
            "answer": claims.answer(comparison),
            "floor": {
                **asdict(comparison.floor),
                "parameters": polished.parameters if polished else None,
            },
            "targets": comparison.targets,
            "ties": comparison.ties,
            "variants": comparison.summaries,
            "runs": [
                _describe_run(variant, run, comparison)
                for variant in comparison.variants
                for run in variant.finished_runs
            ],
            "pairs": [
                asdict(pair) | {"significant": pair.significant} for pair in comparison.pairs
            ],
            "ranks": comparison.ranks,
            "ablation": comparison.ablation,
            "sentences": claims.list_claims(comparison),
            "notes": comparison.notes,
            "failures": failed,
            "interrupted": interrupted,
        }
    )


def _describe_run(variant: Variant, run: SearchRun, comparison: Comparison) -> dict[str, Any]:
    """The entry of a run in `comparison.json`."""
    inside = comparison.polished.in_valley(run) if comparison.polished else None
    fields = {
        key: getattr(run, key)
        for key in ("seed", "objective", "epsilon_p", "epsilon_q", "parameters")
    }
    return {
        "variant": variant.name,
        **fields,
        "simulations": run.simulations[-1],
        "in_valley": inside,
    }
