"""A second group of motors with another inertia."""

from tractexp.model.parts import Effect
from tractexp.parameter import Parameter
from tractexp.plugin import plugin

SOURCE = "WECC composite load model: motors A, B, C side by side"


@plugin
class SecondMotorGroup(Effect):
    """Part of the motors has another inertia, so that it slows down and recovers at another pace.

    A share g of the motor load is a second machine with the same electrical parameters and load per unit, and
    inertia r M:

        P_d = (1 - g) P_1 + g P_2,        r M domega_2/dt = T_e2 - T_L

    At g = 0 the base model, whatever r.

    Source: WECC composite load model specification (motor groups); Milano 2010, ch. 15 for each machine.
    Departures: both groups share the electrical parameters.
    """

    group_share = Parameter(0.0, (0.0, 0.6), "1", "share of the second group in the motor load", SOURCE, "g", null=0.0)
    inertia_ratio = Parameter(4.0, (0.1, 12.0), "1", "inertia of the second group over the first's", SOURCE, "r")

    order = 1
    relevant = {"group_share": 0.1}
    confused_with = ("speed_dependent_torque", "undervoltage_trip", "exponential_recovery")

    def refusal(self, eq):
        whole = all(map(eq.has, ("E", "omega", "M", "stator_current", "electrical_torque")))
        return None if whole else "it has no speed and internal voltage to give a second group"

    def edit(self, eq):
        share, ratio = eq.declare(self.parameters)
        first = {eq.symbol(name): eq.states[eq.symbol(name)] for name in ("E", "omega")}
        second = {eq.symbol("E"): eq.phasor("E_2", "E_2"), eq.symbol("omega"): eq.state("omega_2", r"\omega_2")}
        twin = lambda e: eq.expand(e).xreplace(second)  # noqa: E731
        for symbol, state in first.items():
            slower = ratio if symbol.name == "omega" else 1
            eq.moves(second[symbol], twin(state.derivative) / slower, state.initial)
        for name in ("P_motor", "Q_motor"):
            own = eq.definitions[eq.symbol(name)]
            eq.edit(name, lambda P, own=own: (1 - share) * P + share * twin(own))
