"""One voltage and one current."""

import numpy as np

from tractexp.extend import Connection, plugin


@plugin
class SinglePhase(Connection):
    """One voltage and one current: a feeder at 15, 25 or 27.5 kV, whatever transformer stands
    before it.

        P + jQ = V I*, of the fundamental

    Q is that of the fundamental, Q_1 of IEEE 1459; what harmonics carry besides is P_H
    (`data.harmonics`).

    Source: IEEE 1459-2010, 3.1.2.
    """

    usual = {(1, 1, False): {}}

    def voltage(self) -> np.ndarray:
        return np.eye(1)

    def current(self) -> np.ndarray:
        return np.eye(1)
