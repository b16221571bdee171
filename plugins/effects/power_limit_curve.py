"""Traction power limited at low line voltage by a curve of its own, and by what was measured over a
while.
"""

import numpy as np

from tractexp.extend import Curve, Effect, Parameter, plugin, sites

from ._operators import bent, evaluate_law, ramp

SOURCE = "EN 50388-1, limitation of current or power at low line voltage"
KNOT, BEND = 0.5, 0.1  # of the way from full power to none
POWER_CORNER = 0.02  # of the power: how rounded the corners are


def _compute_allowed_power(u, full, off, bend, rest):
    return ramp(1 - bent((full - u) / (full - off), (KNOT,), (bend,), BEND), POWER_CORNER, rest)


@plugin
class PowerLimitCurve(Effect):
    """A share of the static active power is reduced at low voltage by a curve of the voltage
    measured over a while.

        P_s -> (1 - s) P_s + s P_s0 m(x)/m(1) u/x,   T_c dx/dt = u - x,   u = U/U_0
        m(x) = min(1, max(r, 1 - h((u_full - x)/(u_full - u_off))))

    h has slope 1 over the first half of the way down and exp(a) beyond, its corner rounded over a
    tenth; r of the power is left whatever the voltage. While x follows, power slips with u/x. At a
    = r = 0 and a small T_c it is `voltage_dependent_power_limit`, at s = 0 the base model.

    Source: EN 50388-1 leaves the curve between its two levels, and the measurement of the voltage,
    to the train.
    Departures: those of `voltage_dependent_power_limit`; two slopes and a rest stand for the curve,
    one lag for the measurement.
    """

    curve_limited = Parameter(
        0.0, (0.0, 1.0), "1", "share in the static active power", SOURCE, "s_c", null=0.0
    )
    curve_full = Parameter(
        0.9, (0.75, 1.0), "1", "voltage of full power, over U_0", SOURCE, "u_{full}"
    )
    curve_off = Parameter(
        0.65, (0.3, 0.74), "1", "voltage of no power were the curve straight", SOURCE, "u_{off}"
    )
    curve_time = Parameter(
        0.03, (0.004, 0.3), "s", "time over which the voltage is measured", SOURCE, "T_c"
    )
    limit_bend = Parameter(
        0.0, (-4.0, 1.5), "1", "logarithm of the second slope over the first", SOURCE, "a"
    )
    limit_rest = Parameter(
        0.0, (0.0, 0.9), "1", "power that is left at the lowest voltage", SOURCE, "r"
    )

    places, kind = ("converter share",), "limit"
    family, differs = "voltage_dependent_power_limit", "but not by the catalogue's law"
    as_textbook = {
        "curve_limited": "limited_share",
        "curve_full": "full_level",
        "curve_off": "off_level",
    }
    grid = {
        "curve_full": (0.8, 0.9, 0.97), "curve_off": (0.4, 0.55, 0.7),
        "curve_time": (0.004, 0.03, 0.1), "limit_rest": (0.0, 0.3),
    }  # fmt: skip
    likely = {"limit_bend": 1.5}
    relevant = {"curve_limited": 0.1}
    confused_with = ("voltage_dependent_power_limit", "constant_power_converter", "dc_link_lag")

    def edit(self, eq, curve_limited, curve_full, curve_off, curve_time, limit_bend, limit_rest):
        allowed = lambda x: _compute_allowed_power(x, curve_full, curve_off, limit_bend, limit_rest)  # noqa: E731
        u = eq[sites.static_voltage]
        voltage = eq.lag("measured_voltage", "x_u")
        eq.moves(voltage, (u - voltage) / curve_time, 1)
        power = (
            eq.P_s0 * eq.define("power_allowed", allowed(voltage) / allowed(1), "m") * u / voltage
        )
        eq.edit(sites.P_static, lambda P: (1 - curve_limited) * P + curve_limited * power)

    def curve(self, curve_limited, curve_full, curve_off, curve_time, limit_bend, limit_rest):
        u = np.linspace(0.4, 1.0, 61)
        allowed = lambda x: _compute_allowed_power(x, curve_full, curve_off, limit_bend, limit_rest)  # noqa: E731
        return Curve(
            u,
            evaluate_law(lambda x: allowed(x) / allowed(1), u),
            "voltage over that before",
            "power allowed",
        )
