"""Part of the load that answers the voltage's size and its angle differently."""

from tractexp.extend import Effect, Parameter, plugin

SOURCE = (
    "Harnefors 2007, IEEE Trans. Industrial Electronics 54(4): complex transfer functions of"
    " unsymmetrical systems"
)


@plugin
class NegativeSequencePath(Effect):
    """A voltage that turns one way drives a current that turns the other: of converters and of
    salient machines.

        T_n dz/dt = conj(v - U_0) - z,   i -> i + (g_n + j b_n) z

    A motor and any branch of R, L and C answer to v alone. What acts on size and angle of the
    voltage apart, as a power that is held, a current in phase with the voltage or a rotor with
    poles, answers to conj(v - U_0) as well: a voltage of negative sequence then gives a current of
    positive sequence and of its harmonics. A power S that is held within T_n is g_n + j b_n =
    -conj(S)/U_0^2. At g_n = b_n = 0 the base model, whatever T_n.

    Source: Harnefors 2007, Eq. (10): a real two-by-two system is G v + H conj(v); H of a held power
    by its derivative.
    Departures: linear in the voltage, with one lag.
    """

    conjugate_conductance = Parameter(
        0.0,
        (-3.0, 3.0),
        "pu",
        "of conj(v), its real part",
        SOURCE,
        "g_n",
        null=0.0,
        power_exponent=1,
    )
    conjugate_susceptance = Parameter(
        0.0,
        (-3.0, 3.0),
        "pu",
        "of conj(v), its imaginary part",
        SOURCE,
        "b_n",
        null=0.0,
        power_exponent=1,
    )
    conjugate_lag = Parameter(0.002, (0.0003, 0.03), "s", "time in which it follows", SOURCE, "T_n")

    places, kind = ("bus",), "law"
    waves_only = "in phasors a law of U acts on the voltage's size already"
    grid = {"conjugate_lag": (0.0005, 0.002, 0.01)}
    relevant = {"conjugate_conductance": 0.05, "conjugate_susceptance": 0.05}
    confused_with = ("constant_power_converter",)

    def edit(self, eq, conjugate_conductance, conjugate_susceptance, conjugate_lag):
        from sympy import I, conjugate

        z = eq.lag_vector("conjugate_voltage", "z_n")
        eq.moves(z, (conjugate(eq.recorded_voltage - eq.U0) - z) / conjugate_lag, 0)
        eq.draw((conjugate_conductance + I * conjugate_susceptance) * z)
