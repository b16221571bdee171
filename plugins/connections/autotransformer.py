"""Contact line and negative feeder of a railway fed through autotransformers."""

import numpy as np

from tractexp.extend import Connection, check_choice, plugin


@plugin
class Autotransformer(Connection):
    """The contact line and the negative feeder of a 2x25 kV railway, 180 degrees apart, each with
    its current.

        P + jQ = U_c I_c* + U_f I_f* = (U_c - U_f)/2 (I_c - I_f)*

    of voltages to the rail that are opposite to each other; the record's voltage is (U_c - U_f)/2,
    that of a train. What the two voltages have in common drives a current in the rail, whose power
    is left out. With `voltage_of: between` the one voltage recorded is that between the two
    conductors, U_c - U_f. Currents count from the substation outwards in both conductors; with
    `feeder: inward` that of the negative feeder counts the other way.

    Source: EN 50163 (nominal voltages of 25 kV systems); IEEE 1459-2010, 3.1.2 (power of the
    fundamental).
    """

    usual = {(2, 2, False): {}, (1, 2, False): {"voltage_of": "between"}}

    # each conductor to the rail, or between: one voltage from conductor to conductor
    voltage_of: str = "each"
    # outward or inward: how the current of the negative feeder counts
    feeder: str = "outward"

    def check(self) -> None:
        check_choice("data.connection.voltage_of", self.voltage_of, ("each", "between"))
        check_choice("data.connection.feeder", self.feeder, ("outward", "inward"))

    def voltage(self) -> np.ndarray:
        return np.array([[0.5, -0.5]]) if self.voltage_of == "each" else np.array([[0.5]])

    def current(self) -> np.ndarray:
        return np.array([[1.0, -1.0 if self.feeder == "outward" else 1.0]])
