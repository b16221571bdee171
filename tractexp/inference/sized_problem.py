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
from tractexp.inference.bounds import narrow_bounds
from tractexp.inference.problem import Problem
from tractexp.inference.separable import SeparableColumns
from tractexp.model import sites
from tractexp.model.model import Model
from tractexp.model.parts import Effect
from tractexp.parameter import Parameter
from tractexp.record import Event


def find_torque(model: Model) -> Parameter:
    """The parameter that tells how much a motor draws before a dip.

    Parameters
    ----------
    model : Model
        A load with a motor.

    Returns
    -------
    Parameter
        The first of the motor in per unit that goes with its size: a power or a torque.

    Raises
    ------
    UserError
        For a model without a motor of that kind.
    """
    for parameter in model.motor.parameters:
        if parameter.unit == "pu" and parameter.power_exponent == 1:
            return parameter
    raise UserError(
        f"a {model.title} has no motor whose share of the load could differ from dip to dip;"
        " choose a model with one, such as third_order_exponential"
    )


def acts_on_motors(effect: Effect) -> bool:
    """Whether every place where an effect acts is the motor's own, so that its parameters go with
    the motor's size.
    """
    names = [name for place in effect.places for name in sites.PLACES[place]]
    return bool(effect.places) and all(sites.SITES[name].owner == "motor" for name in names)


class SizedProblem(Problem):
    """A problem whose motors are of another size in each event.

    The constants are those of motors that draw `reference` [pu]. The torque T_e of event e scales
    each by (T_e / reference)^k, where k is the power of the base by which the parameter goes.

    Attributes
    ----------
    torque : str
        Name of the parameter that differs from event to event.
    reference : float
        Power [pu] that motors draw whose constants are the free values.
    exponents : (p,) ints
        k of each parameter of the model; 0 of the torque and of what is neither a motor's nor an
        effect's that acts on motors alone, as a stator resistance does.
    """

    def __init__(
        self,
        model: Model,
        events: Sequence[Event],
        bounds: Mapping[str, Sequence[float]],
        fixed: Mapping[str, float],
        substeps: int | Sequence[int] | None = None,
    ):
        """State which parameters are shared by motors whose size differs from event to event.

        Parameters
        ----------
        model, events, bounds, fixed, substeps
            As of `Problem`.

        Raises
        ------
        UserError
            As `Problem`; also for a model without a motor, and where its torque is fixed.
        """
        own = find_torque(model)
        if own.name in fixed:
            raise UserError(
                f"model.fixed.{own.name} cannot be held over several dips: it is what differs from"
                " dip to dip; leave it out"
            )
        (torque,) = narrow_bounds([own], {k: v for k, v in bounds.items() if k == own.name})
        self.torque, self.reference = torque.name, torque.default
        parts = [model.motor, *filter(acts_on_motors, model.effects)]
        exponents = {p.name: p.power_exponent for part in parts for p in part.parameters}
        exponents[torque.name] = 0
        self.exponents = np.array([exponents.get(name, 0) for name in model.names])
        self._at = model.names.index(torque.name)
        super().__init__(model, events, bounds, fixed, substeps, (torque.name,))

    def by_event(self, values: np.ndarray) -> np.ndarray:
        """All parameters of the model in each event, on the base of the load.

        Parameters
        ----------
        values : (n, d)
            Free values of n candidates.

        Returns
        -------
        (E, n, p) array
            The motor's constants scaled to the size that its torque tells.
        """
        given = super().by_event(values)
        size = given[..., self._at, None] / self.reference
        return given * size**self.exponents

    @property
    def shares(self) -> np.ndarray:
        """The columns (E,) of the free values that hold the torque of each event."""
        return self._columns[:, self._at]

    @property
    def constants(self) -> np.ndarray:
        """The columns (k,) of the free values that all events share."""
        return np.setdiff1d(np.arange(self.space.dimension), self.shares)

    @property
    def separable(self) -> SeparableColumns:
        """The torques as separable columns: each acts on the residuals of its own event only."""
        rows = SeparableColumns.of_power(self.drive, None).rows
        return SeparableColumns(self.shares[:, None], rows)

    @property
    def scale_to_own_power(self) -> np.ndarray:
        """The factors (k,) that turn constants into per unit of the power that the motors draw."""
        names = [self.space.names[k] for k in self.constants]
        exponents = dict(zip(self.model.names, self.exponents.tolist(), strict=True))
        return self.reference ** -np.array([exponents[name] for name in names], dtype=float)
