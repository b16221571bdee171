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

    Attributes
    ----------
    problem : Problem
        The model on its events.
    valid : (C, N) bools
        Which samples of each channel count; gaps do not.
    initial_power : bool
        Whether P0 and Q0 of each event are coordinates beside the parameters; else they are the
        means before it.
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
        """The number of values, over all channels, that count."""
        return int(np.count_nonzero(self.valid))

    @functools.cached_property
    def free_set(self) -> FreeSet:
        """The meaning of the coordinates: names, bounds and nulls."""
        return FreeSet.of_problem(self.problem, self.initial_power)

    def to_unit(self, values: np.ndarray) -> np.ndarray:
        """The coordinates (n, D) of free values (n, d), at the power measured before each event."""
        return self.place_parameters(self.problem.space.to_unit(np.atleast_2d(values)))

    def place_parameters(self, unit: np.ndarray) -> np.ndarray:
        """The coordinates of parameters, at the power measured before each event.

        Parameters
        ----------
        unit : (n, d or more)
            Parameters in the unit cube; what follows them, such as another power before, is left
            out.

        Returns
        -------
        (n, D) array
        """
        return self.free_set.at_measured_power(unit)

    def values(self, unit: np.ndarray) -> np.ndarray:
        """The free values (..., d), in physical units, of coordinates (..., D)."""
        return self.problem.space.from_unit(unit[..., : self.free])

    def residuals(self, unit: np.ndarray) -> np.ndarray:
        """The residuals at n points.

        Parameters
        ----------
        unit : (n, D)
            Coordinates in the unit cube.

        Returns
        -------
        (n, C, N) array [pu]
            Calculated minus measured: 0 in gaps, nan in an event without a steady state.
        """
        problem = self.problem
        drive = self.problem.drive
        before = None
        if self.initial_power:
            power = self.free_set.box.from_unit(unit)[:, self.free_set.before]
            before = power.reshape(len(unit), drive.events, 2).swapaxes(0, 1)
        response = problem.model.simulate(
            drive, problem.candidates(self.values(unit)), problem.step.substeps, before
        )
        rows = response.by_candidate
        rows -= drive.measurements
        if not self.valid.all():
            with np.errstate(invalid="ignore"):  # what diverged is no number in gaps either
                rows *= self.valid
        for part, missed in zip(drive.parts, response.miss > 0, strict=True):
            rows[missed, :, part] = np.nan
        return rows

    @functools.cached_property
    def separable_columns(self) -> SeparableColumns:
        """P0 and Q0 of each event as separable columns: they act on its own residuals only."""
        return SeparableColumns.of_power(
            self.problem.drive, self.free if self.initial_power else None
        )
