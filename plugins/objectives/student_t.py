"""Student's t: the likelihood of noise with heavy tails."""

import numpy as np

from tractexp.extend import Loss, check_range, plugin


@plugin
class StudentT(Loss):
    """An outlier's pull falls with its distance: the fewer the degrees of freedom, the sooner.

    Source: Lange, Little and Taylor 1989, Eq. (1) with fixed degrees of freedom.
    Departures: scaled to the square of the residual where that is small.
    """

    quadratic = False
    freedom: float = 4.0  # degrees of freedom
    # the usual residual [pu]; null: the standard deviation before each dip
    scale: float | None = None

    def check(self) -> None:
        super().check()
        check_range("objective.freedom", self.freedom, 0.5)
        check_range("objective.scale", self.scale, 1e-9)

    def rho(self, z: np.ndarray) -> np.ndarray:
        return self.freedom * np.log1p(z / self.freedom)
