"""Second-order induction motor: flux without speed."""

from tractexp.extend import Motor, plugin

from . import _machine


@plugin
class Voltage(Motor):
    r"""Induction motor whose internal voltage and angle move while its speed stays what it was
    before the event.

    States: complex internal voltage E = E' exp(j delta) [pu]; the speed omega is the one at which
    the motor develops T_m before the event, and does not move.

        dE/dt = (j X' C I - (1 - C) E)/T' + j (omega_0 - omega_s) E,   I = (U - E)/(j X')
        P_d + j Q_d = U I*

    The first two lines of Eq. (1) with the third dropped: a motor of infinite inertia, the limit of
    `electromechanical` for M much larger than the dip is long. The reactive power follows the flux;
    the active power after the dip has nothing to recover, for no speed was lost.

    Not to be confused with `mechanical`, which drops the flux and keeps the speed, nor with a
    third-order motor of which only the voltage is observed.

    Source: Wu, Fan, Zou 2022, Table 1 (voltage transient model), Eqs. (1)-(3) with domega/dt = 0.
    Departures: the paper names the model and prints no equations for it. Where the frequency is
    recorded the slip still follows it, because the speed is constant and omega_s is not.
    """

    T_prime, X_prime, C, T_m = _machine.T_PRIME, _machine.X_PRIME, _machine.C, _machine.T_M

    def declare(self, eq, T_prime, X_prime, C, T_m):
        current, omega, slower, excess = _machine.single_cage(eq, T_prime, X_prime, C, T_m)
        eq.moves(omega, 0, eq.omega_s0 + slower, balance=excess)
        _machine.require(eq, (T_prime, X_prime), X_prime, C, T_m)
        return current
