"""A sample of the posterior, to confirm intervals where the likelihood is no parabola. Needs the
extra [posterior].
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tractexp.errors import TASK, UserError, name_setting
from tractexp.identification.uncertainty import Uncertainty
from tractexp.inference.interval import INTERVAL_LEVEL
from tractexp.text.progress import Counting, make_silent_counter

BURN = 0.3  # of the steps are thrown away
ENOUGH = 50.0  # autocorrelation times that a chain should last (emcee's own advice)


@dataclass(frozen=True, eq=False)
class PosteriorSample:
    """A sample of the posterior of d free parameters under a flat prior within their bounds.

    Attributes
    ----------
    names : tuple of str
        Of the parameters.
    draws : (n, d)
        In physical units.
    steps : int
        Length of each chain.
    autocorrelation : float
        Steps that a chain remembers, the largest over the coordinates.
    acceptance : float
        Share of the proposed moves that were taken.
    simulations : int
        What it cost.
    """

    names: tuple[str, ...]
    draws: np.ndarray
    steps: int
    autocorrelation: float  # steps, the largest over the coordinates
    acceptance: float
    simulations: int

    @property
    def intervals(self) -> np.ndarray:
        """The 95 % intervals (d, 2) in physical units, between the outer quantiles."""
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
    """Sample the posterior by Goodman and Weare's affine-invariant ensemble (emcee).

    All walkers of a half-step are one simulation call. P0 and Q0 of each event are sampled along.

    Parameters
    ----------
    uncertainty : Uncertainty
        The estimate around which the walkers start.
    walkers : int
        At least twice the number of coordinates.
    steps : int
        Of each walker; the first 30 % are thrown away.
    seed : int
        The same seed gives the same draws.
    parts : int -> counter
        Counts the steps.

    Returns
    -------
    PosteriorSample

    Raises
    ------
    UserError
        Where emcee is missing, and for too few walkers.
    """
    try:
        import emcee
    except ImportError:
        raise UserError(
            f"{name_setting('task=posterior')} needs emcee; install it by: pip install"
            " 'tractexp[posterior]'"
        ) from None
    likelihood = uncertainty.likelihood
    d = len(uncertainty.unit)
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
        uncertainty.unit + _choose_spread(uncertainty) * rng.standard_normal((walkers, d)),
        1e-6,
        1 - 1e-6,
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


def _choose_spread(uncertainty: Uncertainty) -> np.ndarray:
    """The standard deviations (D,) of the start, in ranges: the standard errors, at most a
    tenth.
    """
    wide = uncertainty.information.standard_errors / (uncertainty.upper - uncertainty.lower)
    rest = np.full(len(uncertainty.unit) - len(wide), 1e-3)
    return np.concatenate((np.clip(wide, 1e-6, 0.1), rest))
