"""Dips of one load over years: what its machines are all dips share, how much of it they are, each
dip has for itself.

A motor of a k-th of the size has a k-th of the torque and of the inertia and k times the reactance
on the load's base, whatever its equations: each parameter goes with the size as it goes with the
base of power (`Parameter.power_exponent`). So one number an event, the power that its motors draw,
tells all that is different there, while those that run are loaded alike.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from tractexp.errors import UserError
from tractexp.inference.problem import Problem, narrow_bounds
from tractexp.inference.separable import SeparableColumns
from tractexp.model.model import Model
from tractexp.parameter import Parameter
from tractexp.record import Event


def find_torque(model: Model) -> Parameter:
    """The parameter that tells how much a motor draws before a dip: the first that is a power.

    Raises `UserError` for a model without one.
    """
    for parameter in model.motor.parameters:
        if parameter.unit == "pu" and parameter.power_exponent == 1:
            return parameter
    raise UserError(
        f"a {model.title} has no motor whose share of the load could differ from dip to dip;"
        " choose a model with one, such as third_order_exponential"
    )


class SizedProblem(Problem):
    """A problem whose motors are of another size in each event: constants are those of motors that
    draw `reference` [pu], and the torque of each event scales them.
    """

    def __init__(
        self,
        model: Model,
        events: Sequence[Event],
        bounds: Mapping[str, Sequence[float]],
        fixed: Mapping[str, float],
        substeps: int | None = None,
    ):
        """As `Problem`; raises `UserError` for a model without a motor, and where its torque is
        fixed.
        """
        own = find_torque(model)
        if own.name in fixed:
            raise UserError(
                f"model.fixed.{own.name} cannot be held over several dips: it is what differs from"
                " dip to dip; leave it out"
            )
        (torque,) = narrow_bounds([own], {k: v for k, v in bounds.items() if k == own.name})
        self.torque, self.reference = torque.name, torque.default
        exponents = {p.name: p.power_exponent for p in model.motor.parameters}
        exponents[torque.name] = 0
        self.exponents = np.array([exponents.get(name, 0) for name in model.names])
        self._at = model.names.index(torque.name)
        super().__init__(model, events, bounds, fixed, substeps, (torque.name,))

    def by_event(self, values: np.ndarray) -> np.ndarray:
        """Free values (n, free) -> all parameters of the model in each event (E, n, d), on the base
        of the load.
        """
        given = super().by_event(values)
        size = given[..., self._at, None] / self.reference
        return given * size**self.exponents

    @property
    def shares(self) -> np.ndarray:
        """Columns (E,) of the free values that hold the torque of each event."""
        return self._columns[:, self._at]

    @property
    def constants(self) -> np.ndarray:
        """Columns (k,) of the free values that all events share."""
        return np.setdiff1d(np.arange(self.space.dimension), self.shares)

    @property
    def separable(self) -> SeparableColumns:
        """The torques, each of which acts on the rows of its own event."""
        rows = SeparableColumns.of_power(self.drive, None).rows
        return SeparableColumns(self.shares[:, None], rows)

    @property
    def scale_to_own_power(self) -> np.ndarray:
        """What the constants (k,) are multiplied by for the base of what the motors draw
        themselves.
        """
        names = [self.space.names[k] for k in self.constants]
        exponents = dict(zip(self.model.names, self.exponents.tolist(), strict=True))
        return self.reference ** -np.array([exponents[name] for name in names], dtype=float)
