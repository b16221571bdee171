"""Traction power limited at low line voltage by a curve of its own."""

import numpy as np

from tractexp.extend import Curve, Effect, Parameter, plugin, sites

from ._operators import bent, drawn, larger, seen_late, smaller

SOURCE = "EN 50388-1, limitation of current or power at low line voltage"
KNOTS, BEND = (1 / 3, 2 / 3), 0.1  # of the way from full power to none
WIDTH = 0.02  # of the power: how rounded the corners are


def _allowed(u, full, off, bends):
    return smaller(1, larger(0, 1 - bent((full - u) / (full - off), KNOTS, bends, BEND), WIDTH), WIDTH)


@plugin
class PowerLimitCurve(Effect):
    """A share of the static active power is reduced at low voltage, as `voltage_dependent_power_limit` has it.

        P_s -> (1 - s) P_s + s P_s0 min(1, max(0, 1 - h((u_full - u_c)/(u_full - u_off)))) u/u_c

    h has slope 1 over the first third of the way down, exp(a_1) over the second and exp(a_2) beyond, its corners
    rounded over a tenth. At a_1 = a_2 = 0 it is `voltage_dependent_power_limit`, at s = 0 the base model.

    Source: EN 50388-1 leaves the curve between its two levels to the train.
    Departures: those of `voltage_dependent_power_limit`; three slopes stand for the curve.
    """

    curve_limited = Parameter(0.0, (0.0, 1.0), "1", "share in the static active power", SOURCE, "s_c", null=0.0)
    curve_full = Parameter(0.9, (0.75, 1.0), "1", "voltage of full power, over U_0", SOURCE, "u_{full}")
    curve_off = Parameter(0.65, (0.3, 0.74), "1", "voltage of no power were the curve straight", SOURCE, "u_{off}")
    curve_delay = Parameter(0.003, (0.0, 0.01), "s", "delay of the voltage it acts on", SOURCE, "T_c")
    limit_bend_1 = Parameter(0.0, (-4.0, 1.5), "1", "logarithm of the second slope over the first", SOURCE, "a_1")
    limit_bend_2 = Parameter(0.0, (-4.0, 1.5), "1", "logarithm of the third slope over the first", SOURCE, "a_2")

    places, kind = ("converter share",), "limit"
    family, differs, nests_textbook = "voltage_dependent_power_limit", "but not by the catalogue's law", True
    as_textbook = {
        "curve_limited": "limited_share", "curve_full": "full_level", "curve_off": "off_level",
        "curve_delay": "limit_delay",
    }  # fmt: skip
    grid = {"curve_full": (0.8, 0.9, 0.97), "curve_off": (0.4, 0.55, 0.7), "limit_bend_2": (-1.5, 0.0)}
    likely = {"limit_bend_1": 1.5, "limit_bend_2": 1.5}
    relevant = {"curve_limited": 0.1}
    confused_with = ("voltage_dependent_power_limit", "constant_power_converter")

    def edit(self, eq, curve_limited, curve_full, curve_off, curve_delay, limit_bend_1, limit_bend_2):
        allowed = lambda u: _allowed(u, curve_full, curve_off, (limit_bend_1, limit_bend_2))  # noqa: E731
        u = eq[sites.static_voltage]
        seen = seen_late(eq, u, curve_delay)
        power = eq.P_s0 * allowed(seen) / allowed(1) * u / seen
        eq.edit(sites.P_static, lambda P: (1 - curve_limited) * P + curve_limited * power)

    def curve(self, curve_limited, curve_full, curve_off, curve_delay, limit_bend_1, limit_bend_2):
        u = np.linspace(0.4, 1.0, 61)
        allowed = lambda x: _allowed(x, curve_full, curve_off, (limit_bend_1, limit_bend_2))  # noqa: E731
        return Curve(u, drawn(lambda x: allowed(x) / allowed(1), u), "voltage over that before", "power allowed")
