"""Stator resistance of the motor."""

from tractexp.extend import Effect, Parameter, plugin, sites

SOURCE = "Milano 2010, Power System Modelling and Scripting, ch. 15"


@plugin
class StatorResistance(Effect):
    """Copper loss and voltage drop in the motor's stator, which the base model neglects.

        I = (U - E)/(R_s + j X')

    At R_s = 0 the base model. The air-gap torque Re(E I*) is then less than the motor's power by
    R_s |I|^2.

    Source: Milano 2010, ch. 15 (third-order motor with r_S).
    Departures: none.
    """

    R_s = Parameter(
        0.0,
        (-0.02, 0.2),
        "pu",
        "stator resistance on the record's base",
        SOURCE,
        null=0.0,
        power_exponent=-1,
    )
    places, kind = ("stator impedance",), "law"
    rival = True
    relevant = {"R_s": 0.01}
    confused_with = ("feeder_impedance", "dc_link_lag", "time_skew")

    def edit(self, eq, R_s):
        eq.edit(sites.stator_impedance, lambda Z: R_s + Z)
