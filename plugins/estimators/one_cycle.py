"""The least-squares sinusoid in a window of one cycle."""

import numpy as np

from tractexp.extend import Averager, Estimator, one_cycle, plugin


@plugin
class OneCycle(Estimator):
    """The least-squares sinusoid in a window of one cycle of the frequency really present.

        min over X of the sum over the window of (x - sqrt(2) Re(X e^{j phi}))^2

    Its two end samples are weighted by what is left over of the cycle, so that the window is one
    cycle long to a fraction of a sample, and harmonics vanish at any frequency.

    Source: Phadke and Thorp 2008, Synchronized Phasor Measurements, section 2.4 (weighted least
    squares).
    """

    usual = True

    def half(self, nominal: float) -> float:
        return 0.5 / nominal

    def weight(self, at: np.ndarray, nominal: float) -> np.ndarray:
        return np.ones(len(at))

    def averager(self, rate: float, nominal: float) -> Averager:
        return one_cycle(rate, nominal)
