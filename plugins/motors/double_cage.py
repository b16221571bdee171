"""Fifth-order induction motor: two rotor cages, no stator transients."""

from tractexp.extend import Motor, Parameter, plugin, sites

from . import _machine

SOURCE = "Milano 2010, Power System Modelling and Scripting, ch. 15"


@plugin
class DoubleCage(Motor):
    r"""Induction motor with a second rotor circuit (second cage or deep bars); stator transients
    neglected.

    States: voltages E behind X' and E'' behind X'' [pu], both complex, and speed omega [rad/s].
    With D = E'' - E, what the second cage adds,

        dE/dt = (j (X - X') I - E)/T_0' + j (omega - omega_s) E,     I = (U - E'')/(j X'')
        dD/dt = (j (X' - X'') I - D)/T_0'' + j (omega - omega_s) D
        M domega/dt = Re(E'' I*) - T_m,          P_d + j Q_d = U I*

    X = X'/(1 - C), T_0' = T'/(1 - C) as everywhere here, and T'' = X''/X' T_0'' in the same manner.
    D is the kernel's state: the textbook's line for dE''/dt is the sum of the two. At X'' = X' the
    second cage is open, D = 0, and the model is `electromechanical`. The steady state is a quartic
    in the slip and is solved by Newton's method from below: from slips that are raised until the
    torque, which grows less than in proportion, is nearly T_m. A load beyond the first cage's peak
    torque, which only a crawling motor carries on its second cage, may be refused.

    Not to be confused with `stator_flux`, the "fifth order" of machine textbooks, which has one
    cage and stator transients; nor with `second_motor_group`, which is two machines with a speed
    each.

    Source: Milano 2010, ch. 15 (double-cage, fifth order); ANDES Motor5 for the same equations in d
    and q.
    Departures: written with phasors and with D in place of E''.
    """

    T_prime, X_prime, C, M, T_m = (
        _machine.T_PRIME,
        _machine.X_PRIME,
        _machine.C,
        _machine.M,
        _machine.T_M,
    )
    T_second = Parameter(
        0.01, (0.001, 0.05), "s", "subtransient time constant X''/X' T0''", SOURCE, "T''"
    )
    X_second = Parameter(
        0.2,
        (0.03, 1.2),
        "pu",
        "subtransient reactance on the record's base",
        SOURCE,
        "X''",
        power_exponent=-1,
    )

    def usual(self, T_prime, X_prime, C, M, T_m):
        return _machine.usual(T_prime, X_prime, C, M, T_m)

    def declare(self, eq, T_prime, X_prime, C, M, T_m, T_second, X_second):
        from sympy import I

        E, D, omega = eq.flux("E", "E"), eq.flux("D", "D"), eq.speed(r"\omega")
        V = eq.V
        Z = eq.place(sites.stator_impedance, I * X_second, "Z''")
        inner = eq.place(sites.internal_voltage, E + D, "E''")
        current = eq.place(sites.stator_current, eq.branch("psi", r"\psi", V, Z, behind=inner))
        flux, excess = _machine.rotor(eq, E, inner, omega, current, T_prime, X_prime, C, T_m)
        open_second = T_second * X_prime / X_second  # T_0''
        E_0, D_0, slip = self._guess(eq, T_prime, X_prime, C, T_m, open_second, X_second)
        second = (I * (X_prime - X_second) * current - D) / open_second
        eq.moves(E, flux, E_0)
        eq.moves(D, second + I * (omega - eq.omega_s) * D, D_0)
        eq.moves(omega, excess / M, eq.omega_s0 - slip)
        _machine.require_physical(eq, (T_prime, X_prime, M, T_second, X_second), C)
        eq.require(
            X_prime - X_second,
            "X'' must be at most X', of which it exceeds {value:g} pu",
            X_second - X_prime,
        )
        return current

    @staticmethod
    def _guess(eq, T_prime, X_prime, C, T_m, open_second, X_second):
        """Voltages and slip [rad/s] near the steady state: what both cages carry at a slip just
        below it.
        """
        from sympy import I

        first, second = X_prime * C, X_prime - X_second  # X - X' over X/X', and X' - X''
        slip = T_m * X_prime**2 / eq.U0**2 / (first * T_prime + second * open_second * (1 - C) ** 2)

        def impedance(k, slip):
            """What both cages put in a slip's way, and R + jX of the motor there."""
            n_1, n_2 = (1 - C) ** 2 + (slip * T_prime) ** 2, 1 + (slip * open_second) ** 2
            R = eq.define(
                f"R_{k}", slip * (first * T_prime / n_1 + second * open_second / n_2), f"R_{k}"
            )
            return (
                n_1,
                n_2,
                R,
                eq.define(f"X_{k}", X_second + first * (1 - C) / n_1 + second / n_2, f"X_{k}"),
            )

        n_1, n_2, R, X = impedance(0, slip)
        for k in range(3):
            slip = eq.define(f"slip_{k}", slip * T_m * (R**2 + X**2) / (eq.U0**2 * R), f"s_{k}")
            n_1, n_2, R, X = impedance(k + 1, slip)
        current = eq.U0 * (R - I * X) / (R**2 + X**2)
        E_0 = I * first * current * (1 - C - I * slip * T_prime) / n_1
        return E_0, I * second * current * (1 - I * slip * open_second) / n_2, slip
