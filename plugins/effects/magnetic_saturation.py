"""Saturation of the motor's main flux path."""

from tractexp.extend import Effect, Parameter, plugin, sites

SOURCE = "Milano 2010, ch. 15; PSS/E COMPLOAD and CIM5 (E1, S(E1), E2, S(E2))"


@plugin
class MagneticSaturation(Effect):
    r"""The magnetizing reactance grows as the flux falls below what it was before the event.

        X - X' -> (X - X')/sigma,   T0' -> T0'/sigma,   sigma = 1 + k_s (|E|^2 - |E_0|^2)

    In waveforms E + j X'/2 I, the voltage of the air gap with equal leakages, stands for E: in a
    dip's first cycles stator and rotor flux are apart, and the main flux is between them.

    In the parameters of the model, C = (X - X')/X and T' = X'/X T0', both are divided by n = 1 + (1
    - C)(sigma - 1). At k_s = 0 the base model.

    Source: saturation as a factor on the magnetizing reactance, Milano 2010, ch. 15; CIM5 load
    model.
    Departures: quadratic in the internal voltage, and counted from its value before the event, so
    that C and T' are the machine's at that point.
    """

    saturation = Parameter(
        0.0, (0.0, 3.0), "1/pu²", "growth of sigma with flux squared", SOURCE, "k_s", null=0.0
    )

    places, kind = ("coupling", "flux decay"), "law"
    relevant = {"saturation": 0.2}
    confused_with = ("feeder_impedance", "speed_dependent_torque")

    def edit(self, eq, saturation):
        from sympy import I, conjugate, re

        E = eq["E"]
        if eq.waves and sites.stator_current in eq:
            E = eq.define("air_gap", E + I * eq["X_prime"] / 2 * eq[sites.stator_current], "E_m")
        square = lambda x: re(x * conjugate(x))  # noqa: E731
        rise = eq.define("flux_rise", square(E) - square(eq.evaluate_before(E)), r"\Delta E^2")
        unsaturated = 1 + (1 - eq["C"]) * saturation * rise
        for site in (sites.coupling, sites.time_constant):
            eq.edit(site, lambda x: x / unsaturated)
