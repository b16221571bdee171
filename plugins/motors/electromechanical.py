"""Third-order induction motor."""

from tractexp.extend import Motor, plugin

from . import _machine


@plugin
class Electromechanical(Motor):
    r"""Induction motor with rotor flux and speed dynamics, stator transients and stator resistance
    neglected.

    States: complex internal voltage E = E' exp(j delta) [pu], speed omega [rad/s, relative to
    synchronous]. The terminal voltage U is the angle reference.

        dE/dt = (j X' C I - (1 - C) E)/T' + j (omega - omega_s) E,   I = (U - E)/(j X')
        M domega/dt = Re(E I*) - T_m
        P_d + j Q_d = U I*

    The first line is (C U - E)/T' + j (omega - omega_s) E and the torque is P_d = -U Im(E)/X': in
    polar form, E = E' exp(j delta), the printed Eqs. (1)-(2), with products instead of
    trigonometric functions. They are written with the stator current so that an effect can edit its
    impedance. Steady state, Eq. (3): sin(2 delta_0) = -2 T_m X'/(C U_0^2), E'_0 = C U_0
    cos(delta_0), omega_0 = omega_s + tan(delta_0)/T', on the stable branch |delta_0| < 45 degrees.

    Not to be confused with the fifth-order motors, which add stator flux (`stator_flux`) or a
    second rotor cage (`double_cage`).

    Source: Wu, Fan, Zou 2022, Eqs. (1)-(3).
    Departures: omega_s follows the recorded frequency where there is one; omega is measured from
    nominal synchronous speed, which leaves Eq. (1) unchanged.
    """

    T_prime, X_prime, C, M, T_m = (
        _machine.T_PRIME,
        _machine.X_PRIME,
        _machine.C,
        _machine.M,
        _machine.T_M,
    )

    def usual(self, T_prime, X_prime, C, M, T_m):
        return _machine.usual(T_prime, X_prime, C, M, T_m)

    def declare(self, eq, T_prime, X_prime, C, M, T_m):
        current, omega, slower, excess = _machine.single_cage(eq, T_prime, X_prime, C, T_m)
        eq.moves(omega, excess / M, eq.omega_s0 + slower)  # Eq. (1)
        _machine.require(eq, (T_prime, X_prime, M), X_prime, C, T_m)
        return current
