"""Several problems at once: what comparisons under the same terms come to together, on records or
on BBOB.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tractexp.studies.comparison.ablation import Ablation, VariantFamily, find_family
from tractexp.studies.comparison.comparison import Comparison
from tractexp.studies.comparison.runs import SearchRun
from tractexp.studies.comparison.statistics import LEAST_SEEDS, Ranks, rank_by_friedman

if TYPE_CHECKING:
    from tractexp.studies.bbob.runs import BbobRuns

SOLVED = 1e-8  # a distance to the optimum of a BBOB function below which it counts as met


@dataclass(frozen=True, eq=False)
class Overall:
    """The ranks and effects of variants over several problems under the same terms. Lower figures
    are better unless `share`.
    """

    terms: str  # "15,000 simulations"
    where: str  # "3 records, 30 seeds each"
    block: str  # within which variants are ranked: "record and seed" or "function"
    columns: tuple[str, ...]  # the problems, or groups of them
    measure: str  # what the figures are
    # {variant: one for each column}, the best ranked first
    figures: Mapping[str, tuple[float, ...]]
    ranks: Ranks | None
    each: Mapping[str, Ablation]  # {problem: effects of the switches on it alone}
    ablation: Ablation | None  # on all of them
    cost: Mapping[str, float]  # simulations that each switch adds to an iteration
    share: bool = False  # whether the figures are shares


@dataclass(frozen=True, eq=False)
class Several:
    """Comparisons on several problems: each by itself, {name: ...}, and what they come
    to by terms.
    """

    comparisons: Mapping[str, Comparison]
    overall: tuple[Overall, ...]
    notes: tuple[str, ...]


def describe_limit(runs: Sequence[SearchRun]) -> str:
    """The limit that ended the searches: "15,000 simulations", "300 iterations", or "" where they
    had none in common.
    """
    budgets = {run.config.get("budget") for run in runs}
    if len(budgets) == 1 and (budget := budgets.pop()) is not None:
        return f"{int(budget):,} simulations"
    counts = {len(run.history) - 1 for run in runs if run.is_finished}
    return f"{int(*counts)} iterations" if len(counts) == 1 else ""


def merge_records(
    terms: str, comparisons: Mapping[str, Comparison], plain: Mapping[str, str]
) -> Overall:
    """The variants that were run on all of these problems, {name: comparison}; `plain` as in
    `ablation.family`.
    """
    first, *others = comparisons.values()
    variants = [v for v in first.gathered.variants if all(_has(other, v.name) for other in others)]
    names = [v.name for v in variants]
    logs = {label: _list_logs(comparison, names) for label, comparison in comparisons.items()}
    seeds = sorted(set.intersection(*(set(by_seed) for by_seed in logs.values())))
    table = np.array([by_seed[seed] for by_seed in logs.values() for seed in sorted(by_seed)])
    ranks = _rank_optimizers(names, table)
    chosen = find_family(variants, plain)
    whole = _ablate_mean(chosen, names, logs, seeds) if chosen and seeds else None
    medians = {
        name: tuple(_find_median_over_floor(c, name) for c in comparisons.values())
        for name in _order_names(names, ranks)
    }
    problems = f"{len(seeds)} seeds"
    if len(comparisons) > 1:
        problems = f"{len(comparisons)} records, {problems} each"
    names_of = _name_by_data(comparisons)
    return Overall(
        terms,
        problems,
        "record and seed",
        tuple(names_of.values()),
        "median objective over the floor",
        medians,
        ranks,
        {names_of[label]: c.ablation for label, c in comparisons.items() if c.ablation},
        whole,
        _find_cost(chosen, comparisons.values()),
    )


def _ablate_mean(
    chosen: VariantFamily,
    names: Sequence[str],
    logs: Mapping[str, Mapping[int, list[float]]],
    seeds: Sequence[int],
) -> Ablation | None:
    """The effects of the switches on the mean over all problems, seed by seed; None where no
    contrast can be made.
    """
    mean = np.mean([[by_seed[seed] for seed in seeds] for by_seed in logs.values()], axis=0)
    return chosen.ablation(dict(zip(names, mean.T, strict=True)))


def _find_median_over_floor(comparison: Comparison, name: str) -> float:
    """The median objective of a variant's runs, over the floor."""
    objectives = [run.objective for run in comparison.gathered[name].runs]
    return float(np.median(objectives) / comparison.floor.value)


def _name_by_data(comparisons: Mapping[str, Comparison]) -> dict[str, str]:
    """{label: name} of comparisons: their data where these differ, else their labels."""
    data = [comparison.gathered.variants[0].runs[0].data for comparison in comparisons.values()]
    if len({*data}) < len(data):
        return {label: label for label in comparisons}
    return dict(zip(comparisons, data, strict=True))


def rank_on_functions(benchmark: "BbobRuns", chosen: VariantFamily | None) -> Overall:
    """The variants on BBOB: distances to the optimum, a function being one block; the family's
    effects on them.
    """
    (dimension,), plan = benchmark.plan.dimensions, benchmark.plan
    names = list(benchmark.optimizers)
    table = np.array(
        [
            [
                np.mean(
                    [
                        np.log10(max(run.distance, SOLVED))
                        for run in benchmark.select_runs(name, dimension, [f])
                    ]
                )
                for name in names
            ]
            for f in plan.functions
        ]
    )
    ranks = _rank_optimizers(names, table)
    groups = {"all": plan.functions, **benchmark.groups()}
    shares = {
        name: tuple(benchmark.share(name, dimension, functions) for functions in groups.values())
        for name in _order_names(names, ranks)
    }
    whole = chosen.ablation(dict(zip(names, table.T, strict=True))) if chosen else None
    return Overall(
        f"{plan.multiplier * dimension:,} evaluations",
        f"BBOB: {len(plan.functions)} functions in dimension {dimension}, {len(plan.instances)}"
        " instances each",
        "function",
        tuple(groups),
        "share of the targets met",
        shares,
        ranks,
        {},
        whole,
        {},
        share=True,
    )


def _has(comparison: Comparison, name: str) -> bool:
    """Whether a comparison has a variant of that name."""
    return name in (variant.name for variant in comparison.gathered.variants)


def _list_logs(comparison: Comparison, names: Sequence[str]) -> dict[int, list[float]]:
    """{seed: log10 of each variant's objective over the floor}, of the seeds that all finished."""
    least = (1 + comparison.ties) * comparison.floor.value
    variants = [comparison.gathered[name] for name in names]
    seeds = (
        set.intersection(*({run.seed for run in v.finished_runs} for v in variants))
        if variants
        else set()
    )
    return {
        s: [float(np.log10(max(v.objectives[s], least) / comparison.floor.value)) for v in variants]
        for s in sorted(seeds)
    }


def _rank_optimizers(names: Sequence[str], table: np.ndarray) -> Ranks | None:
    """Friedman's ranks of a table (blocks, variants); None for too few."""
    return rank_by_friedman(names, table) if len(names) > 2 and len(table) >= LEAST_SEEDS else None


def _order_names(names: Sequence[str], ranks: Ranks | None) -> list[str]:
    """Names by their mean rank, as they are without ranks."""
    return (
        sorted(names, key=dict(zip(ranks.names, ranks.mean, strict=True)).__getitem__)
        if ranks
        else list(names)
    )


def _find_cost(chosen: VariantFamily | None, comparisons: Iterable[Comparison]) -> dict[str, float]:
    """The simulations of an iteration that each switch adds, {switch: number}."""
    if chosen is None:
        return {}
    each: dict[str, list[float]] = {name: [] for name in chosen.members.values()}
    for comparison in comparisons:
        for name, rates in each.items():
            rates += [
                float((run.simulations[-1] - run.simulations[0]) / (len(run.history) - 1))
                for run in comparison.gathered[name].finished_runs
                if len(run.history) > 1
            ]
    return chosen.cost({name: float(np.mean(rates)) for name, rates in each.items()})
