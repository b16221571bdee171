"""Heating under thermostats, which comes back to its heat."""

from tractexp.extend import Effect, Parameter, plugin, sites

SOURCE = "Kundur 1994, section 7.1 (thermostatically controlled loads)"
FULL = 0.01  # s: how soon the last of it is switched on where all is on


@plugin
class ThermostaticLoad(Effect):
    """A share of the static active power is heating whose thermostats switch on more as long as
    heat is missing.

        P_s -> (1 - s) P_s + s P_s0 g u^2,   T_h dg/dt = 1 - g u^2,   g <= g_max,   u = U/U_0

    g is the conductance that is switched on, over that before the event. In a dip the power falls
    with u^2 and comes back as thermostats close, until all are closed at g_max; when the voltage
    returns it is too much for a while. Q is untouched. At s = 0 the base model, whatever T_h and
    g_max.

    Source: Kundur 1994, section 7.1: a conductance set by what the temperature lacks, up to a
    largest one.
    Departures: the many heaters are one whose losses are constant, so that what heat is missing is
    the integral of 1 - g u^2 and T_h stands for capacity and thermostats together; the limit is
    reached within some 10 ms.
    """

    heating_share = Parameter(
        0.0, (0.0, 1.0), "1", "share in the static active power", SOURCE, "s_h", null=0.0
    )
    heating_time = Parameter(
        0.6, (0.2, 20.0), "s", "time in which the heat comes back", SOURCE, "T_h"
    )
    heating_most = Parameter(
        1.5, (1.05, 2.5), "1", "all that can be on, over what was before", SOURCE, "g_{max}"
    )

    places, kind = ("static P",), "lag"
    family, differs = "exponential_recovery", "as of heating under thermostats"
    grid = {"heating_time": (0.3, 0.6, 1.2, 3.0), "heating_most": (1.2, 1.5, 2.0)}
    relevant = {"heating_share": 0.1}
    confused_with = ("exponential_recovery", "dc_link_lag", "undervoltage_trip")

    def edit(self, eq, heating_share, heating_time, heating_most):
        import sympy

        square = eq[sites.static_voltage] ** 2
        on = eq.lag("heating_on", "g_h")
        missing = (1 - on * square) / heating_time
        eq.moves(on, sympy.Min(missing, (heating_most - on) / FULL), 1)
        heat = eq.P_s0 * on * square
        eq.edit(sites.P_static, lambda P: (1 - heating_share) * P + heating_share * heat)
