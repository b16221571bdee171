"""Tests, effect sizes and running times. Lower values are better throughout; inf is a failed run,
the worst.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

SIGNIFICANCE_LEVEL = 0.05
BOOTSTRAP_DRAWS = 4000
LEAST_SEEDS = 6  # two-sided, Wilcoxon's smallest p is 2 / 2^n: below 0.05 from 6 pairs up


def compute_vargha_delaney(a: np.ndarray, b: np.ndarray) -> float:
    """The probability that a value of `a` is lower than one of `b`, ties counting half: 0.5 is no
    difference.

    Source: Vargha and Delaney 2000, Eq. (1), with the sign of a minimization.
    """
    a, b = np.asarray(a, dtype=float)[:, None], np.asarray(b, dtype=float)[None, :]
    return float(np.mean((a < b) + 0.5 * (a == b)))


def describe_effect_size(effect: float) -> str:
    """Vargha and Delaney's words for an A: 0.56 small, 0.64 medium, 0.71 large, on either side of
    0.5.
    """
    distance = abs(effect - 0.5)
    return ["negligible", "small", "medium", "large"][
        int(np.searchsorted((0.06, 0.14, 0.21), distance + 1e-12))
    ]


def correct_by_holm(p: Sequence[float]) -> np.ndarray:
    """Holm's step-down correction of p-values (m,). Source: Holm 1979."""
    values = np.asarray(p, dtype=float)
    order = np.argsort(values, kind="stable")
    corrected = np.empty(len(values))
    corrected[order] = np.minimum(
        np.maximum.accumulate(values[order] * np.arange(len(values), 0, -1)), 1.0
    )
    return corrected


def run_wilcoxon_test(a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
    """Two-sided p of the signed-rank test on pairs (n,) each, and the rank sum where `a` is lower
    minus the reverse.

    Equal pairs say nothing and are dropped, as Wilcoxon 1945 did. No unequal pair: p = 1.
    """
    from scipy import stats

    a, b = replace_infinite(np.asarray(a, dtype=float), np.asarray(b, dtype=float))
    difference = (a - b)[a != b]
    if not len(difference):
        return 1.0, 0.0
    ranks = stats.rankdata(np.abs(difference))
    result: Any = stats.wilcoxon(difference)
    return float(result.pvalue), float(-np.sum(np.sign(difference) * ranks))


def replace_infinite(*samples: np.ndarray) -> list[np.ndarray]:
    """The samples with inf replaced by one number worse than all the others'."""
    together = np.concatenate(samples)
    values = together[np.isfinite(together)]
    worst = 2 * values.max() + 1 if len(values) else 0.0
    return [np.where(np.isfinite(sample), sample, worst) for sample in samples]


@dataclass(frozen=True)
class Ranks:
    """Friedman's test over complete blocks, and Nemenyi's comparison of the mean ranks."""

    names: tuple[str, ...]
    mean: tuple[float, ...]  # 1 is best
    seeds: int
    chi2: float
    p: float
    critical_difference: float
    # largest sets whose mean ranks differ by less than the critical difference
    groups: tuple[tuple[str, ...], ...]


def rank_by_friedman(names: Sequence[str], table: np.ndarray) -> Ranks:
    """Rank k >= 3 variants within each of N seeds; `table` is (N, k). The chi-square is corrected
    for ties.

    Source: Demsar 2006, section 3.2.
    """
    from scipy import stats

    table = replace_infinite(np.asarray(table, dtype=float).ravel())[0].reshape(np.shape(table))
    mean = stats.rankdata(table, axis=1).mean(axis=0)
    if (table == table[:, :1]).all():  # nothing but ties: SciPy divides by zero
        chi2, p = 0.0, 1.0
    else:
        chi2, p = map(float, stats.friedmanchisquare(*table.T))
    difference = compute_critical_difference(len(names), len(table))
    groups = group_indifferent(names, mean, difference)
    return Ranks(tuple(names), tuple(map(float, mean)), len(table), chi2, p, difference, groups)


def compute_critical_difference(
    variants: int, seeds: int, alpha: float = SIGNIFICANCE_LEVEL
) -> float:
    """Nemenyi's critical difference of mean ranks. Source: Demsar 2006, section 3.2."""
    from scipy import stats

    q = stats.studentized_range.ppf(1 - alpha, variants, np.inf) / np.sqrt(2)
    return float(q * np.sqrt(variants * (variants + 1) / (6 * seeds)))


def group_indifferent(
    names: Sequence[str], mean: Sequence[float], difference: float
) -> tuple[tuple[str, ...], ...]:
    """The largest sets of two or more neighbors in rank that are less than `difference` apart."""
    order = np.argsort(mean, kind="stable")
    ranks = np.asarray(mean, dtype=float)[order]
    ends = np.searchsorted(ranks, ranks + difference, side="left")
    groups, reached = [], 0
    for start, end in enumerate(ends):
        if end > max(reached, start + 1):
            groups.append(tuple(names[i] for i in order[start:end]))
        reached = max(reached, end)
    return tuple(groups)


def compute_expected_running_time(spent: np.ndarray, reached: np.ndarray) -> float:
    """ERT: all that was spent before the target, by failures all they had, per success; inf without
    a success.

    `spent` (n,) is the cost until the target where `reached` (n,), else the whole cost of the run.
    Source: Hansen et al. 2021, COCO, section on runtime, after Auger and Hansen 2005.
    """
    return float(np.sum(spent) / np.sum(reached)) if np.any(reached) else np.inf


def bootstrap_interval(values: np.ndarray) -> tuple[float, float]:
    """The percentile interval of the mean of `values` (n,). Source: Efron 1979."""
    rng = np.random.default_rng(0)
    values = np.asarray(values, dtype=float)
    means = values[rng.integers(0, len(values), (BOOTSTRAP_DRAWS, len(values)))].mean(axis=1)
    low, high = np.quantile(means, (0.025, 0.975))
    return float(low), float(high)
