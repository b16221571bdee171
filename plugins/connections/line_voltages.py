"""Three line voltages and three currents."""

from dataclasses import field

import numpy as np

from tractexp.extend import Connection, plugin

from ._phases import check_pairs, from_lines


@plugin
class LineVoltages(Connection):
    """The line voltages V_ab, V_bc, V_ca and the phase currents a, b, c.

        V_a = (V_ab - V_ca) / 3, and so on round

    Their zero sequence is not recorded and taken as absent; it carries no power into a load without
    neutral, and the positive and negative sequence do not depend on it.

    Source: IEEE 1459-2010, 3.2.2 (three-wire systems).
    """

    lines = True
    usual = {(3, 3, True): {}}

    # of phases, in the order of data.voltages
    pairs: list[str] = field(default_factory=lambda: ["ab", "bc", "ca"])

    def check(self) -> None:
        check_pairs(self.pairs, 3, "e.g. [ab, bc, ca]")

    def voltage(self) -> np.ndarray:
        return from_lines(self.pairs)

    def current(self) -> np.ndarray:
        return np.eye(3)
