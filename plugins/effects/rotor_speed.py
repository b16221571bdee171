"""The swing of the rotor, of a motor whose speed stays."""

from tractexp.extend import Effect, Parameter, plugin, sites

from . import _orders

SOURCE = "Wu, Fan, Zou 2022, Energies 15(14) 5034, Table 1 and Eq. (1)"


@plugin
class RotorSpeed(Effect):
    r"""The rotor slows down in the dip and comes back, where the base model keeps the speed it had
    before the event.

        domega/dt = w (T_e - T_L),     w = 1/M

    At w = 0, infinite inertia, the base model, `voltage`; at w = 1/M the third-order motor
    `electromechanical` of that M, to rounding: the two are nested as they stand. The steady state
    is the same for every w.

    Not to be confused with `speed_dependent_torque`, which needs a speed that moves.

    Source: Wu, Fan, Zou 2022, Table 1 (electromechanical against voltage transient model), Eq. (1).
    Departures: written with the inverse of the inertia, which has a null.
    """

    swing = Parameter(
        0.0,
        (0.0, 2000.0),
        "rad/(s² pu)",
        "inverse of the inertia M",
        SOURCE,
        "w",
        null=0.0,
        power_exponent=-1,
    )
    places, kind = ("speed",), "lag"
    order = -1
    relevant = {"swing": 10.0}
    confused_with = ("exponential_recovery", "second_motor_group", "load_change")

    def refusal(self, eq):
        return "its speed moves already" if _orders.list_moving_states(eq, _orders.SPEED) else None

    def edit(self, eq, swing):
        excess = eq[sites.electrical_torque] - eq[sites.load_torque]
        omega = eq["omega"]
        still = eq.states[omega]
        eq.moves(omega, swing * excess, still.initial, still.balance)
        eq.edits.setdefault(self.name, [])
