"""Load that changes by itself, from the dip on."""

from tractexp.extend import Effect, Parameter, plugin

from ._dip import changes

SOURCE = "ordinary change of load; customers and trains that react to a dip"


@plugin
class LoadChangeFromDip(Effect):
    """The load changes by itself once the dip begins: at once, in a ramp, or steadily to its end.

        P -> P + a_P r (P - w P_d),   Q -> Q + a_Q r (Q - w Q_d),
        r = min(1, max(0, (t_d - T_w)/T_c))

    t_d is the time since a voltage below 0.96 of that before. With T_c beyond the record it is a
    drift. At w = 0 all parts change, at w = 1
    all but the motors, whose power is P_d. At a_P = a_Q = 0 the base model.

    Source: a straight line is the first term of any slow change, a step of any sudden one.
    Departures: in waveforms all the current changes as P does; corners are rounded
    over 2 % of the change so that derivatives exist.
    """

    dip_change_P = Parameter(0.0, (-0.5, 0.5), "1", "relative change of P", SOURCE, "a_P", null=0.0)
    dip_change_Q = Parameter(0.0, (-0.5, 0.5), "1", "relative change of Q", SOURCE, "a_Q", null=0.0)
    dip_change_wait = Parameter(0.0, (0.0, 2.0), "s", "time before it begins", SOURCE, "T_w")
    dip_change_time = Parameter(5.0, (0.002, 5.0), "s", "time that it takes", SOURCE, "T_c")
    dip_change_static = Parameter(
        0.0,
        (0.0, 1.0),
        "1",
        "1 where only the static load changes",
        SOURCE,
        "w",
        natural_ends=(1.0,),
    )

    order = 3
    places, kind = ("bus",), "drift"
    family, differs = "load_change", "from the dip on"
    grid = {
        "dip_change_wait": (0.0, 0.4),
        "dip_change_time": (0.1, 5.0),
        "dip_change_static": (0.0, 1.0),
    }
    relevant = {"dip_change_P": 0.02, "dip_change_Q": 0.02}
    confused_with = ("load_change", "exponential_recovery", "undervoltage_trip")

    def edit(self, eq, **values):
        changes(eq, False, "from_dip", *values.values())
