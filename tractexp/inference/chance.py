"""What chance alone does to the tests: the fit's own noise drawn again and put through the same
projection.

Thresholds hold for the largest of all candidates at once, and for the error of the noise's
estimate: each draw is as much louder or quieter as the quiet samples may have told its level wrong.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from tractexp.inference import residual_statistics
from tractexp.inference.context import Context
from tractexp.inference.cores import map_on_cores
from tractexp.inference.goodness_of_fit import (
    ADEQUATE_P,
    NULL_DRAWS,
    SMALLEST_P,
    Scale,
    compare_with_draws,
)
from tractexp.inference.linearization import Linearization
from tractexp.inference.score_test import ScoreTest
from tractexp.noise import Noise
from tractexp.text.wording import format_probability

# Variance from noise of the voltage, over that of the power, from which faults of the measurement
# are not judged: whatever smooths the calculated power would seem to be there.
BLURRED = 0.5
SCALE_DRAW_FACTOR = 10  # times as many are drawn for the scales alone


def format_drawn_p(p: float) -> str:
    """A probability as a sentence tells it, no finer than 199 draws can.

    The tail of the statistics is extrapolated, so that a smaller number would say more than is
    known; but that it is below the threshold of a decision is told.

    Examples
    --------
    >>> format_drawn_p(0.03), format_drawn_p(0.004), format_drawn_p(1e-6)
    ('0.03', 'less than 0.005', 'less than 0.001')
    """
    least = 1 / (NULL_DRAWS + 1)
    if p >= least:
        return format_probability(p)
    return f"less than {ADEQUATE_P if p < ADEQUATE_P else least:g}"


@dataclass(frozen=True, eq=False)
class Chance:
    """The null distribution of the tests of one fit: what they are where nothing but noise is left.

    Attributes
    ----------
    least_p : (b,)
        The smallest p of any candidate or fault of the measurement, of each of b draws.
    left : {name: (b,) or (b, k)}
        The statistics of what is left, by test.
    scales : {name: Scale}
        What columns are measured in, of the statistics of which the largest counts and whose scale
        is known from more draws.
    """

    least_p: np.ndarray
    left: dict[str, np.ndarray]
    # of the statistics that have exact ones
    scales: Mapping[str, Scale] = field(default_factory=dict)

    def critical_p(self, alpha: float) -> float:
        """The p below which a single candidate stands out of all of them.

        Parameters
        ----------
        alpha : float
            Probability that chance alone undercuts it with any candidate.

        Returns
        -------
        float
        """
        return float(np.quantile(self.least_p, alpha, method="lower"))

    def surprises(self, projection: ScoreTest, context: Context) -> dict[str, float]:
        """{test: p}: how often chance leaves as much as a fit does."""
        return compare_with_draws(projection.statistics(context.problem), self.left, self.scales)


def draw_chance(t: Linearization, own: ScoreTest, noise: Noise, seed: int) -> Chance:
    """Draw the null distribution of every statistic at a fit.

    A fault of the measurement counts where the noise of the voltage is not loud.

    Parameters
    ----------
    t : Linearization
        All differences at the fit.
    own : ScoreTest
        The projection of the fit under this noise.
    noise : Noise
        That of the records.
    seed : int
        The same seed gives the same draws.

    Returns
    -------
    Chance
        Of `NULL_DRAWS` draws.
    """
    rng = np.random.default_rng(seed)
    white = _draw_white(t, noise, rng)
    levels = noise.draw_levels(rng, NULL_DRAWS, t.context.problem.quiet)
    projection = own.replace_residuals(white / levels[:, None])
    p = projection.least_p
    if noise.loudest_input_mode <= BLURRED:
        faults = np.array(list(projection.fault_p().values())).reshape(-1, len(p))
        p = np.maximum(np.minimum(p, faults.min(axis=0, initial=1.0)), SMALLEST_P)
    return Chance(p, projection.statistics(t.context.problem))


def draw_scales(t: Linearization, own: ScoreTest, noise: Noise, seed: int) -> dict[str, Scale]:
    """Scales of the statistics of which the largest counts, by `SCALE_DRAW_FACTOR` times as many
    draws.

    The scale of the column that turns out largest is the one most likely to be too small. By the
    draws of a `Chance` alone it is a tenth off, and a p of 1e-3 comes out as anything from 1e-4 to
    1e-2.

    Parameters
    ----------
    t : Linearization
        All differences at the fit.
    own : ScoreTest
        The projection of the fit under this noise.
    noise : Noise
        That of the records; it is taken as known.
    seed : int
        The same seed gives the same draws.

    Returns
    -------
    {name: Scale}
        By test.
    """

    def part(k: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        drawn = own.replace_residuals(_draw_white(t, noise, np.random.default_rng((seed, k))))
        by_test = residual_statistics.compute_residual_statistics(
            drawn.channels(t.context.problem), t.context.problem
        )
        return {
            name: (values.mean(axis=0), (values**2).mean(axis=0))
            for name, values in by_test.items()
        }

    parts = map_on_cores(part, range(1, SCALE_DRAW_FACTOR + 1), t.context.effort)
    moments = {name: np.mean([p[name] for p in parts], axis=0) for name in parts[0]}
    return {
        name: Scale(mean, np.sqrt(square - mean**2) + 1e-12)
        for name, (mean, square) in moments.items()
    }


def _draw_white(t: Linearization, noise: Noise, rng: np.random.Generator) -> np.ndarray:
    """Whitened noise (b, C N) of the events."""
    return noise.draw_white(rng, NULL_DRAWS, t.context.drive, t.context.valid)
