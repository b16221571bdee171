"""Two line voltages, and three currents or two."""

from dataclasses import field

import numpy as np

from tractexp.extend import Connection, check_choice, plugin

from ._phases import TWO, check_pairs, from_lines, from_two


@plugin
class TwoLineVoltages(Connection):
    """Two line voltages, as two voltage transformers in V (open delta) give them, and the phase
    currents.

        V_a = (2 V_ab + V_bc) / 3, V_b = (V_bc - V_ab) / 3, V_c = -(V_ab + 2 V_bc) / 3

    A zero sequence of voltage is not seen and taken as absent. With `phases` of two letters two
    currents are taken, and the third is minus their sum: a zero sequence of current is then taken
    as absent as well.

    Source: IEEE 1459-2010, 3.2.2 (three-wire systems); Blondel's theorem.
    """

    lines = True
    usual = {(2, 3, True): {}, (2, 2, True): {"phases": "ac"}}

    # of phases, in the order of data.voltages
    pairs: list[str] = field(default_factory=lambda: ["ab", "bc"])
    # in the order of data.currents; two letters, e.g. ac, where there are two current transformers
    phases: str = "abc"

    def check(self) -> None:
        check_pairs(self.pairs, 2, "e.g. [ab, bc]")
        if self.phases != "abc":
            check_choice("data.connection.phases", self.phases, TWO)

    def voltage(self) -> np.ndarray:
        return from_lines(self.pairs)

    def current(self) -> np.ndarray:
        return np.eye(3) if self.phases == "abc" else from_two(self.phases)
