"""A sample of the posterior, to confirm intervals where the likelihood is no parabola. Needs the
extra [posterior].
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tractexp.errors import TASK, UserError, setting
from tractexp.identification.uncertainty import Uncertainty
from tractexp.inference.interval import INTERVAL_LEVEL
from tractexp.text.progress import Counting, make_silent_counter

BURN = 0.3  # of the steps are thrown away
ENOUGH = 50.0  # autocorrelation times that a chain should last (emcee's own advice)


@dataclass(frozen=True, eq=False)
class PosteriorSample:
    """Draws (n, d) of the free parameters under a flat prior within their bounds."""

    names: tuple[str, ...]
    draws: np.ndarray
    steps: int
    autocorrelation: float  # steps, the largest over the coordinates
    acceptance: float
    simulations: int

    @property
    def intervals(self) -> np.ndarray:
        """(d, 2) between the outer quantiles."""
        tails = (1 - INTERVAL_LEVEL) / 2
        return np.quantile(self.draws, [tails, 1 - tails], axis=0).T

    @property
    def has_converged(self) -> bool:
        """Whether the chains are `ENOUGH` times as long as what they remember."""
        return self.steps >= ENOUGH * self.autocorrelation


def sample(
    uncertainty: Uncertainty,
    walkers: int,
    steps: int,
    seed: int,
    parts: Callable[[int], Counting] = make_silent_counter,
) -> PosteriorSample:
    """Goodman and Weare's affine-invariant ensemble (emcee), all walkers of a half-step in one
    simulation call.

    P0 and Q0 of each event are sampled along; `parts` counts the steps. Raises `UserError` where
    emcee is missing.
    """
    try:
        import emcee
    except ImportError:
        raise UserError(
            f"{setting('task=posterior')} needs emcee; install it by: pip install"
            " 'tractexp[posterior]'"
        ) from None
    likelihood, d = uncertainty.likelihood, len(uncertainty.unit)
    if walkers < 2 * d:
        raise UserError(
            f"{TASK.walkers}={walkers} is too few: {d} coordinates need at least {2 * d}"
        )

    def log_probability(unit: np.ndarray) -> np.ndarray:
        outside = ((unit < 0) | (unit > 1)).any(axis=1)
        rows = likelihood.rows(np.clip(unit, 0, 1))
        value = -0.5 * np.einsum("nr,nr->n", rows, rows)
        return np.where(outside | ~np.isfinite(value), -np.inf, value)

    rng = np.random.default_rng(seed)
    start = np.clip(
        uncertainty.unit + _spread(uncertainty) * rng.standard_normal((walkers, d)), 1e-6, 1 - 1e-6
    )
    start[~np.isfinite(log_probability(start))] = np.clip(uncertainty.unit, 1e-6, 1 - 1e-6)
    start = np.clip(start + 1e-7 * rng.standard_normal(start.shape), 0, 1)
    sampler = emcee.EnsembleSampler(walkers, d, log_probability, vectorize=True)
    sampler.random_state = np.random.RandomState(seed).get_state()
    with parts(steps) as ended:
        for _ in sampler.sample(start, iterations=steps):
            ended()
    chain = np.asarray(sampler.get_chain(discard=int(BURN * steps), flat=True))
    time = float(np.max(sampler.get_autocorr_time(quiet=True, tol=0)))
    draws = likelihood.values(chain)
    return PosteriorSample(
        uncertainty.names,
        draws,
        steps,
        time,
        float(sampler.acceptance_fraction.mean()),
        walkers * (steps + 2),
    )


def _spread(uncertainty: Uncertainty) -> np.ndarray:
    """Standard deviation of the start (D,), in ranges: that of the information matrix, at most a
    tenth.
    """
    wide = uncertainty.information.standard_errors / (uncertainty.upper - uncertainty.lower)
    rest = np.full(len(uncertainty.unit) - len(wide), 1e-3)
    return np.concatenate((np.clip(wide, 1e-6, 0.1), rest))
