"""Seventh-order induction motor: two rotor cages and stator transients."""

from tractexp.extend import Motor, plugin, sites

from . import _machine


@plugin
class DoubleCageStatorFlux(Motor):
    r"""Induction motor with a second rotor circuit whose stator flux has dynamics of its own, in
    the frame that turns with the voltage.

    States: stator flux linkage psi, voltages E behind X' and D = E'' - E that the second cage adds
    [pu], all complex, and speed omega [rad/s].

        dpsi/dt = omega_n (U - R_s I) - j (omega_n + omega_s) psi,     I = (psi + j (E + D))/X''
        dE/dt = (j (X - X') I - E)/T_0' + j (omega - omega_s) E
        dD/dt = (j (X' - X'') I - D)/T_0'' + j (omega - omega_s) D
        M domega/dt = Re((E + D) I*) - T_m,          P_d + j Q_d = U I*

    With X = X'/(1 - C), T_0' = T'/(1 - C) and T'' = X''/X' T_0''. At X'' = X' nothing drives D and
    the model is `stator_flux`; with dpsi/dt = 0 and R_s = 0 it is `double_cage`, whose waveforms
    with the effect `stator_resistance` it has. The offset of the flux that a dip leaves decays
    through R_s and both cages. The steady state is solved by Newton's method from that of
    `double_cage`.

    A phasor record is a moving average over a period and hides most of what psi adds.

    Source: Krause, Wasynczuk, Sudhoff 2002, Analysis of Electric Machinery, ch. 4 (stator flux);
    Milano 2010, ch. 15 (rotor circuits).
    Departures: written with phasors and with D in place of E''.
    """

    T_prime, X_prime, C, M, T_m = (
        _machine.T_PRIME,
        _machine.X_PRIME,
        _machine.C,
        _machine.M,
        _machine.T_M,
    )
    T_second, X_second, R_s = _machine.T_SECOND, _machine.X_SECOND, _machine.R_S
    within_a_cycle = True

    def usual(self, T_prime, X_prime, C, M, T_m, R_s):
        return [*_machine.usual(T_prime, X_prime, C, M, T_m), (R_s / X_prime, 0.12, 3.9)]

    def declare(self, eq, T_prime, X_prime, C, M, T_m, T_second, X_second, R_s):
        from sympy import I

        V, Z = eq.V, R_s + I * X_second
        eq.place(sites.backward_impedance, Z)
        return _machine.two_cages(
            eq,
            lambda E_second: eq.branch("psi", r"\psi", V, Z, behind=E_second, flux_moves=True),
            (T_prime, X_prime, C, M, T_m, T_second, X_second),
        )
