"""Load torque that depends on speed by a curve of its own."""

import numpy as np

from tractexp.extend import Curve, Effect, Parameter, plugin, sites

from ._operators import bent, evaluate_law

SOURCE = "Milano 2010, ch. 15; WECC composite load model (Etrq)"
KNOTS = (0.08, 0.2)  # of 1 - (omega/omega_0)^2: at 96 and 89 % of the speed before
TORQUE_CORNER = 0.04  # of the same: how rounded the corners there are


@plugin
class TorqueCurve(Effect):
    """Part of the torque falls with speed, as `speed_dependent_torque` has it, but by a monotone
    curve.

        T_L = T_m (1 - k h(x)),   x = 1 - ((omega + omega_n)/(omega_0 + omega_n))^2

    h has slope 1 up to 0.08, exp(c_1) to 0.2 and exp(c_2) beyond, its corners rounded over 0.04. At
    c_1 = c_2 = 0 it is `speed_dependent_torque`, at k = 0 the base model.

    Source: load torques of any exponent, Milano 2010, ch. 15; WECC composite load model (Etrq).
    Departures: three slopes stand for the curve.
    """

    curve_share = Parameter(
        0.0, (0.0, 2.0), "1", "slope at the speed before the event", SOURCE, "k_t", null=0.0
    )
    torque_bend_1 = Parameter(
        0.0, (-4.0, 1.5), "1", "logarithm of the next slope over it", SOURCE, "c_1"
    )
    torque_bend_2 = Parameter(
        0.0, (-4.0, 1.5), "1", "logarithm of the last slope over it", SOURCE, "c_2"
    )

    places, kind = ("load torque",), "law"
    family, differs, nests_textbook = (
        "speed_dependent_torque",
        "but not by the catalogue's law",
        True,
    )
    as_textbook = {"curve_share": "quadratic_share"}
    grid = {"torque_bend_1": (-2.0, 0.0, 1.0), "torque_bend_2": (-2.0, 0.0, 1.0)}
    likely = {"torque_bend_1": 1.5, "torque_bend_2": 1.5}
    relevant = {"curve_share": 0.25}
    confused_with = ("speed_dependent_torque", "feeder_impedance", "magnetic_saturation")

    def edit(self, eq, curve_share, torque_bend_1, torque_bend_2):
        speed = (eq.omega + eq.omega_n) / (eq.evaluate_before(eq.omega) + eq.omega_n)
        slower = eq.define("speed_fall", 1 - speed**2, r"\Delta\omega^2")
        law = 1 - curve_share * bent(slower, KNOTS, (torque_bend_1, torque_bend_2), TORQUE_CORNER)
        eq.edit(sites.load_torque, lambda T: T * law)

    def curve(self, curve_share, torque_bend_1, torque_bend_2):
        speed = np.linspace(0.75, 1.0, 51)
        y = 1 - curve_share * evaluate_law(
            lambda x: bent(x, KNOTS, (torque_bend_1, torque_bend_2), TORQUE_CORNER), 1 - speed**2
        )
        return Curve(speed, y, "speed over that before", "load torque over that before")
