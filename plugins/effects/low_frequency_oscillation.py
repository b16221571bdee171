"""Low-frequency oscillation of converters and network."""

from tractexp.extend import Effect, Parameter, plugin

SOURCE = (
    "Hu et al. 2017, IEEE Trans. Power Electronics; Energies 2022, 15, 7544 (train-network"
    " oscillation)"
)


@plugin
class LowFrequencyOscillation(Effect):
    """A lightly damped mode of converters and network, excited by the change of the voltage.

        dx/dt = w y,   dy/dt = w p,   p = u (1 - x - 2 zeta y) - 1,   w = 2 pi f_o,   u = U/U_0
        P -> P + a_P z,   Q -> Q + a_Q z,   z = cos(phi) y + sin(phi) p

    p is the power, less 1, of a converter whose dc-link energy y sets the current 1 - x - 2 zeta y:
    in a dip it rings slower. y and p are the two ways such a mode can ring after a step and settle
    at zero. At a_P = a_Q = 0 the base model, whatever the mode.

    Source: Hu et al. 2017; measured modes of 0.6-10 Hz in Energies 2022, 15, 7544.
    Departures: one mode, with one phase for P and Q.
    """

    oscillation_P = Parameter(
        0.0,
        (-0.6, 0.6),
        "pu",
        "active power of the mode per U_0",
        SOURCE,
        "a_P",
        null=0.0,
        power_exponent=1,
    )
    oscillation_Q = Parameter(
        0.0,
        (-0.6, 0.6),
        "pu",
        "reactive power of the mode per U_0",
        SOURCE,
        "a_Q",
        null=0.0,
        power_exponent=1,
    )
    mode_frequency = Parameter(2.0, (0.5, 10.0), "Hz", "frequency of the mode", SOURCE, "f_o")
    mode_damping = Parameter(0.1, (0.005, 0.5), "1", "damping ratio of the mode", SOURCE, r"\zeta")
    mode_phase = Parameter(0.0, (0.0, 3.141593), "rad", "phase of the mode", SOURCE, r"\varphi")

    places, kind = ("bus",), "oscillation"
    grid = {"mode_frequency": (0.7, 1.0, 1.5, 2.2, 3.3, 5.0, 7.5), "mode_phase": (0.0, 1.570796)}
    relevant = {"oscillation_P": 0.05, "oscillation_Q": 0.05}
    confused_with = ("load_change", "second_motor_group")

    def edit(self, eq, oscillation_P, oscillation_Q, mode_frequency, mode_damping, mode_phase):
        import sympy

        x, y = eq.lag("mode_x", "x_o"), eq.lag("mode_y", "y_o")
        w = 2 * sympy.pi * mode_frequency
        power = eq.U / eq.U0 * (1 - x - 2 * mode_damping * y) - 1
        eq.moves(x, w * y, 0)
        eq.moves(y, w * power, 0)
        z = eq.define("oscillation", sympy.cos(mode_phase) * y + sympy.sin(mode_phase) * power, "z")
        eq.consume(oscillation_P * z, oscillation_Q * z)
