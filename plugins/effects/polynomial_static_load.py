"""Static load that draws constant power in part, as a ZIP load does."""

from tractexp.extend import Effect, Parameter, plugin, sites

SOURCE = "IEEE Task Force 1993, IEEE Trans. Power Systems 8(2) 472; Kundur 1994, section 7.1.1"


@plugin
class PolynomialStaticLoad(Effect):
    r"""A share of the static load draws constant power, and the law of the base model holds for the
    rest of it.

        P_s -> (1 - k_p) P_s + k_p P_s0,   Q_s -> (1 - k_q) Q_s + k_q Q_s0

    Beside an exponential static load that is P_s = P_s0 ((1 - k_p) u^p_v + k_p), u = U/U_0. At k_p
    = k_q = 0 the base model.

    One share for each power stands for the two of a ZIP load, because the exponent stays free:
    every a_Z u^2 + a_I u + a_P with shares from 0 to 1 is met within 0.3 % of P_s0 for u from 0.3
    to 1 by an exponent p_v and a share k_p, and within 9.4 % by an exponent alone. A share of
    constant current instead leaves up to 8.4 %; beside that of constant power it is a third
    parameter that dips hardly tell from the others: the condition of the fit to three such laws
    rises from 15 .. 20 to 330 .. 720.

    Coefficients from the field may be negative, and so may the share. Of 300 laws with a_Z and a_I
    from -1 to 2 that rise with the voltage 196 are met within 0.5 % with shares from -0.5 to 1, 195
    with -1 to 1 and 133 with 0 to 1. A law that falls where the voltage rises, as some measured
    coefficients have it, is not met.

    Not to be confused with `constant_power_converter`, which holds its power down to a limit of the
    current, nor with the static load `zip`, which has this share already and refuses.

    Source: IEEE Task Force 1993 and Kundur 1994, section 7.1.1: polynomial and exponential static
    load models, here the constant power of the one beside the exponent of the other.
    Departures: no share of constant current or constant impedance of its own; u counts from the
    voltage before the event; the power is held at any voltage, where programs turn it into an
    impedance in deep dips.
    """

    constant_share_P = Parameter(
        0.0, (-0.5, 1.0), "1", "share of constant power in P_s", SOURCE, "k_p", null=0.0
    )
    constant_share_Q = Parameter(
        0.0, (-0.5, 1.0), "1", "share of constant power in Q_s", SOURCE, "k_q", null=0.0
    )

    places, kind = ("static P", "static Q"), "law"
    order = -1  # before what trips, recovers or follows the frequency, which act on the whole law
    phasors_only = "in waveforms a power is held by a control, as constant_power_converter has it"
    relevant = {"constant_share_P": 0.1, "constant_share_Q": 0.1}
    confused_with = (
        "constant_power_converter",
        "voltage_dependent_power_limit",
        "frequency_dependence",
    )

    def refusal(self, eq):
        u = eq[sites.static_voltage]
        laws = (eq.expression(site).expand() for site in (sites.P_static, sites.Q_static))
        if any(law.as_independent(u, as_Add=True)[0] != 0 for law in laws):
            return "a share of its static load draws constant power already"
        return None

    def edit(self, eq, constant_share_P, constant_share_Q):
        eq.edit(sites.P_static, lambda P: (1 - constant_share_P) * P + constant_share_P * eq.P_s0)
        eq.edit(sites.Q_static, lambda Q: (1 - constant_share_Q) * Q + constant_share_Q * eq.Q_s0)
