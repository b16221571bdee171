"""A source beside the load: generation or another feeder that supplies the bus."""

from tractexp.extend import Effect, Parameter, plugin

SOURCE = (
    "Kundur 1994, Power System Stability and Control, section 5.3: a voltage behind an impedance"
)


@plugin
class Infeed(Effect):
    r"""A source of constant voltage feeds the bus through a resistance and a reactance: local
    generation, or a neighbor's machines.

        dpsi_g/dt = omega_n (v - U_0) - (omega_n r_g + j (omega_n + omega_s)) psi_g
        i -> i + b_g psi_g

    What the source delivers before the event is part of P_0 and Q_0, and stays: only what the
    voltage's change adds to it is written. A dip makes it supply b_g (U_0 - U) of reactive power
    and, by r_g, active power, and a jump of the angle makes it exchange active power as nothing at
    rest does. At b_g = 0 the base model.

    Not to be confused with `static_var_compensator`, which supplies reactive power by a control,
    nor with an inductive branch, which answers alike and draws reactive power before.

    Source: Kundur 1994, section 5.3, classical model of a generator of large inertia.
    Departures: the source's angle and voltage stay; its own frequency is that before the event.
    """

    infeed_susceptance = Parameter(
        0.0,
        (0.0, 3.0),
        "pu",
        "of the source's reactance",
        SOURCE,
        "b_g",
        null=0.0,
        power_exponent=1,
    )
    infeed_resistance = Parameter(
        0.1, (0.02, 1.0), "1", "resistance of the source over its reactance", SOURCE, "r_g"
    )

    places, kind = ("bus",), "lag"
    waves_only = "in phasors the angle between the source and the bus is not known"
    grid = {"infeed_resistance": (0.05, 0.2, 0.6)}
    relevant = {"infeed_susceptance": 0.05}
    confused_with = ("static_var_compensator", "second_motor_group")

    def edit(self, eq, infeed_susceptance, infeed_resistance):
        from sympy import I

        psi = eq.lag_vector("infeed_flux", r"\psi_g")
        turning = eq.omega_n * infeed_resistance + I * (eq.omega_n + eq.omega_s)
        eq.moves(psi, eq.omega_n * (eq.recorded_voltage - eq.U0) - turning * psi, 0)
        eq.draw(infeed_susceptance * psi)
