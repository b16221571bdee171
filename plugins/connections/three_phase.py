"""Three voltages to ground and three currents."""

import numpy as np

from tractexp.extend import Connection, plugin


@plugin
class ThreePhase(Connection):
    """Phase voltages to ground and phase currents, both in the order a, b, c: taken as they are.

    Source: IEEE 1459-2010, 3.2.2.
    """

    usual = {(3, 3, False): {}}

    def voltage(self) -> np.ndarray:
        return np.eye(3)

    def current(self) -> np.ndarray:
        return np.eye(3)
