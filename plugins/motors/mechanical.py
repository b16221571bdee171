"""First-order induction motor."""

from tractexp.extend import Motor, plugin, sites

from . import _machine


@plugin
class Mechanical(Motor):
    r"""Induction motor whose only state is its speed; the rotor flux is in equilibrium with voltage
    and slip.

    State: speed omega [rad/s, relative to synchronous]. The internal voltage E is what Eq. (1)
    comes to rest at,

        E = j X' C U/(Z' (1 - C - j (omega - omega_s) T') + j X' C),   I = (U - E)/Z',   Z' = j X'

    that is C U/(1 - j (omega - omega_s) T'), the steady-state equivalent circuit at the present
    slip, and

        M domega/dt = Re(E I*) - T_m,          P_d + j Q_d = U I*

    The active power follows the speed; the reactive power jumps with the voltage, for no flux holds
    it back. Steady state as in Eq. (3), the same as the third-order motor's. It is the limit of
    `electromechanical` for a flux that settles much faster than the speed.

    Not to be confused with a constant-slip or constant-torque load: the slip moves. Not to be
    confused with the first-order *voltage* models of the literature, which keep the flux and drop
    the speed (see `voltage`).

    Of waveforms it says nothing: a flux that is in equilibrium at each instant would let the
    current jump with every jump of the voltage.

    Source: Wu, Fan, Zou 2022, Table 1 (mechanical transient model), Eq. (1) with dE/dt = 0 in the
    frame that turns with the voltage; Kundur 1994, Power System Stability and Control, section 7.2.
    Departures: the paper names the model and prints no equations for it.
    """

    T_prime, X_prime, C, M, T_m = (
        _machine.T_PRIME,
        _machine.X_PRIME,
        _machine.C,
        _machine.M,
        _machine.T_M,
    )

    phasors_only = (
        "its fluxes are in equilibrium with the voltage, which may hold over cycles and never"
        " within one; take model/motor=stator_flux or electromechanical, whose fluxes move"
    )

    def declare(self, eq, T_prime, X_prime, C, M, T_m):
        from sympy import I, conjugate, re

        omega, V = eq.speed(r"\omega"), eq.V
        Z = eq.place(sites.stator_impedance, I * X_prime)
        eq.place(sites.backward_impedance, Z)
        coupling = eq.place(sites.coupling, C)
        time_constant = eq.place(sites.time_constant, T_prime)
        source = I * X_prime * coupling
        slip = eq.define("slip", omega - eq.omega_s, "s")
        turning = I * slip * time_constant
        E = eq.place(sites.internal_voltage, source * V / (Z * (1 - coupling - turning) + source))
        current = eq.place(sites.stator_current, (V - E) / Z)
        electrical_torque = eq.place(sites.electrical_torque, re(E * conjugate(current)))
        load_torque = eq.place(sites.load_torque, T_m)

        _, slower = _machine.at_rest(eq, T_prime, X_prime, C, T_m)
        eq.moves(omega, (electrical_torque - load_torque) / M, eq.omega_s0 + slower)
        _machine.require(eq, (T_prime, X_prime, M), X_prime, C, T_m)
        return current
