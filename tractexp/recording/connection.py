"""The interface of connection plugins: the voltages and currents of a load from
recorded channels.
"""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from tractexp.configuration.plugin import Plugin, discover

SINGLE = (
    "a single-phase load: U is its own voltage, P + jQ = V I* of the fundamental; static loads and"
    " converters' effects apply as they stand, but the models' motors are three-phase on balanced"
    " voltages: here they are equivalents, whose parameters are those of no machine"
)


class Connection(Plugin):
    """Base of the connections, chosen by `data.connection=NAME`, or by name and settings.

    A connection turns recorded channels into the voltages and currents of a load's phases. It is
    linear and without memory: one matrix for the voltages, one for the currents.
    """

    group: ClassVar[str] = "connection"
    chosen: ClassVar[bool] = False
    lines: ClassVar[bool] = False  # its voltages are measured between phases
    # {(voltages, currents, between phases): settings}: it is taken for so many channels where
    # nothing else is said
    usual: ClassVar[Mapping[tuple[int, int, bool], Mapping[str, Any]]] = {}

    @abstractmethod
    def voltage(self) -> np.ndarray:
        """The matrix that makes a load's voltages of those recorded.

        Returns
        -------
        (K, voltages) array
            K phases to ground: 3, or 1 for a single-phase load.
        """

    @abstractmethod
    def current(self) -> np.ndarray:
        """The matrix that makes a load's currents of those recorded.

        Returns
        -------
        (K, currents) array
            K as of the voltages; positive into the load.
        """

    @property
    def voltages(self) -> int:
        """The number of voltage channels that it takes."""
        return self.voltage().shape[1]

    @property
    def currents(self) -> int:
        """The number of current channels that it takes."""
        return self.current().shape[1]

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes for every record with this connection, one sentence each."""
        return (SINGLE,) if len(self.voltage()) == 1 else ()


def choose_usual_connection(voltages: int, currents: int, lines: bool = False) -> Any:
    """The default connection of so many channels.

    Parameters
    ----------
    voltages, currents : int
        How many channels there are.
    lines : bool
        Whether the voltages are between phases.

    Returns
    -------
    name, {"name": name, **settings} or None
        None: nothing is usual for so many.

    Examples
    --------
    >>> choose_usual_connection(3, 3)
    'three_phase'
    """
    for name, cls in sorted(discover()[Connection.group].items()):
        settings = getattr(cls, "usual", {}).get((voltages, currents, lines))
        if settings is not None:
            return {"name": name, **settings} if settings else name
    return None
