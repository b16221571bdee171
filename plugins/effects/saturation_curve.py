"""Saturation of the motor's main flux path by a curve of its own."""

import numpy as np

from tractexp.extend import Curve, Effect, Parameter, plugin, sites
from tractexp_plugins.effects._operators import bent, drawn

SOURCE = "Milano 2010, ch. 15; tables of saturation in Kundur 1994, ch. 3"
KNOTS, WIDTH = (0.15, 0.4), 0.08  # pu² of flux fallen


@plugin
class SaturationCurve(Effect):
    r"""The magnetizing reactance grows as the flux falls, as `magnetic_saturation` has it, but by a monotone curve.

        sigma = 1 - k (h(x) - h(0)),   x = |E_0|^2 - |E|^2

    h has slope 1 up to a fall of 0.15 pu², exp(b_1) to 0.4 and exp(b_2) beyond, its corners rounded over 0.08: a knee,
    where it flattens, or a curve that steepens. At b_1 = b_2 = 0 it is `magnetic_saturation`, at k = 0 the base model.

    Source: saturation factors by table, Kundur 1994, ch. 3; Milano 2010, ch. 15.
    Departures: those of `magnetic_saturation`; three slopes stand for the curve.
    """

    curve_saturation = Parameter(
        0.0, (0.0, 3.0), "1/pu²", "slope at the flux before the event", SOURCE, "k_c", null=0.0
    )
    saturation_bend_1 = Parameter(0.0, (-4.0, 1.5), "1", "logarithm of the next slope over it", SOURCE, "b_1")
    saturation_bend_2 = Parameter(0.0, (-4.0, 1.5), "1", "logarithm of the last slope over it", SOURCE, "b_2")

    places, kind = ("coupling", "flux decay"), "law"
    family, differs, nests_textbook = "magnetic_saturation", "but not by the catalogue's law", True
    as_textbook = {"curve_saturation": "saturation"}
    grid = {"saturation_bend_1": (-2.0, 0.0, 1.0), "saturation_bend_2": (-2.0, 0.0, 1.0)}
    likely = {"saturation_bend_1": 1.5, "saturation_bend_2": 1.5}
    relevant = {"curve_saturation": 0.2}
    confused_with = ("magnetic_saturation", "feeder_impedance", "speed_dependent_torque")

    def edit(self, eq, curve_saturation, saturation_bend_1, saturation_bend_2):
        from sympy import conjugate, re

        E = eq["E"]
        square = lambda x: re(x * conjugate(x))  # noqa: E731
        fall = eq.define("flux_fall", square(eq.before(E)) - square(E), r"\Delta E^2")
        unsaturated = 1 - (1 - eq["C"]) * curve_saturation * bent(
            fall, KNOTS, (saturation_bend_1, saturation_bend_2), WIDTH
        )
        for site in (sites.coupling, sites.time_constant):
            eq.edit(site, lambda x: x / unsaturated)

    def curve(self, curve_saturation, saturation_bend_1, saturation_bend_2):
        x = np.linspace(0.0, 0.7, 71)
        y = -curve_saturation * drawn(lambda x: bent(x, KNOTS, (saturation_bend_1, saturation_bend_2), WIDTH), x)
        return Curve(x, y, "fall of the flux squared, pu²", "change of the saturation factor")
