"""Diode bridges that feed constant power."""

from tractexp.extend import Effect, Parameter, plugin, sites

from ._operators import larger, smaller

SOURCE = "Mohan, Undeland and Robbins 2003, Power Electronics, sections 5-3 and 5-6"
RECTIFIER_CORNER = 0.005  # of the current: how rounded the corner at the limit is
SMALLEST_STATIC_Q = 1e-12  # pu, for a static load without reactive power


def _current(u, k, limit):
    """The current over that before at which i (u - k i) is (1 - k), up to a limit and to the most
    the bridge feeds.
    """
    import sympy

    most = sympy.sqrt(larger(u**2 - 4 * k * (1 - k), 0, RECTIFIER_CORNER / 10))
    return smaller((u - most) / (2 * k), limit, RECTIFIER_CORNER)


def _powers(u, k, i):
    """Active and reactive power that the bridge takes at the current i, over the apparent power
    before.
    """
    import sympy

    return i * (u - k * i), i * sympy.sqrt(k * i * (2 * u - k * i))


@plugin
class Rectifier(Effect):
    """A share of the static active power is drawn by diode bridges that feed constant dc power.

        u_d = u - k i,   i = min(i_max, (u - sqrt(u^2 - 4 k (1 - k)))/(2 k)),   u = U/U_0
        P_s -> (1 - s) P_s + s P_s0 i u_d/(1 - k)
        Q_s -> (1 - r) Q_s + r Q_s0 i sqrt(u^2 - u_d^2)/q,   r = s P_s0 q/(Q_s0 (1 - k)),
        q = sqrt(1 - (1 - k)^2)

    Commutation costs the dc voltage u_d a part k of the current i, and the power factor falls with
    u_d/u. Below the voltage at which the power can be had the current is u/(2 k), the most power
    there is. At s = 0 the base model, whatever k and i_max. At k -> 0 it is
    `constant_power_converter` without delay.

    Source: constant current of a bridge behind a reactance, Mohan, Undeland and Robbins 2003,
    sections 5-3 and 5-6.
    Departures: no ripple; the dc side follows at once; corners are rounded over 0.5 % of the
    current.
    """

    rectified_share = Parameter(
        0.0, (0.0, 1.0), "1", "share in the static active power", SOURCE, "s_b", null=0.0
    )
    commutation = Parameter(0.1, (0.02, 0.3), "1", "dc voltage that commutation costs", SOURCE, "k")
    rectified_limit = Parameter(
        1.4, (1.05, 3.0), "1", "largest current over that before", SOURCE, "i_{max}"
    )

    places, kind = ("converter share", "static Q"), "limit"
    family, differs = "constant_power_converter", "behind diode bridges"
    grid = {"commutation": (0.05, 0.12, 0.2), "rectified_limit": (1.15, 1.4, 2.0)}
    relevant = {"rectified_share": 0.15}
    confused_with = (
        "constant_power_converter",
        "voltage_dependent_power_limit",
        "static_var_compensator",
    )

    def edit(self, eq, rectified_share, commutation, rectified_limit):
        u = eq[sites.static_voltage]
        i = _current(u, commutation, rectified_limit) / _current(1, commutation, rectified_limit)
        P, Q = _powers(u, commutation, eq.define("bridge_current", i, "i_b"))
        P_0, Q_0 = _powers(1, commutation, 1)
        eq.edit(
            sites.P_static,
            lambda P_s: (1 - rectified_share) * P_s + rectified_share * eq.P_s0 * P / P_0,
        )
        scale = rectified_share * eq.P_s0 / P_0
        eq.edit(
            sites.Q_static,
            lambda Q_s: Q_s + scale * (Q - Q_0 * Q_s / (eq.Q_s0 + SMALLEST_STATIC_Q)),
        )
