"""A static load linear in the voltage."""

from tractexp.extend import Parameter, Static, plugin


@plugin
class AcmeLinear(Static):
    """P_s = P_s0 (1 + a (U/U_0 - 1)), and the same for Q with b.

    Source: ACME handbook 2026, Eq. (1).
    Departures: none.
    """

    slope_p = Parameter(1.0, (0.0, 3.0), "1", "slope of active power", "ACME handbook 2026")
    slope_q = Parameter(2.0, (0.0, 6.0), "1", "slope of reactive power", "ACME handbook 2026")

    def law(self, u, slope_p, slope_q):
        return 1 + slope_p * (u - 1), 1 + slope_q * (u - 1)
