"""A pole of the load's breaker that opens, or does not close."""

from tractexp.extend import Effect, Parameter, plugin, sites

from ._operators import gate
from ._phases import detect_departure, phases_of, vector_of

SOURCE = (
    "IEEE C37.04, pole discrepancy; Blackburn, Domin 2014, Protective Relaying, section 4.9 (open"
    " phases)"
)
LEVEL = 0.1  # of the voltage: how far off it is when the event begins


@plugin
class StuckPole(Effect):
    """From a time after the event's beginning, one phase of the load carries no current, or less.

        i_k -> (1 - s w_k g) i_k,
        g = 1 from T_p after the voltage first left its course by 0.1 U_0

    with w_k = 1 for the phase that is meant and 0 for the others. At s = 0 the base model, whatever
    phase and time.

    Source: IEEE C37.04 (pole discrepancy); Blackburn, Domin 2014, section 4.9.
    Departures: the other phases carry on as if that one did; a pole that opens does so at once, not
    at a zero of its current.
    """

    opened_share = Parameter(
        0.0, (0.0, 1.0), "1", "share of the phase's current that is gone", SOURCE, "s_p", null=0.0
    )
    opened_phase = Parameter(0.0, (0.0, 2.0), "1", "0, 1 or 2: phase a, b or c", SOURCE, "k_p")
    opened_after = Parameter(
        0.06, (0.0, 0.5), "s", "time after the voltage left its course", SOURCE, "T_p"
    )

    places, kind = ("bus",), "trip"
    order = 3
    waves_only = "phasors of the positive sequence do not show a phase"
    grid = {"opened_phase": (0.0, 1.0, 2.0), "opened_after": (0.02, 0.06, 0.15)}
    relevant = {"opened_share": 0.05}
    confused_with = ("undervoltage_trip",)

    def edit(self, eq, opened_share, opened_phase, opened_after):
        import sympy

        since = eq.memory("since_event", "t_e")
        begun = sympy.Max(detect_departure(eq, LEVEL), sympy.Min(1, since / eq.step))
        eq.renews(since, since + begun * eq.step, 0)
        gone = opened_share * gate(since - opened_after - eq.step, 0.3 * eq.step)
        i = phases_of(eq, eq.expression(sites.current), eq.expression(sites.zero_current))
        off = [gone * sympy.Max(0, 1 - sympy.Abs(opened_phase - k)) * x for k, x in enumerate(i)]
        vector, zero = vector_of(eq, off)
        eq.edit(sites.current, lambda i: i - vector)
        eq.edit(sites.zero_current, lambda i: i - zero)
