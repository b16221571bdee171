"""Transients of the motor's stator flux."""

from tractexp.extend import Effect, Parameter, plugin, sites

from . import _orders

SOURCE = "Krause, Wasynczuk, Sudhoff 2002, Analysis of Electric Machinery, ch. 4 and 8"


@plugin
class StatorTransients(Effect):
    r"""The stator flux moves by a balance of its own, where the base model lets it jump with the
    voltage.

        I -> I + lambda (I_psi - I_r),   I_psi = (psi + j E)/X,   Z = R + j X
        dpsi/dt = omega_n (V - (R + R_a) I_psi) - j (omega_n + omega_s) psi + omega_n R_a I_r,
        R_a = r X/omega_n
        I_r = (V - n E)/(R + j n X),   n = 1 + omega_s/omega_n

    E is the voltage behind the motor's impedance Z, whatever states it is made of, and I_r the
    current at which the stator flux rests. lambda is the share of the stator transients in the
    current: at 0 the base model, at 1, at nominal frequency and without R_a, the fifth-order motor
    `stator_flux`, whose R_s is then the effect `stator_resistance`. While the voltage moves the
    motor draws lambda (dU/dt)/(omega_n X) more; after an edge the offset of its flux turns
    backwards in the frame of the voltage, a ring at the supply frequency that ends by R or by r,
    and that phasors averaged over a cycle hide. The steady state is the base model's for every
    lambda.

    Why lambda and not the textbook's small parameter, lambda dpsi/dt: that one is stiff at the null
    and has no derivative there that a record could show. Between 0 and 1 lambda is a mixture of two
    motors that share a rotor and means no single machine; above 1 it means nothing, and is allowed
    so that an estimate may scatter about 1. An interval that contains 1 is what theory says; one
    far below says that a part of the motors has these transients, or that something else looks like
    them.

    Not to be confused with `time_skew`, which shifts all power, nor with the capacitor's current,
    which leads by its susceptance and not by 1/X.

    Source: Krause, Wasynczuk, Sudhoff 2002, ch. 4 (flux linkages) and ch. 8 (stator transients
    neglected).
    Departures: the mixture; r damps the offset and loses nothing at rest, which is left to
    `stator_resistance`.
    """

    stator_share = Parameter(
        0.0, (0.0, 1.5), "1", "share of stator transients in the current", SOURCE, r"\lambda_s", 0.0
    )
    offset_decay = Parameter(
        10.0, (0.0, 150.0), "1/s", "rate at which the offset of the flux decays", SOURCE, "r"
    )

    places, kind = ("stator impedance",), "lag"
    rival = True
    phasors_only = "of waveforms the stator flux of every motor moves already"
    grid = {"offset_decay": (3.0, 40.0)}
    relevant = {"stator_share": 0.1}
    confused_with = ("time_skew", "stator_resistance", "shunt_capacitor", "static_var_compensator")

    def refusal(self, eq):
        if "psi" in eq:
            return "its stator flux moves already"
        if (
            sites.stator_impedance in eq
            and "rotor_flux" not in eq
            and not _orders.list_moving_states(eq, _orders.FLUX)
        ):
            return (
                "its rotor flux does not move, beside which a stator flux would turn by itself; add"
                " rotor_flux first"
            )
        return None

    def edit(self, eq, stator_share, offset_decay):
        from sympy import I, expand, im, re

        Z, V, at_once = eq[sites.stator_impedance], eq.V, eq.expression(sites.stator_current)
        E, speed = expand(V - Z * at_once), 1 + eq.omega_s / eq.omega_n
        R, X = re(Z), im(Z)
        psi = eq.lag_vector("stator_flux", r"\psi")
        flowing = eq.define("flux_current", (psi + I * E) / X, r"I_\psi")
        resting = eq.define("resting_current", (V - speed * E) / (R + I * speed * X), "I_r")
        decay = X * offset_decay * (flowing - resting)
        # about, where R is not 0
        eq.moves(psi, eq.omega_n * (V - R * flowing - I * speed * psi) - decay, -I * eq.U0)
        eq.edit(sites.stator_current, lambda own: own + stator_share * (flowing - resting))
