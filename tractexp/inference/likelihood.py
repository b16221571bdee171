"""Whitened residuals of a problem: those of Eq. (8), and those of the likelihood of the noise.

Eq. (8) counts every sample alike and holds P0 and Q0 at the means before the dip. Nothing has to be
known of the noise for that, and a model's own error cannot ruin it. The likelihood whitens by the
noise and leaves P0 and Q0 free: where nothing but noise is left its least squares are the most
precise estimate there is. Coordinates are the free parameters followed, in the likelihood, by P0
and Q0 of each event, in the unit cube.
"""

from dataclasses import dataclass, replace

import numpy as np

from tractexp.domain import find_domain
from tractexp.inference.differences import compute_central_differences
from tractexp.inference.fit_problem import FitProblem
from tractexp.inference.least_squares import Descent, descend
from tractexp.inference.prior import compute_prior_rows
from tractexp.inference.problem import Problem
from tractexp.inference.separable import Sensitivities
from tractexp.noise.color import SMALLEST_DEVIATION, cut_stretches, fit_autoregression
from tractexp.noise.model import Noise, Pair
from tractexp.record import Event


def estimate_noise_before(event: Event) -> Pair:
    """The noise of each channel before a dip: what is known of it before anything is fitted.

    Returns the autoregression of each channel, as loud as the event's level [pu].
    """
    pair = []
    for quiet, level in zip(event.calm, event.levels, strict=True):
        color = fit_autoregression(
            cut_stretches(quiet, np.isfinite(quiet)), find_domain(event).quiet_order
        )
        pair.append(color.scale_noise(max(level, SMALLEST_DEVIATION) / color.deviation[0]))
    return tuple(pair)


@dataclass(frozen=True, eq=False, kw_only=True)
class Likelihood(FitProblem):
    """A fit problem under a noise.

    Attributes
    ----------
    problem, valid, initial_power
        As of `FitProblem`.
    noise : Noise
        By which residuals are whitened.
    prior : float
        Weight of rows that hold the motor to what machines usually are; they come last. 0 is
        without.
    """

    noise: Noise
    prior: float = 0.0

    @classmethod
    def from_problem(cls, problem: Problem, noise: Noise | None = None) -> "Likelihood":
        """The likelihood under `noise`, by default that of the samples before each dip; gaps do not
        count.
        """
        noise = noise or Noise(tuple(estimate_noise_before(e) for e in problem.events))
        return cls(problem=problem, valid=problem.drive.weights > 0, noise=noise)

    @classmethod
    def of_squares(cls, problem: Problem, deviation: float) -> "Likelihood":
        """Eq. (8), with the weights of the problem's objective, over `deviation`² [pu²]: all
        samples count alike.
        """
        weights = problem.drive.weights.max(axis=1)
        white = Noise.white(*(deviation / np.sqrt(np.where(weights > 0, weights, 1.0))).tolist())
        return cls(
            problem=problem, valid=problem.drive.weights > 0, noise=white, initial_power=False
        )

    @classmethod
    def of_objective(cls, problem: Problem, objective: float) -> "Likelihood":
        """Eq. (8) in units of what an objective [pu²] leaves: a sum of squares counts samples."""
        return cls.of_squares(problem, max(float(np.sqrt(objective)), SMALLEST_DEVIATION))

    @property
    def with_initial_power(self) -> "Likelihood":
        """The likelihood with P0 and Q0 of each event free."""
        return replace(self, initial_power=True)

    def scale_noise(self, factor: float) -> "Likelihood":
        """The likelihood under noise `factor` times as loud."""
        return replace(self, noise=self.noise.scale_noise(factor), prior=self.prior / factor)

    @property
    def of_records(self) -> "Likelihood":
        """The likelihood without the rows of a prior."""
        return replace(self, prior=0.0)

    def whiten(self, residuals: np.ndarray) -> np.ndarray:
        """Residuals as rows of independent unit variance.

        Parameters
        ----------
        residuals : (n, C, N) [pu]
            Of n candidates.

        Returns
        -------
        (n, C N) array
            Samples that do not count are 0.
        """
        return self.noise.whiten(residuals, self.problem.drive, self.valid)

    def rows(self, unit: np.ndarray, lanes: np.ndarray | None = None) -> np.ndarray:
        """The rows whose sum of squares is the deviance.

        Parameters
        ----------
        unit : (n, D)
            Coordinates in the unit cube.
        lanes : (n,) ints
            Not used: no row depends on the lane.

        Returns
        -------
        (n, C N + k) array
            Whitened residuals, then the k rows of the prior, where there is one.
        """
        rows = self.whiten(self.residuals(unit))
        return np.concatenate([rows, self.prior_rows(unit)], axis=1) if self.prior else rows

    def prior_rows(self, unit: np.ndarray) -> np.ndarray:
        """The residuals of the prior (n, k) at coordinates (n, D): weighted departures from the
        parameters that machines usually have. k is 0 without a prior.
        """
        return compute_prior_rows(self.problem, self.values(unit), self.prior)

    def jacobian(self, unit: np.ndarray) -> tuple[np.ndarray, Sensitivities]:
        """Whitened residuals, and their central differences.

        Parameters
        ----------
        unit : (D,)
            One point of the unit cube.

        Returns
        -------
        (R,) array
            The rows there; their sum of squares is the deviance.
        Sensitivities
            Per range of each coordinate.
        """
        rows, J = compute_central_differences(
            self.rows, unit[None], np.zeros(1, dtype=int), self.separable_columns
        )
        return rows[0], Sensitivities(J[0], self.free, self.separable_columns.rows)

    def descent(
        self,
        start: np.ndarray,
        frozen: np.ndarray | None = None,
        iterations: int = 40,
        tolerance: float = 1e-4,
    ) -> Descent:
        """The ends of descents of the deviance; see `descend`.

        Parameters
        ----------
        start : (n, D)
            Coordinates in the unit cube.
        frozen : (n, D) bools
            Those that do not move.
        iterations, tolerance
            As of `descend`.

        Returns
        -------
        Descent
        """
        return descend(self.rows, start, frozen, iterations, tolerance, self.separable_columns)
