"""Whitened residuals of a problem: those of Eq. (8), and those of the likelihood of the noise.

Eq. (8) counts every sample alike and holds P0 and Q0 at the means before the dip. Nothing has to be known of the noise
for that, and a model's own error cannot ruin it. The likelihood whitens by the noise and leaves P0 and Q0 free: where
nothing but noise is left its least squares are the most precise estimate there is. Coordinates are the free parameters
followed, in the likelihood, by P0 and Q0 of each event, in the unit cube.
"""

import functools
from dataclasses import dataclass, replace

import numpy as np

from tractexp.domain import domain_of
from tractexp.inference.differences import central_differences
from tractexp.inference.free_set import FreeSet
from tractexp.inference.least_squares import Descent, descend
from tractexp.inference.prior import departures
from tractexp.inference.problem import Problem
from tractexp.inference.separable import Sensitivities, SeparableColumns
from tractexp.noise.color import SMALLEST, fit_autoregression, stretches
from tractexp.noise.model import Noise, Pair
from tractexp.record import Event


def before_the_event(event: Event) -> Pair:
    """Level and color of each channel's noise before the dip: what is known of it before anything is fitted."""
    pair = []
    for quiet, level in zip(event.calm, event.levels, strict=True):
        color = fit_autoregression(stretches(quiet, np.isfinite(quiet)), domain_of(event).quiet_order)
        pair.append(color.scaled(max(level, SMALLEST) / color.deviation[0]))
    return tuple(pair)


@dataclass(frozen=True, eq=False)
class Likelihood:
    """Whitened residuals of a problem. `valid` (2, N) marks the samples of P and Q that count.

    With `initial_power` P0 and Q0 of each event are coordinates beside the parameters; else they are the means before.
    `prior` is the weight of rows that hold the motor to what machines usually are; they come last, 0 is without.
    """

    problem: Problem
    noise: Noise
    valid: np.ndarray
    initial_power: bool = True
    prior: float = 0.0

    @classmethod
    def of(cls, problem: Problem, noise: Noise | None = None) -> "Likelihood":
        """The likelihood under `noise`, by default that of the samples before each dip; gaps do not count."""
        noise = noise or Noise(tuple(before_the_event(e) for e in problem.events))
        return cls(problem, noise, problem.drive.weights > 0)

    @classmethod
    def of_squares(cls, problem: Problem, deviation: float) -> "Likelihood":
        """Eq. (8), with the weights of the problem's objective, over `deviation`² [pu²]: all samples count alike."""
        weights = problem.drive.weights.max(axis=1)
        white = Noise.white(*(deviation / np.sqrt(np.where(weights > 0, weights, 1.0))).tolist())
        return cls(problem, white, problem.drive.weights > 0, initial_power=False)

    @property
    def with_initial_power(self) -> "Likelihood":
        """The same with P0 and Q0 of each event free."""
        return replace(self, initial_power=True)

    def scaled(self, factor: float) -> "Likelihood":
        """The same with noise `factor` times as loud."""
        return replace(self, noise=self.noise.scaled(factor), prior=self.prior / factor)

    @property
    def of_records(self) -> "Likelihood":
        """The same without the rows of a prior."""
        return replace(self, prior=0.0)

    @property
    def free(self) -> int:
        """Number of free parameters."""
        return self.problem.space.dimension

    @property
    def samples(self) -> int:
        """Values of P and Q that count."""
        return int(np.count_nonzero(self.valid))

    @functools.cached_property
    def gaps(self) -> bool:
        """Whether a sample does not count."""
        return not self.valid.all()

    @functools.cached_property
    def free_set(self) -> FreeSet:
        """What its coordinates are."""
        return FreeSet.of_problem(self.problem, self.initial_power)

    def to_unit(self, values: np.ndarray) -> np.ndarray:
        """Free values (n, free), at the measured power before each event, as coordinates (n, D)."""
        return self.placed(self.problem.space.to_unit(np.atleast_2d(values)))

    def placed(self, unit: np.ndarray) -> np.ndarray:
        """Parameters (n, free or more) in the unit cube as coordinates (n, D), at the measured power before each event.

        Whatever power the given ones have is left out.
        """
        return self.free_set.at_measured_power(unit)

    def values(self, unit: np.ndarray) -> np.ndarray:
        """Free values (..., free) of coordinates (..., D)."""
        return self.problem.space.from_unit(unit[..., : self.free])

    def residuals(self, unit: np.ndarray) -> np.ndarray:
        """Calculated minus measured (n, 2, N) [pu] at coordinates (n, D): 0 in gaps, nan where not simulated."""
        problem, drive = self.problem, self.problem.drive
        before = None
        if self.initial_power:
            power = self.free_set.box.from_unit(unit)[:, self.free_set.before]
            before = power.reshape(len(unit), drive.events, 2).swapaxes(0, 1)
        response = problem.model.simulate(drive, problem.candidates(self.values(unit)), problem.step.substeps, before)
        rows = response.by_candidate
        rows -= drive.measured
        if self.gaps:
            with np.errstate(invalid="ignore"):  # what diverged is no number in gaps either
                rows *= self.valid
        for e, missed in enumerate(response.miss > 0):
            rows[missed, :, drive.part(e)] = np.nan
        return rows

    def whiten(self, residuals: np.ndarray) -> np.ndarray:
        """Residuals (n, 2, N) as rows (n, 2 N) of independent unit variance; samples that do not count are 0."""
        return self.noise.whiten(residuals, self.problem.drive, self.valid)

    def rows(self, unit: np.ndarray, lanes: np.ndarray | None = None) -> np.ndarray:
        """Whitened residuals (n, 2 N); their sum of squares is the deviance. Does not depend on the lane."""
        rows = self.whiten(self.residuals(unit))
        return np.concatenate([rows, self.prior_rows(unit)], axis=1) if self.prior else rows

    def prior_rows(self, unit: np.ndarray) -> np.ndarray:
        """How far coordinates (n, D) are from what machines usually are, (n, k); none where nothing holds them."""
        if not self.prior:
            return np.empty((len(unit), 0))
        return self.prior * departures(self.problem, self.values(unit))

    def jacobian(self, unit: np.ndarray) -> tuple[np.ndarray, Sensitivities]:
        """Whitened rows (R,) at one point (D,) of the unit cube, and their central differences."""
        rows, J = central_differences(self.rows, unit[None], np.zeros(1, dtype=int), self.apart)
        return rows[0], Sensitivities(J[0], self.free, self.apart.rows)

    def descent(
        self, start: np.ndarray, frozen: np.ndarray | None = None, iterations: int = 40, tolerance: float = 1e-4
    ) -> Descent:
        """The ends of descents of the deviance from coordinates (n, D); see `descend`."""
        return descend(self.rows, start, frozen, iterations, tolerance, self.apart)

    @functools.cached_property
    def apart(self) -> SeparableColumns:
        """P0 and Q0 of each event, which act on its own rows only."""
        return SeparableColumns.of_power(self.problem.drive, self.free if self.initial_power else None)
