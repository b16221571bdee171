"""Goodness of fit: how often chance leaves as much as a fit does, by the statistics of its residual
(`residual_statistics`).

Sums of many parts (b,) have
a gamma tail, the largest of many (b, k) that of a Gumbel distribution, both with the moments of
draws under the null, so that the tails reach further than their number. Where noise has heavy
tails, so has the largest: that of a generalised extreme value distribution.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

NULL_DRAWS = 199  # of the noise, that a fit is compared with
# p of what a fit leaves, below which it leaves something. Chosen on calibration seeds: where
# nothing is missing one set in fifty has a smaller one, with an effect of four detection limits
# nearly all have.
ADEQUATE_P = 0.001
SMALLEST_P = 1e-300
# standard errors of its shape: once in 100 a Gumbel distribution passes for a heavier one
HEAVIER = 2.33
LEAST_DISTINCT_SHARE = 1e-3  # of the largest: weaker directions are rounding


@dataclass(frozen=True)
class GoodnessOfFit:
    """How often chance leaves as much as a fit does.

    Attributes
    ----------
    p_by_test : {name: p}
        By what each test looks for.
    """

    p_by_test: dict[str, float]

    @property
    def most_significant_test(self) -> str:
        """The name of the test with the smallest p."""
        return min(self.p_by_test, key=self.p_by_test.__getitem__)

    @property
    def p(self) -> float:
        """The p of the most significant test, multiplied by the number of tests, at most 1.

        Examples
        --------
        >>> GoodnessOfFit({"a step": 0.01, "an oscillation": 0.6}).p
        0.02
        """
        return min(1.0, len(self.p_by_test) * self.p_by_test[self.most_significant_test])


def compare_with_draws(
    values: Mapping[str, np.ndarray],
    draws: Mapping[str, np.ndarray],
    scales: Mapping[str, "Scale"] | None = None,
) -> dict[str, float]:
    """How often each statistic is as large among draws of it.

    Parameters
    ----------
    values : {name: (1,) or (1, k)}
        The statistics of a fit.
    draws : {name: (b,) or (b, k)}
        Those of draws under the null.
    scales : {name: Scale}
        What columns are measured in before the largest is taken; by default the draws' own.

    Returns
    -------
    {name: float}
        p of each.
    """
    scales = scales or {}
    return {
        name: compute_tail_p(draws[name], value, scales.get(name)) for name, value in values.items()
    }


class Scale(NamedTuple):
    """The mean (k,) and spread (k,) by which columns of a statistic are standardized before the
    largest is taken.
    """

    mean: np.ndarray
    spread: np.ndarray

    def largest(self, draws: np.ndarray) -> np.ndarray:
        """The largest (b,) of the standardized columns of draws (b, k).

        Examples
        --------
        >>> scale = Scale(np.array([1.0, 2.0]), np.array([1.0, 4.0]))
        >>> scale.largest(np.array([[4.0, 4.0]])).tolist()
        [3.0]
        """
        return ((draws - self.mean) / self.spread).max(axis=1)


def compute_tail_p(draws: np.ndarray, value: np.ndarray, scale: Scale | None = None) -> float:
    """How often a statistic is at least as large as a value, given draws of it.

    Parameters
    ----------
    draws : (b,) or (b, k)
        Under the null: a sum has a gamma tail, the largest of k columns an extreme value's.
    value : (1,) or (1, k)
        The statistic.
    scale : Scale
        What columns are measured in before the largest is taken; any is right, by default the
        draws' own is taken.

    Returns
    -------
    float
        p, never 0.

    Examples
    --------
    >>> draws = np.random.default_rng(1).chisquare(3, 2000)
    >>> round(compute_tail_p(draws, np.array([7.815])), 2)
    0.05
    """
    from scipy.special import gammaincc

    if draws.ndim == 1:
        mean = draws.mean()
        variance = max(draws.var(), 1e-300)
        return max(
            float(gammaincc(mean**2 / variance, max(value[0], 0.0) * mean / variance)), SMALLEST_P
        )
    scale, largest = find_extremes(draws) if scale is None else (scale, scale.largest(draws))
    return max(
        _compute_exceedance(largest, float(scale.largest(np.atleast_2d(value))[0])), SMALLEST_P
    )


def _compute_exceedance(largest: np.ndarray, value: float) -> float:
    """How often the largest of many exceeds a value, given draws (b,) of it.

    The tail is that of a Gumbel distribution by its moments, or, where the L-moments say that it is
    heavier, that of a generalized extreme value distribution by those. Source: Hosking, Wallis and
    Wood 1985, their estimates and their test.
    """
    from scipy.special import gamma

    b = len(largest)
    below = np.arange(len(largest))
    weights = np.ones(b), below / (b - 1), below * (below - 1) / ((b - 1) * (b - 2))
    first, once, twice = (float((w * np.sort(largest)).mean()) for w in weights)
    second = 2 * once - first
    third = 6 * twice - 6 * once + first
    c = 2 / (3 + third / max(second, 1e-12)) - np.log(2) / np.log(3)
    k = 7.859 * c + 2.9554 * c**2
    if k * np.sqrt(b / 0.5633) > -HEAVIER:
        width = max(largest.std() * np.sqrt(6) / np.pi, 1e-12)
        return float(-np.expm1(-np.exp(-(value - first) / width - np.euler_gamma)))
    width = second * k / ((1 - 2.0**-k) * gamma(1 + k))
    lower = first - width * (1 - gamma(1 + k)) / k
    reduced = max(1 - k * (value - lower) / width, 1e-12)
    return float(-np.expm1(-(reduced ** (1 / k))))


def find_extremes(draws: np.ndarray) -> tuple[Scale, np.ndarray]:
    """The scale of draws, and the largest of each in it.

    Each draw is judged by the others: among many columns its own part in their mean and spread
    would tell.

    Parameters
    ----------
    draws : (b, k)
        A statistic of k columns under the null.

    Returns
    -------
    Scale
        Of all draws.
    (b,) array
        The largest standardized column of each draw.
    """
    b, whole, squares = len(draws), draws.sum(axis=0), (draws**2).sum(axis=0)
    mean = (whole - draws) / (b - 1)
    spread = np.sqrt(np.maximum((squares - draws**2) / (b - 1) - mean**2, 0.0)) + 1e-12
    largest = ((draws - mean) / spread).max(axis=1)
    return Scale(draws.mean(axis=0), draws.std(axis=0) + 1e-12), largest
