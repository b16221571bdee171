"""What a connection plugin must do: turn the channels that were recorded into the voltages and currents of a load."""

from abc import abstractmethod
from typing import ClassVar

import numpy as np

from tractexp.plugin import Plugin


class Connection(Plugin):
    """Base of the connections, chosen by `data.connection=NAME`. Linear and without memory: one matrix per side."""

    group: ClassVar[str] = "connection"
    chosen: ClassVar[bool] = False
    voltages: ClassVar[int] = 3  # channels it takes
    currents: ClassVar[int] = 3

    @abstractmethod
    def voltage(self) -> np.ndarray:
        """(K, voltages): the load's phase voltages from those recorded; K is 3, or 1 for a single-phase load."""

    @abstractmethod
    def current(self) -> np.ndarray:
        """(K, currents): the load's currents from those recorded."""
