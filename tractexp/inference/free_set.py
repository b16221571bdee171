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
    """The free numbers of a fit as coordinates (D,) of the unit cube.

    First come the parameters with their bounds, then P0 and Q0 of each of E events. The parameters
    are the base model's free ones, those of all candidates, those of the injected perturbations and
    those of the members of families.

    Attributes
    ----------
    box : Box
        Names and bounds of all D coordinates, in their own units.
    base : array of ints
        Columns of the base model's free parameters.
    before : (2 E,) ints
        Columns of P0 and Q0; none where the powers measured before the events are taken.
    null : (D,)
        The base model's defaults with every candidate at its null and P0 and Q0 as measured.
    parameter_count : int
        Number of coordinates before the first P0.
    catalogue : Catalogue
        The effects whose parameters are coordinates.
    prior : float
        Standard deviation of a fault of the measurement, in its relevant sizes.
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
        """The free numbers of one problem.

        Parameters
        ----------
        problem : Problem
            Whose parameters are free.
        initial_power : bool
            Whether P0 and Q0 of each event are free, too; else they are the means before it.

        Returns
        -------
        FreeSet
            Its null is the problem's defaults, at the measured power.
        """
        base = np.arange(problem.space.dimension)
        null = problem.space.to_unit(problem.defaults)
        if not initial_power:
            return cls(problem.space, base, np.array([], dtype=int), null, len(base))
        power = build_power_box(problem)
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
        """The free numbers of a base model and of all effects that it may lack.

        Parameters
        ----------
        bare : Problem
            That of the base model.
        whole : Problem
            That of the model with every effect of the catalogue.
        catalogue : Catalogue
            The effects, and the members of their families.
        prior : float
            Standard deviation of a fault of the measurement, in its relevant sizes.

        Returns
        -------
        FreeSet
        """
        members = tuple(p for member in catalogue.members for p in member.effect.parameters)
        parameters = join_boxes(whole.space, Box.from_parameters(members))
        power = build_power_box(whole)
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
        """The names (D,) of all coordinates."""
        return self.box.names

    @functools.cached_property
    def column(self) -> dict[str, int]:
        """{name: column} of all coordinates."""
        return {name: k for k, name in enumerate(self.names)}

    def width(self, name: str) -> float:
        """The width of a coordinate's range, in the unit of what it stands for."""
        return float(self.box.width[self.column[name]])

    def to_unit(self, name: str, value: float) -> float:
        """The coordinate, 0 to 1 within the bounds, of a value in its own unit."""
        k = self.column[name]
        return float((value - self.box.lower[k]) / self.box.width[k])

    def value(self, name: str, unit: np.ndarray) -> float:
        """The value in its own unit at coordinates (D,), never outside the bounds by rounding."""
        return float(self.box.from_unit(unit)[self.column[name]])

    def sizes(self, effects: Sequence[str]) -> list[int]:
        """The columns of the effects' sizes: of those parameters that vanish without the effect."""
        return [self.column[p.name] for p in self.catalogue.sizes(effects)]

    def parameters(self, effects: Sequence[str]) -> list[int]:
        """The columns of all parameters of these effects."""
        return [self.column[p.name] for p in self.catalogue.parameters(effects)]

    def nuisances(self, effects: Sequence[str]) -> list[int]:
        """The columns of what gives way beside a tested effect.

        Parameters
        ----------
        effects : names
            The effects that are part of the fit.

        Returns
        -------
        list of ints
            The base model's parameters, P0 and Q0, the effects' parameters, and last the sizes of
            the faults of the measurement.
        """
        free = [*self.base, *self.before, *self.parameters(effects)]
        return free + self.sizes(self.catalogue.of_measurement)

    def present(self, unit: np.ndarray) -> tuple[str, ...]:
        """The names of the load's effects that are not at their null at coordinates (D,)."""
        off = unit != self.null
        of_load = (*self.catalogue.of_load, *(m.name for m in self.catalogue.members))
        return tuple(name for name in of_load if off[self.sizes([name])].any())

    def settings(self, effects: Sequence[str]) -> list[int]:
        """The columns of what the effects have beside their sizes, such as thresholds and times."""
        sizes = self.sizes(effects)
        return [k for k in self.parameters(effects) if k not in sizes]

    @functools.cached_property
    def prior_deviation(self) -> dict[int, float]:
        """{column: standard deviation} in the unit cube of each size of a fault of the measurement
        and of each shape that is held to a likely value.
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

    def measure_departures(self, unit: np.ndarray, columns: Sequence[int]) -> np.ndarray:
        """The residuals (n, k) of the priors of some columns at coordinates (n, D): how far each is
        from its null, in standard deviations.
        """
        columns = list(columns)
        deviations = np.array([self.prior_deviation[k] for k in columns])
        return (unit[:, columns] - self.null[columns]) / deviations

    def shapes(self, effects: Sequence[str]) -> list[int]:
        """The columns of the effects' parameters that are held to likely values by a prior."""
        return [self.column[name] for n in effects for name in self.catalogue[n].effect.likely]

    def place_values(self, unit: np.ndarray, values: Mapping[str, float]) -> np.ndarray:
        """Coordinates (D,) with some numbers moved.

        Parameters
        ----------
        unit : (D,)
            Coordinates to start from; they are not changed.
        values : {name: value}
            What is set, in physical units.

        Returns
        -------
        (D,) array
        """
        moved = unit.copy()
        for name, value in values.items():
            moved[self.column[name]] = self.to_unit(name, value)
        return moved

    def remove_effects(self, unit: np.ndarray, names: Sequence[str]) -> np.ndarray:
        """Coordinates (D,) with all parameters of these effects back at their nulls: the model
        without them.
        """
        moved = unit.copy()
        columns = self.parameters(names)
        moved[columns] = self.null[columns]
        return moved

    def at_measured_power(self, unit: np.ndarray) -> np.ndarray:
        """Coordinates with P0 and Q0 of each event as measured before it.

        Parameters
        ----------
        unit : (..., parameters or more)
            Coordinates of these or of other events; only their parameters are taken.

        Returns
        -------
        (..., D) array
        """
        measured = self.null[self.parameter_count :]
        parameters = unit[..., : self.parameter_count]
        return np.concatenate(
            [parameters, np.broadcast_to(measured, (*unit.shape[:-1], len(measured)))], axis=-1
        )

    def widen_coordinates(self, unit: np.ndarray) -> np.ndarray:
        """Coordinates (D,) of all events from those of the first of them.

        Parameters
        ----------
        unit : (fewer,)
            Coordinates of a free set whose events are the first of these.

        Returns
        -------
        (D,) array
            What the first events have not is as before any fit.
        """
        return np.r_[unit, self.null[len(unit) :]]

    def without_faults(self, unit: np.ndarray, free: Sequence[str]) -> np.ndarray:
        """Coordinates (D,) with the faults of the measurement back at their nulls, but those that
        are `free`.
        """
        return self.remove_effects(
            unit, [name for name in self.catalogue.of_measurement if name not in free]
        )


def build_power_box(problem: Problem) -> Box:
    """The box of P0 and Q0 of each event, around what was measured before it.

    Parameters
    ----------
    problem : Problem
        With E events.

    Returns
    -------
    Box
        (2 E,) [pu], named `P0[1]`, `Q0[1]`, `P0[2]`, ...: `POWER_RANGE` of the apparent power, at
        least of `LEAST_POWER`, to either side.
    """
    measured = problem.drive.before
    drawn = np.linalg.norm(measured, axis=1, keepdims=True)
    reach = POWER_RANGE * np.maximum(drawn, LEAST_POWER)
    names = tuple(f"{what}[{e}]" for e in range(1, len(measured) + 1) for what in ("P0", "Q0"))
    return Box((measured - reach).ravel(), (measured + reach).ravel(), names)


def join_boxes(one: Box, other: Box) -> Box:
    """The box of the coordinates of both, those of the first before those of the other.

    Examples
    --------
    >>> one = Box(np.array([0.0]), np.array([2.0]), ("H",))
    >>> other = Box(np.array([0.5]), np.array([1.0]), ("P0[1]",))
    >>> join_boxes(one, other).names
    ('H', 'P0[1]')
    """
    return Box(
        np.r_[one.lower, other.lower], np.r_[one.upper, other.upper], one.names + other.names
    )
