"""A second cage on the motor's rotor."""

from tractexp.extend import Effect, Parameter, plugin, sites

from . import _orders

SOURCE = "Milano 2010, Power System Modelling and Scripting, ch. 15"


@plugin
class SecondCage(Effect):
    r"""A second rotor circuit, a cage above the first or the eddies of deep bars, carries current
    at high slip.

        X'' = (1 - s) X',   T_0'' = T''/(1 - s),   E'' = E + D,   I = (V - E'')/(R_s + j X'')
        dD/dt = (j s X' I - D)/T_0'' + j (omega - omega_s) D,     T_e = Re(E'' I*)

    At s = 0 nothing drives D and the motor is the base model; at any other s it is `double_cage`
    with that X'', to rounding: the two are nested as they stand. The second cage takes part in the
    torque before the event, too, so that the slip there is less than the base model's, and is
    solved for.

    Not to be confused with `second_motor_group`, which is two machines with a speed each.

    Source: Milano 2010, ch. 15 (double-cage, fifth order); ANDES Motor5.
    Departures: by the share s that X'' is less than X', which has a null, in place of X''.
    """

    cage_share = Parameter(
        0.0, (0.0, 0.8), "1", "share of X' that the second cage takes away", SOURCE, "s", null=0.0
    )
    cage_time = Parameter(
        0.01, (0.001, 0.05), "s", "subtransient time constant X''/X' T0''", SOURCE, "T''"
    )

    places, kind = ("stator impedance", "load torque"), "lag"
    rival = True
    order = -1
    phasors_only = (
        "of waveforms take model/motor=double_cage, which has two cages and a stator flux"
    )
    grid = {"cage_time": (0.003, 0.01, 0.03)}
    relevant = {"cage_share": 0.1}
    confused_with = ("magnetic_saturation", "stator_transients", "feeder_impedance")

    def refusal(self, eq):
        if "X_second" in eq:
            return "its rotor has a second cage already"
        if "psi" in eq:
            return (
                "its stator flux moves, of which this effect knows nothing; compare with"
                " model/motor=double_cage"
            )
        if sites.stator_impedance in eq and not _orders.list_moving_states(eq, _orders.FLUX):
            return "its first cage has no flux that moves; take model/motor=double_cage"
        return None

    def edit(self, eq, cage_share, cage_time):
        from sympy import I, conjugate, im, re

        current, Z, omega = eq[sites.stator_current], eq[sites.stator_impedance], eq["omega"]
        X, slip, open_time = (
            im(eq.expression(sites.stator_impedance)),
            omega - eq.omega_s,
            cage_time / (1 - cage_share),
        )
        D = eq.lag_vector("D", "D")
        eq.edit(sites.stator_impedance, lambda own: own - I * cage_share * X)
        eq.edit(sites.stator_current, lambda own: own - D / Z)
        eq.edit(sites.electrical_torque, lambda own: own + re(D * conjugate(current)))
        # from which the steady state is solved
        near = cage_share * (eq.V - eq["E"]) / (1 - I * slip * open_time)
        eq.moves(D, (I * cage_share * X * current - D) / open_time + I * slip * D, near)
        eq.states[D].derived = True
