"""One set of coordinates for the base model and every candidate.

Base and extended models are points of the same coordinates with the other candidates at their nulls, nested by
construction.
"""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.inference.catalogue import Catalogue
from tractexp.inference.problem import Problem


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Coordinates (D,) lie in the unit cube: parameters `names` with these bounds, then P0 and Q0 of each event.

    The parameters are the base model's free ones, in columns `base`, those of all candidates, the pushes', and those of
    the members of families.
    """

    names: tuple[str, ...]  # (d,)
    lower: np.ndarray  # (d,)
    upper: np.ndarray  # (d,)
    catalogue: Catalogue
    base: np.ndarray  # columns
    before: np.ndarray  # (2 E,) columns of P0 and Q0, or none where the powers measured before the events are taken
    null: np.ndarray  # (D,) every candidate at its null, the base parameters at their defaults
    prior: float  # standard deviation of a fault of the measurement, in its relevant sizes

    @classmethod
    def of(cls, bare: Problem, whole: Problem, catalogue: Catalogue, prior: float) -> "Coordinates":
        """Those of the problem of everything, `whole`, in which the problem of the base model is `bare`."""
        members = [p for member in catalogue.members for p in member.effect.parameters]
        names, events = (*whole.space.names, *(p.name for p in members)), whole.drive.events
        d = len(names)
        own = np.array([p.bounds for p in members], dtype=float).reshape(-1, 2)
        lower, upper = np.r_[whole.lower, own[:, 0]], np.r_[whole.upper, own[:, 1]]
        chosen = {p.name: p.default if p.null is None else p.null for p in (*whole.parameters, *members)}
        values = np.array([chosen[name] for name in names])
        return cls(
            names=names,
            lower=lower,
            upper=upper,
            catalogue=catalogue,
            base=np.array([names.index(name) for name in bare.space.names]),
            before=np.arange(d, d + 2 * events),
            null=np.r_[(values - lower) / (upper - lower), np.full(2 * events, 0.5)],
            prior=prior,
        )

    @property
    def dimension(self) -> int:
        return len(self.null)

    @functools.cached_property
    def column(self) -> dict[str, int]:
        """Where each parameter stands."""
        return {name: k for k, name in enumerate(self.names)}

    def width(self, name: str) -> float:
        k = self.column[name]
        return float(self.upper[k] - self.lower[k])

    def to_unit(self, name: str, value: float) -> float:
        k = self.column[name]
        return float((value - self.lower[k]) / (self.upper[k] - self.lower[k]))

    def value(self, name: str, unit: np.ndarray) -> float:
        """A parameter's value at coordinates (D,), never outside its bounds by rounding."""
        k = self.column[name]
        inside = self.lower[k] + unit[k] * (self.upper[k] - self.lower[k])
        return float(np.clip(inside, self.lower[k], self.upper[k]))

    def sizes(self, effects: Sequence[str]) -> list[int]:
        """Columns of the effects' sizes."""
        return [self.column[p.name] for p in self.catalogue.sizes(effects)]

    def parameters(self, effects: Sequence[str]) -> list[int]:
        """Columns of all the effects' parameters."""
        return [self.column[p.name] for p in self.catalogue.parameters(effects)]

    def nuisances(self, effects: Sequence[str]) -> list[int]:
        """Columns of what is free in a fit with these effects, then of the sizes of the faults of the measurement."""
        free = [*self.base, *self.before, *self.parameters(effects)]
        return free + self.sizes(self.catalogue.of_measurement)

    def present(self, unit: np.ndarray) -> tuple[str, ...]:
        """The effects of the load that are not at their null at coordinates (D,)."""
        off, of_load = unit != self.null, (*self.catalogue.of_load, *(m.name for m in self.catalogue.members))
        return tuple(name for name in of_load if off[self.sizes([name])].any())

    def settings(self, effects: Sequence[str]) -> list[int]:
        """Columns of what the effects have beside their sizes, such as thresholds and times."""
        sizes = self.sizes(effects)
        return [k for k in self.parameters(effects) if k not in sizes]

    @functools.cached_property
    def prior_deviation(self) -> dict[int, float]:
        """Prior standard deviation of each size of a fault of the measurement and of each shape, in the unit cube."""
        faults = {
            self.column[p.name]: self.prior * self.catalogue[name].relevant(p) / self.width(p.name)
            for name in self.catalogue.of_measurement
            for p in self.catalogue[name].sizes
        }
        likely = [pair for member in self.catalogue.members for pair in member.effect.likely.items()]
        return faults | {self.column[name]: spread / self.width(name) for name, spread in likely}

    def shapes(self, effects: Sequence[str]) -> list[int]:
        """Columns of the effects' parameters that are held to their defaults by what is likely."""
        return [self.column[name] for n in effects for name in self.catalogue[n].effect.likely]

    def placed(self, unit: np.ndarray, values: Mapping[str, float]) -> np.ndarray:
        """Coordinates (D,) with these parameters at these values."""
        moved = unit.copy()
        for name, value in values.items():
            moved[self.column[name]] = self.to_unit(name, value)
        return moved

    def without(self, unit: np.ndarray, names: Sequence[str]) -> np.ndarray:
        """Coordinates (D,) with all parameters of these effects back at their nulls."""
        moved, columns = unit.copy(), self.parameters(names)
        moved[columns] = self.null[columns]
        return moved

    def at_measured_power(self, unit: np.ndarray) -> np.ndarray:
        """Coordinates (D,) from those of these or other events, with P0 and Q0 of each of these as measured."""
        return np.r_[unit[: len(self.names)], self.null[len(self.names) :]]

    def widened(self, unit: np.ndarray) -> np.ndarray:
        """Coordinates (D,) from those of the first of these events, the others as before any fit.

        Their first numbers, as many as those had, are the first events' again.
        """
        return np.r_[unit, self.null[len(unit) :]]

    def without_faults(self, unit: np.ndarray, free: Sequence[str]) -> np.ndarray:
        """Coordinates (D,) with the faults of the measurement that are not `free` back at their nulls."""
        return self.without(unit, [name for name in self.catalogue.of_measurement if name not in free])
