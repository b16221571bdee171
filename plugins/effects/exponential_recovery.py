"""Load that recovers after a voltage step."""

from tractexp.extend import Effect, Parameter, plugin, sites

SOURCE = "Karlsson, Hill 1994, IEEE Trans. Power Systems 9(1), Eqs. (1)-(3)"


@plugin
class ExponentialRecovery(Effect):
    """The static load first falls with the voltage, then recovers towards another exponent.

        T_r dx/dt = P_s (u^D - 1) - x,   P_s -> P_s + x,   u = U/U_0

    and likewise for Q: D is what the exponent in the long run has more than at the moment of the
    step, negative for a load that comes back. At D = 0 the base model, whatever T_r.

    Source: Karlsson, Hill 1994, Eqs. (1)-(3), exponents alpha_t at once and alpha_s in the long
    run; D is alpha_s less alpha_t.
    Departures: P and Q share one time constant; the present exponent is that of whatever static
    load the model has.
    """

    recovery_P = Parameter(
        0.0, (-3.0, 3.0), "1", "long-run less immediate exponent of P", SOURCE, r"D_p", null=0.0
    )
    recovery_Q = Parameter(
        0.0, (-3.0, 3.0), "1", "long-run less immediate exponent of Q", SOURCE, r"D_q", null=0.0
    )
    recovery_time = Parameter(
        0.5, (0.05, 60.0), "s", "time constant of the recovery", SOURCE, "T_r"
    )

    places, kind = ("static P", "static Q"), "lag"
    grid = {"recovery_time": (0.1, 0.3, 1.0, 3.0, 10.0)}
    relevant = {"recovery_P": 0.2, "recovery_Q": 0.2}
    confused_with = ("undervoltage_trip", "load_change", "second_motor_group")

    def edit(self, eq, recovery_P, recovery_Q, recovery_time):
        u = eq[sites.static_voltage]
        for letter, site, exponent in (
            ("P", sites.P_static, recovery_P),
            ("Q", sites.Q_static, recovery_Q),
        ):
            x = eq.lag(f"recovered_{letter}", f"x_{letter}")
            eq.moves(x, (eq.expression(site) * (u**exponent - 1) - x) / recovery_time, 0)
            eq.edit(site, lambda power, x=x: power + x)
