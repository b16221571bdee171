"""A second group of motors with another inertia."""

from tractexp.extend import Effect, Parameter, plugin, sites

SOURCE = "WECC composite load model: motors A, B, C side by side"


@plugin
class SecondMotorGroup(Effect):
    """Part of the motors has another inertia, so that it slows down and recovers at another pace.

    A share g of the motor load is a second machine with the same electrical parameters and load per
    unit, and inertia r M; every quantity that moves with a motor has a twin marked 2:

        P_d = (1 - g) P_d1 + g P_d2,        r M domega_2/dt = T_e2 - T_L2

    At g = 0 the base model, whatever r.

    Source: WECC composite load model specification (motor groups); Milano 2010, ch. 15 for each
    machine.
    Departures: both groups share the electrical parameters.
    """

    group_share = Parameter(
        0.0, (0.0, 0.6), "1", "share of the second group in the motor load", SOURCE, "g", null=0.0
    )
    inertia_ratio = Parameter(
        4.0, (0.1, 12.0), "1", "inertia of the second group over the first's", SOURCE, "r"
    )

    places, kind = ("motor",), "lag"
    order = 1
    grid = {"inertia_ratio": (0.25, 0.5, 2.0, 4.0, 8.0)}
    relevant = {"group_share": 0.1}
    confused_with = ("speed_dependent_torque", "undervoltage_trip", "exponential_recovery")

    def edit(self, eq, group_share, inertia_ratio):
        omega, moving = eq.omega, _list_needed_states(eq)
        # {symbol: that of the second machine}: states, their values before the event, quantities
        twins = {s: eq.twin(s, "_2") for s in moving}
        twins |= {eq.evaluate_before(s): eq.evaluate_before(twin) for s, twin in twins.items()}
        touched = [s for s in eq.definitions if eq.expand(s).free_symbols & twins.keys()]
        for symbol in touched:
            twin = eq.definitions[symbol].xreplace(twins)
            twins[symbol] = eq.define(f"{symbol.name}_2", twin, rf"{{{eq.latex_names[symbol]}}}_2")
        # the second machine obeys the same equations, its speed with another inertia
        for symbol in moving:
            state, slower = eq.states[symbol], inertia_ratio if symbol == omega else 1
            eq.moves(twins[symbol], state.derivative.xreplace(twins) / slower, state.initial)
            eq.states[twins[symbol]].derived = state.derived
        for site in _list_drawn_sites(eq):
            second = twins[eq[site]]
            eq.edit(site, lambda own, second=second: (1 - group_share) * own + group_share * second)


def _list_drawn_sites(eq):
    """The sites of what the motor draws: its power, of waveforms its current."""
    return (sites.motor_current,) if eq.waves else (sites.P_motor, sites.Q_motor)


def _list_needed_states(eq):
    """The states the motor's power depends on, and those that these depend on in turn."""
    states, read = set(), {eq[site] for site in _list_drawn_sites(eq)}
    while read:
        new = set().union(*(eq.expand(e).free_symbols for e in read)) & eq.states.keys() - states
        states |= new
        read = {eq.states[s].derivative for s in new}
    return [s for s in eq.states if s in states]
