"""Exponential static load."""

from tractexp.model.parts import Static
from tractexp.parameter import Parameter
from tractexp.plugin import plugin

PAPER = "Wu, Fan, Zou 2022, Energies 15(14) 5034, Eq. (6)"


@plugin
class Exponential(Static):
    r"""Static load whose power follows a power of the voltage, independent of frequency.

        P_s = P_s0 (U/U_0)^p_v        Q_s = Q_s0 (U/U_0)^q_v

    P_s0 and Q_s0 are not identified: they are what the motor leaves of the power before the event.

    Source: Wu, Fan, Zou 2022, Eq. (6).
    Departures: none.
    """

    p_v = Parameter(1.5, (0.0, 4.0), "1", "voltage exponent of active power", PAPER)
    q_v = Parameter(2.5, (0.0, 8.0), "1", "voltage exponent of reactive power", PAPER)

    def declare(self, eq):
        p_v, q_v = eq.declare(self.parameters)
        u = eq.define("static_voltage", eq.U / eq.U0, "u")
        P = eq.define("P_static", eq.P_s0 * u**p_v, "P_s")
        Q = eq.define("Q_static", eq.Q_s0 * u**q_v, "Q_s")
        eq.consume(P, Q)
