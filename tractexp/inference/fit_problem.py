"""What a fit moves, and the residuals that come of it: a model on its events, and which numbers are
free.
"""

import functools
from dataclasses import dataclass

import numpy as np

from tractexp.inference.free_set import FreeSet
from tractexp.inference.problem import Problem
from tractexp.inference.separable import SeparableColumns


@dataclass(frozen=True, eq=False, kw_only=True)
class FitProblem:
    """A problem whose residuals are asked for at coordinates (n, D) of its free set.

    With `initial_power` P0 and Q0 of each event are coordinates beside the parameters; else they
    are the means before. `valid` (C, N) marks the samples that count: gaps do not.
    """

    problem: Problem
    valid: np.ndarray
    initial_power: bool = True

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
        return self.place_parameters(self.problem.space.to_unit(np.atleast_2d(values)))

    def place_parameters(self, unit: np.ndarray) -> np.ndarray:
        """Parameters (n, free or more) in the unit cube as coordinates (n, D), at the measured
        power before each event.

        Whatever power the given ones have is left out.
        """
        return self.free_set.at_measured_power(unit)

    def values(self, unit: np.ndarray) -> np.ndarray:
        """Free values (..., free) of coordinates (..., D)."""
        return self.problem.space.from_unit(unit[..., : self.free])

    def residuals(self, unit: np.ndarray) -> np.ndarray:
        """Calculated minus measured (n, 2, N) [pu] at coordinates (n, D): 0 in gaps, nan where not
        simulated.
        """
        problem, drive = self.problem, self.problem.drive
        before = None
        if self.initial_power:
            power = self.free_set.box.from_unit(unit)[:, self.free_set.before]
            before = power.reshape(len(unit), drive.events, 2).swapaxes(0, 1)
        response = problem.model.simulate(
            drive, problem.candidates(self.values(unit)), problem.step.substeps, before
        )
        rows = response.by_candidate
        rows -= drive.measurements
        if self.gaps:
            with np.errstate(invalid="ignore"):  # what diverged is no number in gaps either
                rows *= self.valid
        for e, missed in enumerate(response.miss > 0):
            rows[missed, :, drive.part(e)] = np.nan
        return rows

    @functools.cached_property
    def separable_columns(self) -> SeparableColumns:
        """P0 and Q0 of each event, which act on its own rows only."""
        return SeparableColumns.of_power(
            self.problem.drive, self.free if self.initial_power else None
        )
