"""Negative-sequence voltage brakes the motor and loads it."""

from tractexp.extend import Effect, Parameter, plugin, sites

SOURCE = (
    "Kundur 1994, section 7.2; Boldea, Nasar 2010, The Induction Machine Handbook (unbalanced"
    " supply)"
)


@plugin
class NegativeSequenceBraking(Effect):
    """Negative-sequence voltage drives a current whose field turns backwards: a torque against, and
    power drawn.

    The rotor slips by nearly 2 against it, so Z_2 = Z_- + R_2/2, with R_2 = c X'/(omega_n tau') the
    rotor resistance behind the transient reactance:

        T_e -> T_e - k_2 dU2^2 R_2/2/|Z_2|^2,   P + j Q -> P + j Q + k_2 dU2^2 Z_2/|Z_2|^2,
        dU2^2 = U2^2 - U20^2

    At k_2 = 0 the base model; k_2 = 1 is the theory.

    Source: Kundur 1994, section 7.2 (equivalent circuit at slip 2 - s); Boldea, Nasar 2010
    (unbalanced supply).
    Departures: the unbalance before the event belongs to the steady state, so only its change
    counts.
    """

    negative_sequence = Parameter(
        0.0, (0.0, 10.0), "1", "size relative to the theory", SOURCE, "k_2", null=0.0
    )

    places, kind = ("load torque", "bus"), "law"
    reads = ("U2",)
    phasors_only = (
        "in waveforms the motor's equations carry negative sequence and its torque themselves"
    )
    relevant, theory = {"negative_sequence": 0.5}, {"negative_sequence": 1.0}
    confused_with = ("second_motor_group", "shunt_capacitor")

    def edit(self, eq, negative_sequence):
        from sympy import im, re

        Z = eq[sites.backward_impedance]
        R_2 = eq[sites.coupling] * im(Z) / (eq.omega_n * eq[sites.time_constant])
        R, X = re(Z) + R_2 / 2, im(Z)  # Z_2, in which R_2/s at slip 2
        current_squared = negative_sequence * (eq.U2**2 - eq.U20**2) / (R**2 + X**2)
        eq.edit(sites.electrical_torque, lambda T: T - current_squared * R_2 / 2)
        eq.consume(current_squared * R, current_squared * X)
