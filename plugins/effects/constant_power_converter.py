"""Converters that hold their power."""

from tractexp.extend import Effect, Parameter, plugin, sites

from ._operators import seen_late, smaller

SOURCE = "WECC composite load model (power electronic load); RAMSES vfd_load"
CURRENT_LIMIT_CORNER = 0.02  # of the power: how rounded the corner at the limit is


@plugin
class ConstantPowerConverter(Effect):
    """A share of the static active power is drawn by converters that keep it constant down to their
    current limit.

        P_s -> (1 - s) P_s + s P_s0 min(1, u_c/u_lim) u/u_c,   u_c = u - T_c du/dt,   u = U/U_0

    Below u_lim the current is at its limit and the power falls with the voltage. The control sets
    the current by the voltage it sees, T_c late, so that the power slips while the voltage moves.
    Power factor one: Q is untouched. At s = 0 the base model, whatever u_lim and T_c.

    Source: WECC composite load model specification (power electronic load); RAMSES documentation,
    vfd_load.
    Departures: the corner is rounded over 2 % of the power so that derivatives exist; the voltage's
    filter is the first term of a lag, exact as long as T_c is short against the edges of the dip.
    """

    converter_share = Parameter(
        0.0, (0.0, 1.0), "1", "share in the static active power", SOURCE, "s", null=0.0
    )
    current_limit = Parameter(
        0.8, (0.3, 0.98), "1", "voltage over U_0 at which it is reached", SOURCE, "u_{lim}"
    )
    control_delay = Parameter(
        0.003, (0.0, 0.01), "s", "delay of the voltage it acts on", SOURCE, "T_c"
    )

    places, kind = ("converter share",), "limit"
    grid = {"current_limit": (0.5, 0.7, 0.8, 0.9)}
    relevant = {"converter_share": 0.15}
    confused_with = ("voltage_dependent_power_limit", "dc_link_lag")

    def edit(self, eq, converter_share, current_limit, control_delay):
        held = lambda u: smaller(1, u / current_limit, CURRENT_LIMIT_CORNER)  # noqa: E731
        u = eq[sites.static_voltage]
        delayed = seen_late(eq, u, control_delay)
        power = eq.P_s0 * held(delayed) / held(1) * u / delayed
        eq.edit(sites.P_static, lambda P: (1 - converter_share) * P + converter_share * power)
