"""A static load of impedances and of machines that hold their current."""

from tractexp.extend import Parameter, Static, plugin

HANDBOOK = "ACME handbook 2026, Eq. (7)"


@plugin
class AcmeMixed(Static):
    """P_s = P_s0 ((1 - c) u^2 + c u) (f/f_0)^k, Q_s = Q_s0 u^2, u = U/U_0.

    Source: ACME handbook 2026, Eq. (7).
    Departures: none.
    """

    current_share = Parameter(
        0.3, (0.0, 1.0), "1", "share of constant current in P_s", HANDBOOK, "c"
    )
    frequency_slope = Parameter(1.0, (-2.0, 2.0), "1", "exponent of the frequency", HANDBOOK, "k")

    reads = ("f",)

    def law(self, u, f, current_share, frequency_slope):
        return ((1 - current_share) * u**2 + current_share * u) * f**frequency_slope, u**2

    def require(self, current_share):
        yield (
            1 - current_share,
            "the share of constant current exceeds 1: it is {value:g}",
            current_share,
        )
