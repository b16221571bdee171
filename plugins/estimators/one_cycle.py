"""The least-squares sinusoid in a window of one cycle."""

import numpy as np

from tractexp.plugin import plugin
from tractexp.record.phasor import fundamental
from tractexp.recording import Estimator


@plugin
class OneCycle(Estimator):
    """The least-squares sinusoid in a window of one cycle of the frequency really present.

        min over X of the sum over the window of (x - sqrt(2) Re(X e^{j phi}))^2

    Its two end samples are weighted by what is left over of the cycle, so that the window is one cycle long to a
    fraction of a sample.

    Source: Phadke and Thorp 2008, Synchronized Phasor Measurements, section 2.4 (weighted least squares).
    """

    def phasors(self, waves: np.ndarray, rate: float, frequency: np.ndarray) -> tuple[slice, np.ndarray]:
        return fundamental(waves, rate, frequency)

    def window(self, nominal: float) -> tuple[np.ndarray, np.ndarray]:
        at = (np.arange(20) - 9.5) / 20 / nominal
        return np.full(20, 1 / 20), at
