"""The numbers that a fit may move: parameters, power before each event, sizes of effects, faults of
the measurement.

Base and extended models are points of the same coordinates with the other candidates at their
nulls, nested by construction. An identification has those of its model alone.
"""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.inference.catalogue import NOTHING, Catalogue
from tractexp.inference.problem import Problem
from tractexp.parameter import Box

POWER_RANGE = 0.2  # of the apparent power before the event: how far P0 and Q0 may move
LEAST_POWER = 0.1  # pu: a load that drew less may move as far as one that drew this


@dataclass(frozen=True, eq=False)
class FreeSet:
    """Coordinates (D,) of the unit cube: parameters with their bounds, then P0 and Q0 of each
    event.

    The parameters are the base model's free ones, in columns `base`, those of all candidates, the
    pushes', and those of the members of families.
    """

    box: Box  # (D,), named
    base: np.ndarray  # columns
    # (2 E,) columns of P0 and Q0, or none where the powers measured before the events are taken
    before: np.ndarray
    # (D,) every candidate at its null, the base parameters at their defaults, P0 and Q0 as measured
    null: np.ndarray
    parameter_count: int  # coordinates before the first P0
    catalogue: Catalogue = NOTHING
    prior: float = 1.0  # standard deviation of a fault of the measurement, in its relevant sizes

    @classmethod
    def of_problem(cls, problem: Problem, initial_power: bool = True) -> "FreeSet":
        """Return the free parameters of one problem, with P0 and Q0 of each event where
        `initial_power` frees them.
        """
        base, null = np.arange(problem.space.dimension), problem.space.to_unit(problem.defaults)
        if not initial_power:
            return cls(problem.space, base, np.array([], dtype=int), null, len(base))
        power = power_before(problem)
        return cls(
            box=join_boxes(problem.space, power),
            base=base,
            before=len(base) + np.arange(power.dimension),
            null=np.r_[null, np.full(power.dimension, 0.5)],
            parameter_count=len(base),
        )

    @classmethod
    def of_effects(
        cls, bare: Problem, whole: Problem, catalogue: Catalogue, prior: float
    ) -> "FreeSet":
        """Return those of the problem of everything, `whole`, in which the problem of the base
        model is `bare`.
        """
        members = tuple(p for member in catalogue.members for p in member.effect.parameters)
        parameters, power = (
            join_boxes(whole.space, Box.from_parameters(members)),
            power_before(whole),
        )
        nulls = {
            p.name: p.default if p.null is None else p.null for p in (*whole.parameters, *members)
        }
        null = parameters.to_unit(np.array([nulls[name] for name in parameters.names]))
        return cls(
            box=join_boxes(parameters, power),
            base=np.array([parameters.names.index(name) for name in bare.space.names]),
            before=parameters.dimension + np.arange(power.dimension),
            null=np.r_[null, np.full(power.dimension, 0.5)],
            parameter_count=parameters.dimension,
            catalogue=catalogue,
            prior=prior,
        )

    @property
    def dimension(self) -> int:
        """How many numbers are free, D."""
        return len(self.null)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all coordinates, (D,)."""
        return self.box.names

    @functools.cached_property
    def column(self) -> dict[str, int]:
        """Where each parameter stands."""
        return {name: k for k, name in enumerate(self.names)}

    def width(self, name: str) -> float:
        """The width of a free number's range, in its own unit."""
        return float(self.box.width[self.column[name]])

    def to_unit(self, name: str, value: float) -> float:
        """The coordinate in the unit cube of a value in its own unit."""
        k = self.column[name]
        return float((value - self.box.lower[k]) / self.box.width[k])

    def value(self, name: str, unit: np.ndarray) -> float:
        """A parameter's value at coordinates (D,), never outside its bounds by rounding."""
        return float(self.box.from_unit(unit)[self.column[name]])

    def sizes(self, effects: Sequence[str]) -> list[int]:
        """Columns of the effects' sizes."""
        return [self.column[p.name] for p in self.catalogue.sizes(effects)]

    def parameters(self, effects: Sequence[str]) -> list[int]:
        """Columns of all the effects' parameters."""
        return [self.column[p.name] for p in self.catalogue.parameters(effects)]

    def nuisances(self, effects: Sequence[str]) -> list[int]:
        """Columns of what is free in a fit with these effects, then of the sizes of the faults of
        the measurement.
        """
        free = [*self.base, *self.before, *self.parameters(effects)]
        return free + self.sizes(self.catalogue.of_measurement)

    def present(self, unit: np.ndarray) -> tuple[str, ...]:
        """The effects of the load that are not at their null at coordinates (D,)."""
        off, of_load = (
            unit != self.null,
            (*self.catalogue.of_load, *(m.name for m in self.catalogue.members)),
        )
        return tuple(name for name in of_load if off[self.sizes([name])].any())

    def settings(self, effects: Sequence[str]) -> list[int]:
        """Columns of what the effects have beside their sizes, such as thresholds and times."""
        sizes = self.sizes(effects)
        return [k for k in self.parameters(effects) if k not in sizes]

    @functools.cached_property
    def prior_deviation(self) -> dict[int, float]:
        """Prior standard deviation of each size of a fault of the measurement and of each shape, in
        the unit cube.
        """
        faults = {
            self.column[p.name]: self.prior * self.catalogue[name].relevant(p) / self.width(p.name)
            for name in self.catalogue.of_measurement
            for p in self.catalogue[name].sizes
        }
        likely = [
            pair for member in self.catalogue.members for pair in member.effect.likely.items()
        ]
        return faults | {self.column[name]: spread / self.width(name) for name, spread in likely}

    def shapes(self, effects: Sequence[str]) -> list[int]:
        """Columns of the effects' parameters that are held to their defaults by what is likely."""
        return [self.column[name] for n in effects for name in self.catalogue[n].effect.likely]

    def place_values(self, unit: np.ndarray, values: Mapping[str, float]) -> np.ndarray:
        """Coordinates (D,) with these parameters at these values."""
        moved = unit.copy()
        for name, value in values.items():
            moved[self.column[name]] = self.to_unit(name, value)
        return moved

    def remove_effects(self, unit: np.ndarray, names: Sequence[str]) -> np.ndarray:
        """Coordinates (D,) with all parameters of these effects back at their nulls."""
        moved, columns = unit.copy(), self.parameters(names)
        moved[columns] = self.null[columns]
        return moved

    def at_measured_power(self, unit: np.ndarray) -> np.ndarray:
        """Coordinates (..., D) from those of these or other events, with P0 and Q0 of each of these
        as measured.
        """
        measured = self.null[self.parameter_count :]
        parameters = unit[..., : self.parameter_count]
        return np.concatenate(
            [parameters, np.broadcast_to(measured, (*unit.shape[:-1], len(measured)))], axis=-1
        )

    def widen_coordinates(self, unit: np.ndarray) -> np.ndarray:
        """Coordinates (D,) from those of the first of these events, the others as before any fit.

        Their first numbers, as many as those had, are the first events' again.
        """
        return np.r_[unit, self.null[len(unit) :]]

    def without_faults(self, unit: np.ndarray, free: Sequence[str]) -> np.ndarray:
        """Coordinates (D,) with the faults of the measurement that are not `free` back at their
        nulls.
        """
        return self.remove_effects(
            unit, [name for name in self.catalogue.of_measurement if name not in free]
        )


def power_before(problem: Problem) -> Box:
    """Return the box of P0 and Q0 of each event, (2 E,): around what was measured before it."""
    measured = problem.drive.before
    drawn = np.linalg.norm(measured, axis=1, keepdims=True)
    reach = POWER_RANGE * np.maximum(drawn, LEAST_POWER)
    names = tuple(f"{what}[{e}]" for e in range(1, len(measured) + 1) for what in ("P0", "Q0"))
    return Box((measured - reach).ravel(), (measured + reach).ravel(), names)


def join_boxes(one: Box, other: Box) -> Box:
    """Return the box of the coordinates of both, those of the first before those of the other."""
    return Box(
        np.r_[one.lower, other.lower], np.r_[one.upper, other.upper], one.names + other.names
    )
