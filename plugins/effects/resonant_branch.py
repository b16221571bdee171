"""Resonant branch beside the load: a filter, or a cable or capacitor bank behind a reactance."""

from tractexp.extend import Effect, Parameter, plugin

SOURCE = "Arrillaga, Watson 2003, Power System Harmonics: single-tuned filters"


@plugin
class ResonantBranch(Effect):
    r"""Resistance, reactance and capacitor in series from bus to neutral, which ring after each
    edge of the voltage.

        L di/dt = v - R i - v_c,
        C dv_c/dt = i            in the stationary frame, each of space vectors

    Declared by what is seen of it: the susceptance b_r at nominal frequency (resistance apart), the
    frequency f_r at which it resonates, n = f_r/f_n times nominal, and the time T_r in which its
    ringing dies. With i = b_r y and the frame's speed sigma = 1 + omega_s/omega_n,

        dy/dt   = omega_n (n^2 - 1) (v - v_c) - (2/T_r + j omega_n sigma) y
        dv_c/dt = omega_n n^2/(n^2 - 1) y - j omega_n sigma v_c,         1/b_r = X_L (n^2 - 1),
        X_L/R = omega_n T_r/2

    A harmonic filter, a capacitor bank behind its damping reactor, and a cable behind a
    transformer's leakage are such branches. Before the event it is capacitive: the static load
    draws b_r U_0^2 more. At b_r = 0 the base model, whatever f_r and T_r.

    Not to be confused with `shunt_capacitor`, which has no reactance before it: it draws a peak at
    each edge of the voltage and rings with nothing.

    Source: Arrillaga, Watson 2003; Kundur 1994, section 11.2.2 (shunt capacitors).
    Departures: none.
    """

    resonant_susceptance = Parameter(
        0.0,
        (0.0, 2.0),
        "pu",
        "susceptance at nominal frequency",
        SOURCE,
        "b_r",
        null=0.0,
        power_exponent=1,
    )
    resonance_frequency = Parameter(
        190.0, (75.0, 800.0), "Hz", "frequency at which it resonates", SOURCE, "f_r"
    )
    ringing_time = Parameter(
        0.02, (0.001, 0.2), "s", "time in which its ringing dies, 2 L/R", SOURCE, "T_r"
    )

    places, kind = ("bus",), "oscillation"
    waves_only = "in phasors it is a shunt_capacitor"
    grid = {
        "resonance_frequency": (110.0, 160.0, 230.0, 330.0, 480.0),
        "ringing_time": (0.004, 0.02),
    }
    relevant = {"resonant_susceptance": 0.05}
    confused_with = ("shunt_capacitor",)

    def edit(self, eq, resonant_susceptance, resonance_frequency, ringing_time):
        import sympy
        from sympy import I

        square = (2 * sympy.pi * resonance_frequency / eq.omega_n) ** 2
        turning = I * (eq.omega_n + eq.omega_s)
        leak = 2 / ringing_time + turning
        y, v_c = eq.lag_vector("resonant_current", "y_r"), eq.lag_vector("resonant_voltage", "v_c")
        gain, charging = eq.omega_n * (square - 1), eq.omega_n * square / (square - 1)
        before = eq.v / (leak / gain + charging / turning)
        eq.moves(y, gain * (eq.v - v_c) - leak * y, before)
        eq.moves(v_c, charging * y - turning * v_c, charging / turning * before)
        for state in (y, v_c):
            eq.states[state].derived = True
        eq.draw(resonant_susceptance * y)
