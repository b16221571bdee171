"""Fifth-order induction motor: single cage with stator transients."""

from tractexp.extend import Motor, plugin, sites

from . import _machine


@plugin
class StatorFlux(Motor):
    r"""Induction motor whose stator flux has dynamics of its own, in the frame that turns with the
    voltage.

    States: stator flux linkage psi [pu], internal voltage E [pu], both complex, and speed omega
    [rad/s].

        dpsi/dt = omega_n (U - R_s I) - j (omega_n + omega_s) psi,   I = (psi + j E)/X'
        dE/dt = (j X' C I - (1 - C) E)/T' + j (omega - omega_s) E
        M domega/dt = Re(E I*) - T_m,      P_d + j Q_d = U I*

    With dpsi/dt = 0, R_s = 0 and nominal frequency the first line is U = E + j X' I and the model
    is `electromechanical`. With dpsi/dt it holds the decaying offset of the flux that a dip leaves,
    seen from the turning frame as an oscillation of P and Q at the supply frequency; R_s damps it,
    and is therefore a parameter of the model and not an effect. Steady state in closed form: the
    slip at which the equivalent circuit develops T_m, a quadratic.

    Not to be confused with `double_cage`, the "fifth order" of Milano 2010 and of ANDES Motor5,
    which has a second rotor circuit and no stator transients. A phasor record is a moving average
    over a period and hides most of what this model adds.

    Source: Krause, Wasynczuk, Sudhoff 2002, Analysis of Electric Machinery, ch. 4 (per-unit flux
    linkages); Wu, Fan, Zou 2022, Eqs. (1)-(2) for the rotor.
    Departures: the rotor flux is written as the voltage behind X', E = j X_m/(X_m + X_r) psi_r.
    """

    T_prime, X_prime, C, M, T_m = (
        _machine.T_PRIME,
        _machine.X_PRIME,
        _machine.C,
        _machine.M,
        _machine.T_M,
    )
    R_s = _machine.R_S
    within_a_cycle = True

    def usual(self, T_prime, X_prime, C, M, T_m, R_s):
        return [*_machine.usual(T_prime, X_prime, C, M, T_m), (R_s / X_prime, 0.12, 3.9)]

    def declare(self, eq, T_prime, X_prime, C, M, T_m, R_s):
        from sympy import I

        psi, E, omega = eq.flux("psi", r"\psi"), eq.flux("E", "E"), eq.speed(r"\omega")
        V = eq.V
        eq.place(sites.backward_impedance, R_s + I * X_prime)
        current = eq.place(sites.stator_current, (psi + I * E) / X_prime)
        flux, excess = _machine.rotor(eq, E, E, omega, current, T_prime, X_prime, C, T_m)
        E_0, I_0, y = self._at_rest(eq, X_prime, C, R_s, T_m)
        eq.moves(
            psi,
            eq.omega_n * (V - R_s * current) - I * (eq.omega_n + eq.omega_s) * psi,
            X_prime * I_0 - I * E_0,
        )
        eq.moves(E, flux, E_0)
        eq.moves(omega, excess / M, eq.omega_s0 - y / T_prime)
        _machine.require_physical(eq, (T_prime, X_prime, M), C)
        return current

    @staticmethod
    def _at_rest(eq, X_prime, C, R, T_m):
        """Internal voltage, current and slip times T' before the event.

        The slip is the smaller root y of T |(R + jX)(1 - C + jy) + jXC|^2 = U_0^2 X C y, with X and
        T those of the frame's speed.
        """
        import sympy
        from sympy import I

        speed = 1 + eq.omega_s0 / eq.omega_n
        X, T = X_prime * speed, T_m * speed
        half = X * C * (eq.U0**2 / 2 - T * R)
        square, rest = R**2 + X**2, X**2 + R**2 * (1 - C) ** 2
        root = sympy.sqrt(sympy.Max(0, half**2 - T**2 * square * rest))
        y = eq.define("slip_before", T * rest / (half + root), "y_0")
        # a + jb: what carries the current, over 1 - C + jy
        a = eq.define("a_before", R * (1 - C) - X * y, "a_0")
        b = eq.define("b_before", R * y + X, "b_0")
        E_0 = I * X * C * eq.U0 * (a - I * b) / (a**2 + b**2)
        I_0 = eq.U0 * (1 - C + I * y) * (a - I * b) / (a**2 + b**2)
        loading = T * (sympy.sqrt(square * rest) + X * C * R) / (eq.U0**2 * X * C / 2)
        eq.require(
            1 - loading,
            "no steady state exists before the event: the load torque T_m is {value:.3g} times the"
            " breakdown torque; lower T_m, R_s or X', or raise C",
            loading,
        )
        return E_0 / speed, I_0, y
