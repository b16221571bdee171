"""Static var compensator or STATCOM at the bus."""

from tractexp.extend import Effect, Parameter, plugin

SOURCE = "Kundur 1994, section 11.2; Milano 2010, ch. 19 (SVC and STATCOM)"


@plugin
class StaticVarCompensator(Effect):
    """A compensator that feeds reactive current into the bus when the voltage is low, up to its
    rating.

        T_c dx/dt = sat(K (U_0 - U) + x (1 - u^(n-1))) - x,   Q -> Q - q_c x u^n,   u = U/U_0,
        sat(z) = max(-1, min(1, z))

    What it regulates is x: current where n = 1 (STATCOM), susceptance where n = 2
    (thyristor-controlled). The droop acts on the current x u^(n-1), which is K (U_0 - U) at rest: a
    small drop dU brings K q_c dU, a deep one the rating q_c. The set point is the voltage before
    the event. At q_c = 0 the base model, whatever the rest.

    Source: Kundur 1994, section 11.2 (slope reactance); Milano 2010, ch. 19: regulator, one lag,
    limits. Departures: the limit is symmetric; the thyristors' own delay is not modelled.
    """

    compensator = Parameter(
        0.0,
        (0.0, 1.0),
        "pu",
        "rating on the record's base",
        SOURCE,
        "q_c",
        null=0.0,
        power_exponent=1,
    )
    compensator_gain = Parameter(
        10.0, (1.0, 100.0), "1/pu", "gain per rating, 1/droop", SOURCE, "K"
    )
    compensator_time = Parameter(0.03, (0.005, 0.3), "s", "time constant", SOURCE, "T_c")

    compensator_exponent = Parameter(
        1.0,
        (1.0, 2.0),
        "1",
        "of voltage: 1 current, 2 susceptance",
        SOURCE,
        "n",
        natural_ends=(1.0, 2.0),
    )

    places, kind = ("bus",), "limit"
    grid = {"compensator_gain": (2.0, 10.0, 50.0), "compensator_time": (0.01, 0.03, 0.1)}
    relevant = {"compensator": 0.05}
    confused_with = ("shunt_capacitor", "time_skew")

    def edit(self, eq, compensator, compensator_gain, compensator_time, compensator_exponent):
        import sympy

        x = eq.lag("compensation", "x_c")
        u = eq.U / eq.U0
        order = compensator_gain * (eq.U0 - eq.U) + x * (1 - u ** (compensator_exponent - 1))
        eq.moves(x, (sympy.Max(-1, sympy.Min(1, order)) - x) / compensator_time, 0)
        eq.consume(0, -compensator * x * u**compensator_exponent)
