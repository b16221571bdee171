"""Third-order induction motor."""

from tractexp.model.parts import Motor
from tractexp.parameter import Parameter
from tractexp.plugin import plugin

PAPER = "Wu, Fan, Zou 2022, Energies 15(14) 5034"


@plugin
class Electromechanical(Motor):
    r"""Induction motor with rotor flux and speed dynamics, stator transients and stator resistance neglected.

    States: complex internal voltage E = E' exp(j delta) [pu], speed omega [rad/s, relative to synchronous].
    The terminal voltage U is the angle reference.

        dE/dt = (j X' C I - (1 - C) E)/T' + j (omega - omega_s) E,   I = (U - E)/(j X')
        M domega/dt = Re(E I*) - T_m
        P_d + j Q_d = U I*

    The first line is (C U - E)/T' + j (omega - omega_s) E and the torque is P_d = -U Im(E)/X': in polar form,
    E = E' exp(j delta), the printed Eqs. (1)-(2), with products instead of trigonometric functions. They are
    written with the stator current so that an effect can edit its impedance. Steady state, Eq. (3):
    sin(2 delta_0) = -2 T_m X'/(C U_0^2), E'_0 = C U_0 cos(delta_0), omega_0 = omega_s + tan(delta_0)/T', on the
    stable branch |delta_0| < 45 degrees.

    Not to be confused with the fifth-order motors, which add stator flux or a second rotor cage.

    Source: Wu, Fan, Zou 2022, Eqs. (1)-(3).
    Departures: omega_s follows the recorded frequency where there is one; omega is measured from nominal
    synchronous speed, which leaves Eq. (1) unchanged.
    """

    T_prime = Parameter(0.1, (0.005, 0.5), "s", "transient time constant X'/X T0'", f"{PAPER}, Eq. (1)", "T'")
    X_prime = Parameter(0.3, (0.05, 1.5), "pu", "transient reactance on the record's base", f"{PAPER}, Eq. (2)", "X'")
    C = Parameter(0.9, (0.3, 0.99), "1", "(X - X')/X", f"{PAPER}, Eq. (1)")
    M = Parameter(0.005, (0.0005, 0.03), "pu s²/rad", "inertia, H = M omega_s/2", f"{PAPER}, Eq. (1)")
    T_m = Parameter(0.5, (0.05, 1.0), "pu", "load torque, the motor's power before the event", f"{PAPER}, Eq. (1)")

    def declare(self, eq):
        from tractexp.model.equations import I, conjugate, im, re, sympy

        T_prime, X_prime, C, M, T_m = eq.declare(self.parameters)
        U0 = eq.U0
        E, omega = eq.phasor("E", "E"), eq.state("omega", r"\omega")
        V = eq.define("motor_voltage", eq.U, "V")
        Z = eq.define("stator_impedance", I * X_prime, "Z'")
        current = eq.define("stator_current", (V - E) / Z, "I")
        coupling = eq.define("coupling", C, "c")
        time_constant = eq.define("time_constant", T_prime, r"\tau'")
        electrical_torque = eq.define("electrical_torque", re(E * conjugate(current)), "T_e")
        load_torque = eq.define("load_torque", T_m, "T_L")
        P = eq.define("P_motor", re(V * conjugate(current)), "P_d")  # Eq. (2)
        Q = eq.define("Q_motor", im(V * conjugate(current)), "Q_d")
        eq.consume(P, Q)

        sine = 2 * T_m * X_prime / (C * U0**2)  # -sin(2 delta_0), Eq. (3)
        cosine = sympy.sqrt(sympy.Max(0, 1 - sine**2))
        E_0 = C * U0 / 2 * (1 + cosine - I * sine)  # C U0 cos(delta_0) exp(j delta_0)
        tan_0 = -sine / (1 + cosine)
        flux = (I * X_prime * coupling * current - (1 - coupling) * E) / time_constant
        eq.moves(E, flux + I * (omega - eq.omega_s) * E, E_0)  # Eq. (1)
        eq.moves(omega, (electrical_torque - load_torque) / M, eq.omega_s0 + tan_0 / T_prime)

        eq.require(
            1 - sympy.Abs(sine),
            "no steady state exists before the event: Eq. (3) needs |2 T_m X'/(C U0²)| at most 1 and it is {value:.3g};"
            " lower T_m or X', or raise C",
            sympy.Abs(sine),
        )
        for symbol in (T_prime, X_prime, M):
            eq.require(symbol, f"{symbol.name} must be positive and is {{value:g}}", symbol)
        eq.require(C * (1 - C), "C = (X - X')/X must lie between 0 and 1 and is {value:g}", C)
