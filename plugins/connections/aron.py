"""Two current transformers."""

import numpy as np

from tractexp.extend import Connection, check_choice, plugin

from ._phases import TWO, from_two


@plugin
class Aron(Connection):
    """Three phase voltages to ground and the currents of two phases: i_b = -i_a - i_c.

    A zero sequence of current is taken as absent, as it is in a load without neutral and without a
    fault to ground; where there is one, the third current is wrong by three times it. (Two line
    voltages and two currents are `two_line_voltages` with `phases: ac`.)

    Source: Aron 1892 (two-wattmeter method); IEEE 1459-2010, 3.2.2.
    """

    usual = {(3, 2, False): {}}

    phases: str = "ac"  # in the order of data.currents

    def check(self) -> None:
        check_choice("data.connection.phases", self.phases, TWO)

    @property
    def notes(self) -> tuple[str, ...]:
        missing = next(p for p in "abc" if p not in self.phases)
        return (
            f"the current of phase {missing} is minus the sum of the others: no zero sequence is"
            " assumed",
        )

    def voltage(self) -> np.ndarray:
        return np.eye(3)

    def current(self) -> np.ndarray:
        return from_two(self.phases)
