"""Converters that hold their power."""

from tractexp.model.parts import Effect
from tractexp.parameter import Parameter
from tractexp.plugin import plugin
from tractexp_plugins.effects._operators import smaller

SOURCE = "WECC composite load model (power electronic load); RAMSES vfd_load"
WIDTH = 0.02  # of the power: how rounded the corner at the limit is


@plugin
class ConstantPowerConverter(Effect):
    """A share of the static active power is drawn by converters that keep it constant down to their current limit.

        P_s -> (1 - s) P_s + s P_s0 min(1, u/u_lim),   u = U/U_0

    Below u_lim the current is at its limit and the power falls with the voltage. Power factor one: Q is untouched.
    At s = 0 the base model, whatever u_lim.

    Source: WECC composite load model specification (power electronic load); RAMSES documentation, vfd_load.
    Departures: the corner is rounded over 2 % of the power so that derivatives exist.
    """

    converter_share = Parameter(0.0, (0.0, 1.0), "1", "share in the static active power", SOURCE, "s", null=0.0)
    current_limit = Parameter(0.8, (0.3, 0.98), "1", "voltage over U_0 at which it is reached", SOURCE, "u_{lim}")

    needs = ("static_voltage", "P_static")
    grid = {"current_limit": (0.5, 0.7, 0.8, 0.9)}
    relevant = {"converter_share": 0.15}
    confused_with = ("voltage_dependent_power_limit", "dc_link_lag")

    def edit(self, eq):
        share, limit = eq.declare(self.parameters)
        held = lambda u: smaller(1, u / limit, WIDTH)  # noqa: E731
        power = eq.P_s0 * held(eq.symbol("static_voltage")) / held(1)
        eq.edit("P_static", lambda P: (1 - share) * P + share * power)
