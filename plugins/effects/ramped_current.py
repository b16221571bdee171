"""Converters that lower their current with the voltage at once and raise it along a ramp."""

from tractexp.extend import Effect, Parameter, plugin, sites

from ._operators import ramp

SOURCE = "WECC 2014, generic converter model REGC_A: low-voltage current limit, recovery ramp"
RAMP_CORNER = 0.02  # of the current: how rounded the corners are


@plugin
class RampedCurrent(Effect):
    """A share of the static active power is drawn by converters whose current may fall quickly and
    returns slowly.

        P_s -> (1 - s) P_s + s P_s0 u i,   di/dt = min((m(u)/m(1) - i)/T_f, r),   u = U/U_0
        m(u) = min(1, max(0, (u - u_none)/(u_all - u_none)))

    Power factor one: Q is untouched. At s = 0 the base model, whatever the rest.

    Source: WECC 2014, REGC_A, where the current is a generator's; here the same limits of a load.
    Departures: one lag stands for the current's control and the measurement of the voltage; corners
    are rounded over 2 % of the current; levels count from the voltage before the event.
    """

    ramped_share = Parameter(
        0.0, (0.0, 1.0), "1", "share in the static active power", SOURCE, "s_r", null=0.0
    )
    ramp_rate = Parameter(5.0, (0.3, 100.0), "1/s", "how fast the current comes back", SOURCE, "r")
    ramp_full = Parameter(
        0.9, (0.75, 1.0), "1", "voltage of full current, over U_0", SOURCE, "u_{all}"
    )
    ramp_none = Parameter(
        0.5, (0.0, 0.74), "1", "voltage of no current, over U_0", SOURCE, "u_{none}"
    )
    ramp_fall = Parameter(0.01, (0.004, 0.1), "s", "time in which the current falls", SOURCE, "T_f")

    places, kind = ("converter share",), "lag"
    family, differs = "dc_link_lag", "whose current returns along a ramp"
    grid = {
        "ramp_rate": (1.5, 5.0, 15.0),
        "ramp_full": (0.8, 0.9, 0.97),
        "ramp_none": (0.2, 0.5, 0.7),
    }
    relevant = {"ramped_share": 0.1}
    confused_with = ("exponential_recovery", "undervoltage_trip", "voltage_dependent_power_limit")

    def edit(self, eq, ramped_share, ramp_rate, ramp_full, ramp_none, ramp_fall):
        import sympy

        u = eq[sites.static_voltage]
        allowed = lambda u: ramp((u - ramp_none) / (ramp_full - ramp_none), RAMP_CORNER)  # noqa: E731
        current = eq.lag("ramped_current", "i_r")
        aim = eq.define("current_allowed", allowed(u) / allowed(1), "m")
        eq.moves(current, sympy.Min((aim - current) / ramp_fall, ramp_rate), 1)
        drawn = eq.P_s0 * u * current
        eq.edit(sites.P_static, lambda P: (1 - ramped_share) * P + ramped_share * drawn)
