"""The window of a P-class phasor measurement unit."""

import numpy as np

from tractexp.extend import Estimator, plugin


@plugin
class PClass(Estimator):
    """The triangle over two nominal cycles of the standard's P-class reference: quick, for
    protection.

        w(t) = 1 - f_0 |t|,  |t| < 1/f_0

    Source: IEC/IEEE 60255-118-1:2018, annex D.6, eq. (D.5), W(k) = 1 - 2 |k| / (N + 2), N = 2
    (samples a cycle - 1).
    Departures: the sinusoid is taken at the tracked frequency by least squares, where the reference
    turns at the nominal one and then corrects the magnitude by the frequency, eq. (D.6).
    """

    def half(self, nominal: float) -> float:
        return 1 / nominal

    def weight(self, at: np.ndarray, nominal: float) -> np.ndarray:
        return np.maximum(1 - nominal * np.abs(at), 0.0)
