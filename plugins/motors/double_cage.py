"""Fifth-order induction motor: two rotor cages, no stator transients."""

from tractexp.extend import Motor, plugin, sites

from . import _machine


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
    cage and stator transients; nor with `double_cage_stator_flux`, which has both; nor with
    `second_motor_group`, which is two machines with a speed each.

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
    T_second, X_second = _machine.T_SECOND, _machine.X_SECOND

    def usual(self, T_prime, X_prime, C, M, T_m):
        return _machine.usual(T_prime, X_prime, C, M, T_m)

    def declare(self, eq, T_prime, X_prime, C, M, T_m, T_second, X_second):
        from sympy import I

        V = eq.V
        Z = eq.place(sites.stator_impedance, I * X_second, "Z''")
        eq.place(sites.backward_impedance, Z)
        return _machine.two_cages(
            eq,
            lambda E_second: eq.branch("psi", r"\psi", V, Z, behind=E_second),
            (T_prime, X_prime, C, M, T_m, T_second, X_second),
        )
