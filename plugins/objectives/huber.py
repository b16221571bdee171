"""Huber's loss: quadratic for usual residuals, linear for outliers."""

import numpy as np

from tractexp.extend import Loss, check_range, plugin


@plugin
class Huber(Loss):
    """Residuals beyond `tuning` usual ones count by their size, not by their square.

    Source: Huber 1964, with his tuning of 1.345: 95 % of the efficiency of least squares under
    normal noise.
    Departures: the scale is not estimated along with the fit but taken from the noise before the
    dip.
    """

    quadratic = False
    tuning: float = 1.345  # usual residuals
    # the usual residual [pu]; null: the standard deviation before each dip
    scale: float | None = None

    def check(self) -> None:
        super().check()
        check_range("objective.tuning", self.tuning, 1e-3)
        check_range("objective.scale", self.scale, 1e-9)

    def rho(self, z: np.ndarray) -> np.ndarray:
        return np.where(z <= self.tuning**2, z, 2 * self.tuning * np.sqrt(z) - self.tuning**2)
