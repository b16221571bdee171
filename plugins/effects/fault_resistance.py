"""Resistance of an arc or a fault inside the load."""

from tractexp.extend import Effect, Parameter, plugin

from ._phases import detect_departure

SOURCE = "Kundur 1994, section 13.4 (faults by shunts); IEC 60909-0"
# of the voltage: how far off it is in a fault; s: how long it may be nearer in between
LEVEL, HOLD = 0.1, 0.005


@plugin
class FaultResistance(Effect):
    """While the voltage is off its course, a conductance to earth lies beside the load: the fault
    is in it.

        i -> i + g_f f v,   i_0 -> i_0 + g_f f v_0,
        f = 1 while |v - U_0| > 0.1 U_0 within the last 5 ms, else 0

    At g_f = 0 the base model.

    Source: Kundur 1994, section 13.4: a fault as a shunt.
    Departures: the same in three phases; that it begins and ends is told from the voltage.
    """

    fault_conductance = Parameter(
        0.0, (0.0, 5.0), "pu", "on the record's base", SOURCE, "g_f", null=0.0, power_exponent=1
    )
    places, kind = ("bus",), "law"
    waves_only = "phasors do not tell when a fault begins and ends"
    relevant = {"fault_conductance": 0.05}
    confused_with = ("undervoltage_trip",)

    def edit(self, eq, fault_conductance):
        import sympy

        on = eq.memory("fault_on", "f")
        active = sympy.Max(0, on - eq.step / HOLD)
        eq.renews(on, sympy.Max(active, detect_departure(eq, LEVEL)), 0)
        drawn = fault_conductance * sympy.Min(1, on * HOLD / eq.step)
        eq.draw(drawn * eq.v, drawn * eq.v_zero)
