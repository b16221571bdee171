"""The interface of estimator plugins: the window over which phasors are averaged."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from tractexp.configuration.plugin import Plugin, build_chosen, discover
from tractexp.errors import UserError
from tractexp.record.phasor_measurement import Averager, make_weighted_averager
from tractexp.record.window import Window

SPACING = 1e-3  # s between the weights that a record stores, as phasors are a millisecond apart


class Estimator(Plugin):
    """Base of the phasor estimators, chosen by `data.estimator=NAME`, or by name and settings.

    An estimator is the window over which the least-squares sinusoid of the frequency really present
    is taken (`tractexp.record.phasor_measurement.fundamental`), so that any is exact in steady
    state; they differ in what they do to changes, harmonics and noise.
    """

    group: ClassVar[str] = "estimator"
    chosen: ClassVar[bool] = False
    usual: ClassVar[bool] = False  # taken where none is chosen

    @abstractmethod
    def half(self, nominal: float) -> float:
        """Half of the window's length [s].

        Parameters
        ----------
        nominal : float [Hz]
            Frequency of the grid.

        Raises
        ------
        UserError
            For a frequency that it does not support.
        """

    @abstractmethod
    def weight(self, at: np.ndarray, nominal: float) -> np.ndarray:
        """The window.

        Parameters
        ----------
        at : (W,) [s]
            Times about the center, none further away than half.
        nominal : float [Hz]
            Frequency of the grid.

        Returns
        -------
        (W,) array
            Symmetric weights, of any scale.
        """

    def averager(self, rate: float, nominal: float) -> Averager:
        """The window on samples.

        Parameters
        ----------
        rate : float [Hz]
            At which they were taken.
        nominal : float [Hz]
            Frequency of the grid.

        Returns
        -------
        Averager
            What averages waveforms over it.
        """
        reach = int(self.half(nominal) * rate + 1e-9)
        return make_weighted_averager(self.weight(np.arange(-reach, reach + 1) / rate, nominal))

    def window(self, nominal: float) -> Window:
        """The window as a record stores it, at the nominal frequency."""
        half = self.half(nominal)
        count = max(round(2 * half / SPACING), 2)
        at = (np.arange(count) + 0.5) / count * 2 * half - half
        weights = self.weight(at, nominal)
        return Window(self.name, at, weights / weights.sum())


def estimator_of(setting: str | Mapping[str, object] | None = None) -> Estimator:
    """The estimator of a setting: a name, a mapping of name and settings, or None for the usual
    one.
    """
    if setting is None:
        estimators = discover()[Estimator.group].items()
        setting = min(name for name, cls in estimators if getattr(cls, "usual", False))
    return build_chosen(Estimator.group, setting)


def list_estimators(nominal: float) -> list[Estimator]:
    """The estimators that support a nominal frequency [Hz], each with its default settings."""
    supporting: list[Estimator] = []
    for name in sorted(discover()[Estimator.group]):
        one = estimator_of(name)
        try:
            one.half(nominal)
        except UserError:
            continue
        supporting.append(one)
    return supporting
