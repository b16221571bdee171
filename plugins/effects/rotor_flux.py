"""The balance of the rotor flux, of a motor that has none."""

from tractexp.extend import Effect, Parameter, plugin, sites

from . import _orders

SOURCE = "Wu, Fan, Zou 2022, Energies 15(14) 5034, Table 1 and Eq. (1)"


@plugin
class RotorFlux(Effect):
    r"""The rotor flux moves by a balance of its own, where the base model has it follow voltage and
    slip at once.

        E -> E + lambda (E_m - E)
        dE_m/dt = (j X' C I_m - (1 - C) E_m)/T' + j (omega - omega_s) E_m,     I_m = (V - E_m)/Z'

    At lambda = 0 the base model, `mechanical`; at 1 the third-order motor `electromechanical`. Both
    rest where Eq. (3) says, so that the steady state is the same for every lambda. A small
    parameter before dE/dt would be stiff at the null; lambda is linear there. Between 0 and 1 it is
    a mixture that means no single machine.

    Not to be confused with `exponential_recovery`, a static load that comes back.

    Source: Wu, Fan, Zou 2022, Table 1 (electromechanical against mechanical transient model), Eq.
    (1).
    Departures: the mixture; lambda up to 1.5, so that an estimate may scatter about 1.
    """

    flux_share = Parameter(
        0.0, (0.0, 1.5), "1", "share of the flux that moves by a balance", SOURCE, r"\lambda_r", 0.0
    )

    places, kind = ("flux decay",), "lag"
    order = -1
    phasors_only = "of waveforms the rotor flux of every motor moves already"
    relevant = {"flux_share": 0.1}
    confused_with = ("exponential_recovery", "dc_link_lag", "time_skew")

    def refusal(self, eq):
        return (
            "its rotor flux moves already" if _orders.list_moving_states(eq, _orders.FLUX) else None
        )

    def edit(self, eq, flux_share):
        from sympy import I, im

        at_once, Z, V = eq.expression(sites.internal_voltage), eq[sites.stator_impedance], eq.V
        X = im(eq.expression(sites.stator_impedance))
        coupling, slip = eq[sites.coupling], eq["omega"] - eq.omega_s
        E = eq.lag_vector("rotor_flux", "E_m")
        driven = I * X * coupling * (V - E) / Z - (1 - coupling) * E
        eq.moves(E, driven / eq[sites.time_constant] + I * slip * E, at_once)
        eq.states[E].derived = True
        eq.edit(sites.internal_voltage, lambda own: own + flux_share * (E - own))
