"""The whole comparison: summaries, tests over paired seeds, ranks, the ablation, and what may be
said of them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tractexp.studies.comparison.ablation import Ablation, ablate
from tractexp.studies.comparison.floor import Floor, Polished, find_floor
from tractexp.studies.comparison.runs import Gathered, Variant
from tractexp.studies.comparison.statistics import (
    LEAST_SEEDS,
    SIGNIFICANCE_LEVEL,
    Ranks,
    compute_vargha_delaney,
    correct_by_holm,
    rank_by_friedman,
    run_wilcoxon_test,
)
from tractexp.studies.comparison.summary import Summary, summarize


@dataclass(frozen=True)
class VariantPair:
    """Two variants over the seeds both have, the one that ends lower first."""

    first: str
    second: str
    seeds: int
    medians: tuple[float, float]  # objective, failures counted as inf
    p: float  # Wilcoxon signed-rank, two-sided
    corrected: float  # p after Holm's correction over all pairs tested
    # Vargha-Delaney A: the probability that a run of `first` ends lower than one of `second`
    effect: float

    @property
    def significant(self) -> bool:
        """Whether the two differ by more than chance, corrected for all pairs."""
        return self.corrected < SIGNIFICANCE_LEVEL


@dataclass(frozen=True, eq=False)
class Comparison:
    """The content of `comparison.json` and `comparison.html`. Summaries: lowest median first, of
    equal ones fastest.
    """

    gathered: Gathered
    floor: Floor
    polished: Polished | None  # None where the problem of the runs could not be put again
    targets: tuple[float, ...]  # multiples of the floor
    ties: float  # objectives within this share of the floor are equal
    summaries: tuple[Summary, ...]
    pairs: tuple[VariantPair, ...]
    ranks: Ranks | None
    ablation: Ablation | None
    reference: str | None
    notes: tuple[str, ...]

    @property
    def variants(self) -> list[Variant]:
        """In the order of the summaries."""
        return [self.gathered[summary.name] for summary in self.summaries]

    @property
    def leaders(self) -> list[str]:
        """The variants whose median objective is lowest, equal ones together, the fastest first."""
        least = max(self.summaries[0].objective.median, (1 + self.ties) * self.floor.value)
        return [summary.name for summary in self.summaries if summary.objective.median <= least]


def compare(
    gathered: Gathered,
    *,
    targets: Sequence[float],
    ties: float,
    floor: float | None = None,
    reference: str | None = None,
    plain: Mapping[str, str] | None = None,
    polished: Polished | None = None,
    why_not: str = "",
) -> Comparison:
    """Compare variants; with a `reference`, only its pairs are tested. `plain`: see
    `ablation.ablate`.

    `polished` gives the floor, unless `floor` does; `why_not` says why there is no such. A failed
    run counts as worse than any other. Raises `UserError` for an unknown reference.
    """
    if reference is not None:
        reference = gathered[reference].name
    low = find_floor(
        [run for variant in gathered.variants for run in variant.runs], floor, polished, why_not
    )
    least = (1 + ties) * low.value
    summaries = [summarize(variant, low, targets, polished) for variant in gathered.variants]
    hardest = int(np.argmin(targets))
    summaries.sort(
        key=lambda s: (
            *_measure_standing(s.objective.median, least),
            s.ert["simulations"][hardest],
            s.name,
        )
    )
    pairs, notes = _test_pairs(gathered.variants, least, reference)
    ranks, more = _rank_variants(gathered.variants, least)
    ablation = ablate(gathered.variants, plain or {}, least)
    if floor is not None and polished is not None and polished.objective < (1 - ties) * floor:
        notes.append(
            f"task.floor={floor:g} lies above what least squares reach from many starts,"
            f" {polished.objective:.5g} pu²."
        )
    everything = (*gathered.notes, *notes, *more)
    return Comparison(
        gathered,
        low,
        polished,
        tuple(targets),
        ties,
        tuple(summaries),
        pairs,
        ranks,
        ablation,
        reference,
        everything,
    )


def count_seeds_needed(pairs: int) -> int:
    """The fewest seeds by which a difference can pass Wilcoxon's test where so many pairs are
    corrected for.
    """
    return int(np.floor(np.log2(2 * pairs / SIGNIFICANCE_LEVEL))) + 1 if pairs else LEAST_SEEDS


def _measure_standing(median: float, least: float) -> tuple[bool, float]:
    """The key by which variants are ranked: nan last, medians below the least count as that."""
    return bool(np.isnan(median)), max(median, least)


def _test_pairs(
    variants: Sequence[Variant], least: float, reference: str | None
) -> tuple[tuple[VariantPair, ...], list[str]]:
    """Every pair with enough seeds in common, and a sentence on what the tests cannot do."""
    if len(variants) < 2:
        return (), [f"There is one variant only, {variants[0].name}: nothing to test it against."]
    chosen = [(a, b) for a, b in combinations(variants, 2) if reference in (None, a.name, b.name)]
    common = [sorted({*a.objectives} & {*b.objectives}) for a, b in chosen]

    notes = _describe_untested(chosen, common)
    tested = [
        _test_pair(a, b, seeds, least)
        for (a, b), seeds in zip(chosen, common, strict=True)
        if len(seeds) >= LEAST_SEEDS
    ]
    corrected = correct_by_holm([pair.p for pair in tested])
    pairs = [
        VariantPair(**{**vars(pair), "corrected": float(p)})
        for pair, p in zip(tested, corrected, strict=True)
    ]
    notes += _describe_lack_of_seeds(tested)
    return tuple(sorted(pairs, key=lambda pair: (pair.corrected, pair.first, pair.second))), notes


def _describe_untested(
    pairs: Sequence[tuple[Variant, Variant]], common: Sequence[Sequence[int]]
) -> list[str]:
    """A sentence on the pairs with too few seeds in `common`; [] where there are none."""
    few = sum(len(seeds) < LEAST_SEEDS for seeds in common)
    if not few:
        return []
    seeds, pair = min(zip(common, pairs, strict=True), key=lambda row: len(row[0]))
    names = " and ".join(variant.name for variant in pair)
    return [
        f"{few} of {len(pairs)} pairs were not tested, for want of seeds: {names} have {len(seeds)}"
        f" in common, and the Wilcoxon signed-rank test needs at least {LEAST_SEEDS} to reach"
        f" {SIGNIFICANCE_LEVEL:.0%}; run more, such as 'seed=range(0,30)'."
    ]


def _describe_lack_of_seeds(tested: Sequence[VariantPair]) -> list[str]:
    """A sentence on pairs that are too many to be told apart by so few seeds; [] where they are
    not.
    """
    needed = count_seeds_needed(len(tested))
    if max((pair.seeds for pair in tested), default=needed) >= needed:
        return []
    return [
        f"With {len(tested)} pairs corrected for, fewer than {needed} seeds can show no difference"
        f" at {SIGNIFICANCE_LEVEL:.0%}, however large: run more seeds, or test against one variant"
        " by task.reference=NAME."
    ]


def _test_pair(a: Variant, b: Variant, seeds: Sequence[int], least: float) -> VariantPair:
    """The test of two variants by seed, the better one first."""
    x, y = (np.maximum([v.objectives[seed] for seed in seeds], least) for v in (a, b))
    p, lower = run_wilcoxon_test(x, y)
    effect = compute_vargha_delaney(x, y)
    if (lower, effect) < (0.0, 0.5):
        a, b, x, y, effect = b, a, y, x, 1 - effect
    return VariantPair(
        a.name, b.name, len(seeds), (_find_median(a, seeds), _find_median(b, seeds)), p, p, effect
    )


def _find_median(variant: Variant, seeds: Sequence[int]) -> float:
    """The median objective of a variant; of an even number the mean of the two in the middle."""
    values = np.sort([variant.objectives[seed] for seed in seeds])
    middle = values[(len(values) - 1) // 2], values[len(values) // 2]
    return float(middle[0] if middle[0] == middle[1] else np.mean(middle))


def _rank_variants(variants: Sequence[Variant], least: float) -> tuple[Ranks | None, list[str]]:
    """Friedman's test over the seeds that all variants have."""
    if len(variants) < 3:
        return None, []
    seeds = sorted(set.intersection(*({*variant.objectives} for variant in variants)))
    if len(seeds) < LEAST_SEEDS:
        return None, [
            f"The variants were not ranked: they have {len(seeds) or 'no'}"
            f" {'seed' if len(seeds) == 1 else 'seeds'} in common, and Friedman's test with its"
            f" critical difference needs at least {LEAST_SEEDS}."
        ]
    table = np.array([[max(v.objectives[seed], least) for v in variants] for seed in seeds])
    return rank_by_friedman([v.name for v in variants], table), []
