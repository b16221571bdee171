"""Capacitor banks that relays switch in while the voltage is low."""

from tractexp.extend import Effect, Parameter, plugin

from ._relay import stages

SOURCE = "Kundur 1994, section 11.2 (mechanically and thyristor-switched capacitors)"
BANKS = 3


@plugin
class SwitchedBanks(Effect):
    """Three equal capacitor banks are switched in one after the other as the voltage falls, and out
    as it returns.

        Q -> Q - b n/3 u^2,   u = U/U_0

    n banks are in: each goes in once the voltage has stayed below a level of its own for T_b+, and
    out once it has stayed h above that for T_b-. The levels lie evenly between u_b1 and u_b3. At b
    = 0 the base model, whatever the levels and times.

    Source: Kundur 1994, section 11.2: capacitors switched by the voltage, in steps.
    Departures: levels count from the voltage before the event; thresholds are softened over 1 % of
    voltage and one sample so that derivatives exist; no current of the switching itself.
    """

    bank_rating = Parameter(
        0.0,
        (0.0, 1.0),
        "pu",
        "reactive power of all banks at U_0",
        SOURCE,
        "b_b",
        null=0.0,
        power_exponent=1,
    )
    bank_first = Parameter(
        0.9, (0.75, 0.98), "1", "voltage below which the first goes in, over U_0", SOURCE, "u_{b1}"
    )
    bank_last = Parameter(
        0.7, (0.3, 0.95), "1", "voltage below which the last goes in, over U_0", SOURCE, "u_{b3}"
    )
    bank_delay = Parameter(
        0.02, (0.0, 0.5), "s", "time below its level before a bank goes in", SOURCE, "T_{b+}"
    )
    bank_wait = Parameter(
        0.02, (0.0, 2.0), "s", "time above it before a bank goes out", SOURCE, "T_{b-}"
    )
    bank_margin = Parameter(
        0.02, (0.01, 0.3), "1", "above is this much above the level", SOURCE, "h_b"
    )

    order = 3
    places, kind = ("bus",), "limit"
    family, differs = "static_var_compensator", "in banks that relays switch"
    grid = {"bank_first": (0.85, 0.93), "bank_last": (0.5, 0.7, 0.82), "bank_delay": (0.02, 0.08)}
    relevant = {"bank_rating": 0.05}
    confused_with = ("static_var_compensator", "shunt_capacitor", "undervoltage_trip")

    def edit(self, eq, bank_rating, bank_first, bank_last, bank_delay, bank_wait, bank_margin):
        inside = stages(
            eq, bank_first, bank_last, bank_delay, (bank_wait,) * BANKS, bank_margin, 0, "bank"
        )
        eq.consume(0, -bank_rating * eq.define("banks_in", inside, "n_b") * (eq.U / eq.U0) ** 2)
