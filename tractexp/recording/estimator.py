"""What an estimator plugin must do: phasors from sampled waveforms."""

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from tractexp.plugin import Plugin


class Estimator(Plugin):
    """Base of the phasor estimators, chosen by `data.estimator=NAME`. Linear in the waveforms."""

    group: ClassVar[str] = "estimator"
    chosen: ClassVar[bool] = False

    @abstractmethod
    def phasors(self, waves: np.ndarray, rate: float, frequency: np.ndarray) -> tuple[slice, np.ndarray]:
        """RMS phasors of `waves` (K, N) sampled at `rate` [Hz], whose frequency (N,) [Hz] is known.

        Returns the samples covered and the phasors (K, M) complex there, stamped at the window's center, in the frame
        that turns at `frequency` (`tractexp.record.phasor.frame`).
        """

    @abstractmethod
    def window(self, nominal: float) -> tuple[np.ndarray, np.ndarray]:
        """The weights (W,) of the window, of sum 1, at times (W,) [s] about its center, at the nominal frequency."""
