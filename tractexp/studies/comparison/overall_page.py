"""Comparisons on several problems as one self-contained page for people, and as JSON
for machines.
"""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tractexp.blocks import Report, style
from tractexp.blocks.chart import Chart
from tractexp.storage import files
from tractexp.studies.comparison import charts
from tractexp.studies.comparison import overall_claims as claims
from tractexp.studies.comparison import page as one
from tractexp.studies.comparison.ablation import Ablation, SwitchEffect
from tractexp.studies.comparison.claims import format_number
from tractexp.studies.comparison.overall import Overall, Several
from tractexp.studies.comparison.statistics import SIGNIFICANCE_LEVEL

ROW = 26  # pixels of an effect in a chart
ALL = "all together"


def report(several: Several, source: str) -> Report:
    """The page; `source` says where the runs are from."""
    first = next(iter(several.comparisons.values()))
    runs = sum(summary.runs for c in several.comparisons.values() for summary in c.summaries)
    title = (
        f"Comparison of {len(first.summaries)} optimizers on {len(several.comparisons)} problems"
    )
    page = Report(title, f"{runs} runs of {source}. Objectives are those {one.AT_END}.")
    sentences = [
        claims.describe_agreement(several),
        *(claims.describe_mean_ranks(overall) for overall in several.overall),
    ]
    page.verdict(*(text for text in sentences if text))
    if several.notes:
        page.heading("Mind").items(several.notes)
    for overall in several.overall:
        _add_overall(page, overall)
    page.heading("Each problem by itself")
    for label, comparison in several.comparisons.items():
        with page.fold_blocks(label):
            one.add_quality(page, comparison)
            if comparison.ablation:
                one.add_ablation(page, comparison.ablation)
    return _add_reading(page)


def _add_overall(page: Report, overall: Overall) -> None:
    """Add what comes out over all problems."""
    page.heading(f"{overall.terms}: {overall.where}" if overall.terms else overall.where)
    if overall.ablation:
        page.text(claims.describe_switches(overall))
        what, over = (
            ("distance to the optimum", " over functions") if overall.share else ("objective", "")
        )
        page.chart(
            draw_effects(overall),
            f"The factor by which switching an ingredient on multiplies the {what}, with 95 %"
            f" bootstrap intervals{over}: left of 1 it helps.",
        )
        _add_effects(page, overall, overall.ablation)
    if overall.ranks:
        page.text(claims.describe_mean_ranks(overall))
        page.chart(
            charts.draw_mean_ranks(
                overall.ranks, f"mean rank within a {overall.block} (1 is best)"
            ),
            f"Mean ranks over {overall.ranks.seeds} blocks, one for each {overall.block}, with half"
            " of Nemenyi's critical difference to either side: variants whose bars do not overlap"
            f" differ significantly at {SIGNIFICANCE_LEVEL:.0%}.",
        )
    tell = (lambda x: f"{x:.0%}") if overall.share else (lambda x: format_number(x, 3))
    ranks = dict(zip(overall.ranks.names, overall.ranks.mean, strict=True)) if overall.ranks else {}
    rows = [
        [name, *([f"{ranks[name]:.2f}"] if ranks else []), *map(tell, values)]
        for name, values in overall.figures.items()
    ]
    columns = ["variant", *(["mean rank"] if ranks else []), *overall.columns]
    page.table(columns, rows, f"{overall.measure.capitalize()}, the best ranked first.")


def draw_effects(overall: Overall) -> Chart:
    """The main effects on each problem and on all together, a row for each, one color for each
    switch.
    """
    assert overall.ablation is not None
    groups: dict[str, Ablation] = {
        **(overall.each if len(overall.each) > 1 else {}),
        ALL: overall.ablation,
    }
    by_switch = {switch: _list_effects(groups, switch) for switch in overall.ablation.switches}
    rows = list(itertools.chain.from_iterable(by_switch.values()))
    chart = Chart("factor", [""], log_x=True, pixels=110 + ROW * len(rows), hover="closest")
    first = 0
    for k, (switch, own) in enumerate(by_switch.items()):
        if own:
            _add_switch(chart, switch, own, first, style.PALETTE[k % len(style.PALETTE)])
        first += len(own)
    chart.ticks(0, range(len(rows)), [label for label, _ in rows])
    ends = [bound for _, effect in rows for bound in (effect.low, effect.high)]
    low = min(0.9, *ends) / 1.02
    high = max(1.1, *ends) * 1.02
    chart.ticks(None, charts.round_numbers(low, high))
    return chart.limits(0, len(rows) - 0.4, -0.6).edge(1.0, dash="dash").limits(None, low, high)


def _list_effects(groups: Mapping[str, Ablation], switch: str) -> list[tuple[str, SwitchEffect]]:
    """(problem, what a switch does there by itself), of each problem that has it."""
    return [
        (label, effect)
        for label, ablation in groups.items()
        for effect in ablation.effects
        if effect.switches == (switch,)
    ]


def _add_switch(
    chart: Chart, switch: str, own: Sequence[tuple[str, SwitchEffect]], first: int, color: str
) -> None:
    """Draw what a switch does on each problem, in rows from the `first` on."""
    effects = [effect for _, effect in own]
    spans = np.array([(effect.low, effect.high) for effect in effects])
    labels = [f"{label}: {claims.describe_effect(effect)}" for label, effect in own]
    factors = [effect.factor for effect in effects]
    rows = list(range(first, first + len(own)))
    chart.points(switch, factors, rows, color, hover=labels, spans=spans)


def _add_effects(page: Report, overall: Overall, ablation: Ablation) -> None:
    """Add the table of what each switch does."""
    cost = overall.cost
    columns = ["switched on", "factor", "from", "to", "better in", "from", "to", "shown"]
    columns += ["simulations per iteration"] if cost else []
    rows = [_describe_effect(effect, cost) for effect in ablation.effects]
    page.table(
        columns,
        rows,
        f"Main effects over {ablation.effects[0].seeds} blocks, each from"
        f" {len(ablation.effects[0].contrasts)} pairs of variants that differ in that switch alone."
        " Better in: the share of these pairs in which the run with it ends lower; 50 % is no"
        " difference. 95 % bootstrap intervals."
        + (" Simulations per iteration: what switching on adds to the cost." if cost else ""),
    )
    if not (ablation.interactions or ablation.company):
        return
    columns = ["switched on", "factor", "from", "to", "shown"]
    with page.fold_blocks("interactions of pairs of ingredients"):
        for changes, caption in (
            (ablation.interactions, one.INTERACTIONS),
            (ablation.company, one.WITH_MOST_ON),
        ):
            page.table(columns, [_describe_interaction(effect) for effect in changes], caption)


def _describe_effect(effect: SwitchEffect, cost: Mapping[str, float]) -> list[str]:
    """A row of what a switch does by itself, and what it costs where that is known."""
    return [
        *one.format_factor(effect),
        *(f"{x:.0%}" for x in effect.better or ()),
        "yes" if effect.is_significant else "no",
        *([f"{cost[effect.switches[0]]:+.1f}"] if cost else []),
    ]


def _describe_interaction(effect: SwitchEffect) -> list[str]:
    """A row of what a switch does beside others, and whether that is shown."""
    return [*one.format_factor(effect), "yes" if effect.is_significant else "no"]


def _add_reading(page: Report) -> Report:
    """Add how the page is read."""
    return page.heading("How to read this page").items(
        [
            "Every problem has a floor of its own, the lowest objective that least squares reach;"
            " objectives are told in multiples of it, and count as equal where they are within"
            " rounding of it.",
            "Over several records an effect is the mean of its logarithm over the records, seed by"
            " seed; its interval says how much other seeds may change it, not other records. On"
            " BBOB the functions are drawn anew.",
            "Under equal simulations every search is laid out to end with its budget; under equal"
            " iterations it spends what its ingredients cost, which the table of effects tells.",
            "task=compare task.sweep=FOLDER task.data=NAME makes the whole page of one problem:"
            " curves, running times, every pair of variants, parameters.",
            "Friedman 1937 and Nemenyi 1963 after Demsar 2006; bootstrap intervals after Efron"
            " 1979; BBOB: Hansen, Finck, Ros and Auger 2009.",
        ]
    )


def build_content(several: Several, source: str) -> dict[str, Any]:
    """The content of `comparison.json`: each problem as if it were alone, and all together."""
    return files.make_plain(
        {
            "source": source,
            "answer": claims.answer(several),
            "sentences": claims.list_overall_claims(several),
            "notes": several.notes,
            "overall": several.overall,
            "problems": {
                label: one.build_content(c, source) for label, c in several.comparisons.items()
            },
        }
    )
