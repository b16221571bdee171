"""How a residual counts in the objective: the base of the plugins chosen by `objective=NAME`."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tractexp.configuration.plugin import Plugin
from tractexp.errors import UserError, check_range
from tractexp.model.drive import Drive
from tractexp.record import Event

# objectives from here up mark candidates that could not be simulated, ranked by how far they miss
REFUSED = 1e12


@dataclass(frozen=True, kw_only=True)
class Loss(Plugin):
    """Base of the objectives: how a residual counts. By itself it is that of Eq. (8), the squares.

    A robust loss needs to know which residual is usual: the noise before each dip, or `scale`. The
    objective is the mean over all samples of

        w s² rho((r / s)²)

    with the weight w of the channel, the usual residual s and the residual r [pu].

    Attributes
    ----------
    quadratic : bool
        Whether rho(z) = z, so that the faster sums of squares serve.
    weight_P, weight_Q : float, 0 or more
        Weights of the errors of P and of Q.
    """

    group: ClassVar[str] = "objective"
    quadratic: ClassVar[bool] = True
    weight_P: float = 1.0  # of the squared errors of P
    weight_Q: float = 1.0

    def check(self) -> None:
        """Raise `UserError` for a negative weight, or where both are 0."""
        for name in ("weight_P", "weight_Q"):
            check_range(f"objective.{name}", getattr(self, name), 0.0)
        if self.weight_P == self.weight_Q == 0:
            raise UserError(
                "objective.weight_P and objective.weight_Q are both 0: nothing would be fitted"
            )

    def rho(self, z: np.ndarray) -> np.ndarray:
        """The loss of squared residuals.

        Parameters
        ----------
        z : array
            Squared residuals, in squared scales.

        Returns
        -------
        array of the same shape
            z itself where z is small.
        """
        return z

    def scales(self, events: Sequence[Event], drive: Drive) -> np.ndarray:
        """The usual residual of each sample.

        Parameters
        ----------
        events : Sequence[Event]
            Those that are fitted.
        drive : Drive
            Their inputs and measurements, one after the other.

        Returns
        -------
        (C, N) or (2, 1) array [pu]
            The noise before each dip, or `scale`; 1 for squares.

        Raises
        ------
        UserError
            Where it is not known: no noise before a dip, and no `scale`.
        """
        if self.quadratic:
            return np.ones((2, 1))
        given = getattr(self, "scale", None)
        usual = np.empty(drive.measurements.shape)
        for e, event in enumerate(events):
            for c, channel in enumerate(drive.names):
                level = given or event.levels[c]
                if not level > 0:
                    raise UserError(
                        f"{event.record.where}: {channel} shows no noise before the dip, so that a"
                        " robust objective"
                        " cannot tell an outlier; give the usual residual as objective.scale [pu],"
                        " or take"
                        " objective=squares"
                    )
                usual[c, drive.part(e)] = level
        return usual
