"""Saturation of the motor's main flux path by a curve of its own."""

import numpy as np

from tractexp.extend import Curve, Effect, Parameter, plugin, sites

from ._operators import bent, evaluate_law

SOURCE = "Milano 2010, ch. 15; tables of saturation in Kundur 1994, ch. 3"


@plugin
class SaturationCurve(Effect):
    r"""The magnetizing reactance grows as the flux falls, as in `magnetic_saturation`, by a
    monotone curve.

        sigma = 1 - k h(x),   x = |psi_u,0|^2 - |psi_u|^2,   psi_u = (1 - a) U + a E
        g = 1 + (1 - a) (sigma - 1) X'/X_m,   kappa = C (sigma - 1)/g X'/X_m,
        X'/X_m = (1 - C)/(1 - a (1 - C))
        I = (g U - E)/(j X' (1 + a (g - 1))),   T_e = Re(E I*)/g
        C -> (C - (1 - a) kappa)/(1 + a kappa),   T' -> T'/(1 + a kappa)

    The magnetizing branch X_m/sigma between a stator leakage a X' and the rotor's, without
    approximation: with the flux psi = psi_u/(1 + a (g - 1)) of the core, psi_u if nothing
    saturated. h has slope 1 up to a fall of c and exp(b) beyond, its corner rounded over w: a knee,
    where it flattens, or a curve that steepens; well rounded it follows a bounded flux (Froelich's
    curve at 0.7 of its bound to 0.001). At a = 1 and b = 0 it is `magnetic_saturation` of phasors,
    at k = 0 the base model.

    Source: saturation factors by table, Kundur 1994, ch. 3; Milano 2010, ch. 15.
    Departures: the factor is told by the flux that an unsaturated core would have, counted from its
    value before the event; two slopes stand for the curve; behind a feeder the core still sees the
    bus, and beside a stator resistance what it drops is not in the flux.
    """

    curve_saturation = Parameter(
        0.0, (0.0, 3.0), "1/pu²", "slope at the flux before the event", SOURCE, "k_c", null=0.0
    )
    saturation_bend = Parameter(
        0.0, (-4.0, 1.5), "1", "logarithm of the slope beyond the corner over it", SOURCE, "b"
    )
    saturation_corner = Parameter(
        0.2, (0.02, 0.7), "pu²", "fall of the flux squared at the corner", SOURCE, "c"
    )
    saturation_rounding = Parameter(
        0.03, (0.01, 0.6), "pu²", "how rounded the corner is", SOURCE, "w"
    )
    flux_depth = Parameter(
        1.0, (0.0, 1.0), "1", "where between terminals and E the core is", SOURCE, "a_s"
    )

    places, kind = ("coupling", "flux decay", "stator impedance", "load torque"), "law"
    family, differs, nests_textbook = "magnetic_saturation", "but not by the catalogue's law", True
    as_textbook = {"curve_saturation": "saturation"}
    grid = {
        "saturation_bend": (-2.0, 0.0),
        "saturation_corner": (0.1, 0.2, 0.4),
        "saturation_rounding": (0.03, 0.3),
        "flux_depth": (1.0, 0.6),
    }
    likely = {"saturation_bend": 1.5, "flux_depth": 1.0}
    relevant = {"curve_saturation": 0.2}
    confused_with = ("magnetic_saturation", "feeder_impedance", "speed_dependent_torque")

    def edit(
        self,
        eq,
        curve_saturation,
        saturation_bend,
        saturation_corner,
        saturation_rounding,
        flux_depth,
    ):
        from sympy import conjugate, re

        unsaturated = (1 - flux_depth) * eq.v + flux_depth * eq["E"]
        squared = eq.define("flux_squared", re(unsaturated * conjugate(unsaturated)), r"|\psi_u|^2")
        fall = eq.define("flux_fall", eq.evaluate_before(squared) - squared, r"\Delta\psi_u^2")
        h = bent(fall, (saturation_corner,), (saturation_bend,), saturation_rounding)
        share = (1 - eq["C"]) / (1 - flux_depth * (1 - eq["C"]))  # X'/X_m
        less = eq.define("saturation_fall", curve_saturation * h * share, r"(1 - \sigma) X'/X_m")
        g = eq.define("gap_factor", 1 - (1 - flux_depth) * less, "g")
        kappa = -eq["C"] * less / g
        psi = unsaturated / (1 + flux_depth * (g - 1))
        eq.edit(sites.coupling, lambda C: (C - (1 - flux_depth) * kappa) / (1 + flux_depth * kappa))
        eq.edit(sites.time_constant, lambda T: T / (1 + flux_depth * kappa))
        eq.edit(
            sites.stator_current,
            lambda current: current + (g - 1) * psi / eq[sites.stator_impedance],
        )
        eq.edit(sites.electrical_torque, lambda torque: torque / g)

    def curve(
        self, curve_saturation, saturation_bend, saturation_corner, saturation_rounding, flux_depth
    ):
        x = np.linspace(0.0, 0.7, 71)
        h = evaluate_law(
            lambda x: bent(x, (saturation_corner,), (saturation_bend,), saturation_rounding), x
        )
        return Curve(
            x,
            -curve_saturation * h,
            "fall of the flux squared, pu²",
            "change of the saturation factor",
        )
