"""Traction power limited at low line voltage."""

from tractexp.extend import Effect, Parameter, plugin, sites

from ._operators import ramp, seen_late

SOURCE = "EN 50388-1, limitation of current or power at low line voltage"
VOLTAGE_LIMIT_CORNER = 0.02  # of the power: how rounded the corners are


@plugin
class VoltageDependentPowerLimit(Effect):
    """A share of the static active power is traction that must be reduced when the line voltage is
    low.

        P_s -> (1 - s) P_s + s P_s0 min(1, max(0, (u_c - u_off)/(u_full - u_off))) u/u_c,
        u_c = u - T_l du/dt

    with u = U/U_0: full power down to u_full, then linearly down to none at u_off. The control sees
    the voltage T_l late, so that the power slips while the voltage moves. At s = 0 the base model,
    whatever the levels and T_l.

    Source: EN 50388-1: at 25 kV full power down to a U_n, a = 0.9, none at U_min2 = 17.5 kV.
    Departures: levels count from the voltage before the event; what the auxiliaries draw at the end
    belongs to the other share; corners are rounded over 2 % of the power so that derivatives exist;
    the delay is the first term of a lag, exact as long as T_l is short against the edges of the
    dip.
    """

    limited_share = Parameter(
        0.0, (0.0, 1.0), "1", "share in the static active power", SOURCE, "s_l", null=0.0
    )
    full_level = Parameter(
        0.9, (0.75, 1.0), "1", "voltage of full power, over U_0", SOURCE, "u_{full}"
    )
    off_level = Parameter(
        0.65, (0.3, 0.74), "1", "voltage of no power, over U_0", SOURCE, "u_{off}"
    )
    limit_delay = Parameter(
        0.003, (0.0, 0.01), "s", "delay of the voltage it acts on", SOURCE, "T_l"
    )

    places, kind = ("converter share",), "limit"
    grid = {"full_level": (0.8, 0.9, 0.97), "off_level": (0.4, 0.55, 0.7)}
    relevant = {"limited_share": 0.1}
    confused_with = ("constant_power_converter", "undervoltage_trip")

    def edit(self, eq, limited_share, full_level, off_level, limit_delay):
        allowed = lambda u: ramp((u - off_level) / (full_level - off_level), VOLTAGE_LIMIT_CORNER)  # noqa: E731
        u = eq[sites.static_voltage]
        delayed = seen_late(eq, u, limit_delay)
        power = eq.P_s0 * allowed(delayed) / allowed(1) * u / delayed
        eq.edit(sites.P_static, lambda P: (1 - limited_share) * P + limited_share * power)
