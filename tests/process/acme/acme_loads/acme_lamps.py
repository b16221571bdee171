"""Discharge lamps that go out in a dip."""

from tractexp.extend import Effect, Parameter, plugin, sites

HANDBOOK = "ACME handbook 2026, section 5"


@plugin
class AcmeLamps(Effect):
    """A share d of the static load goes out below a voltage and strikes again slowly.

        lit(t) = min(1, lit(t - dt) + dt/T_d) above u_d, 0 below;
        P_s -> P_s (1 - d (1 - lit)), likewise Q_s

    The edge at u_d is a ramp of 2 % of voltage, so that derivatives exist.

    Source: ACME handbook 2026, section 5.
    Departures: the lamps strike along a ramp, not one by one.
    """

    lamp_share = Parameter(
        0.0, (0.0, 0.5), "1", "share of the static load that is lamps", HANDBOOK, "d", null=0.0
    )
    lamp_level = Parameter(
        0.7, (0.4, 0.9), "1", "voltage below which they go out, over U_0", HANDBOOK, "u_d"
    )
    lamp_time = Parameter(0.5, (0.1, 5.0), "s", "time in which they strike again", HANDBOOK, "T_d")

    places, kind = ("static P", "static Q"), "trip"
    relevant = {"lamp_share": 0.03}
    grid = {"lamp_level": (0.5, 0.7, 0.85), "lamp_time": (0.3, 1.0)}
    confused_with = ("undervoltage_trip", "exponential_recovery")

    def edit(self, eq, lamp_share, lamp_level, lamp_time):
        import sympy

        lit = eq.memory("lamps_lit", r"\ell_d")
        burning = sympy.Max(0, sympy.Min(1, (eq[sites.static_voltage] - lamp_level) / 0.02))
        eq.renews(lit, burning * sympy.Min(1, lit + eq.step / lamp_time), 1)
        for site in (sites.P_static, sites.Q_static):
            eq.edit(site, lambda power: power * (1 - lamp_share * (1 - lit)))
