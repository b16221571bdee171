"""ZIP (polynomial) static load."""

from tractexp.extend import Parameter, Static, plugin

SOURCE = "IEEE Task Force 1995, Standard load models, IEEE Trans. Power Systems 10(3) 1302"


@plugin
class Zip(Static):
    r"""Static load of constant impedance, constant current and constant power, in shares that add
    up to 1.

        P_s = P_s0 (a_Z u^2 + a_I u + a_P),   a_P = 1 - a_Z - a_I,   u = U/U_0
        Q_s = Q_s0 (b_Z u^2 + b_I u + b_P),   b_P = 1 - b_Z - b_I

    The constant-power shares are not parameters, so that shares cannot fail to add up; none may be
    negative, which is a requirement of the model: a_Z + a_I and b_Z + b_I are at most 1. At U = U_0
    it draws what the exponential load draws, with the slopes p_v = 2 a_Z + a_I and q_v = 2 b_Z +
    b_I.

    Of waveforms it is an admittance that follows the size of the voltage over the past half cycle:
    the power is the law's once half a cycle has passed since the voltage changed, and negative
    sequence and harmonics see the admittance of the fundamental.

    Not to be confused with `exponential`, which has one number for each power; the two agree to
    first order near U_0 and part in deep dips, where the constant-power share keeps its power.

    Source: IEEE Task Force on Load Representation 1995 (polynomial model); Kundur 1994, section
    7.1.1.
    Departures: u counts from the voltage before the event, not from the nominal voltage.
    """

    a_Z = Parameter(0.4, (0.0, 1.0), "1", "share of constant impedance in P_s", SOURCE, "a_Z")
    a_I = Parameter(0.3, (0.0, 1.0), "1", "share of constant current in P_s", SOURCE, "a_I")
    b_Z = Parameter(0.7, (0.0, 1.0), "1", "share of constant impedance in Q_s", SOURCE, "b_Z")
    b_I = Parameter(0.2, (0.0, 1.0), "1", "share of constant current in Q_s", SOURCE, "b_I")

    rival = True

    def law(self, u, a_Z, a_I, b_Z, b_I):
        return a_Z * u**2 + a_I * u + 1 - a_Z - a_I, b_Z * u**2 + b_I * u + 1 - b_Z - b_I

    def require(self, a_Z, a_I, b_Z, b_I):
        for power, impedance, current in (("active", a_Z, a_I), ("reactive", b_Z, b_I)):
            for share in (impedance, current):
                yield share, f"{share.name} is a share and must not be negative: it is {{value:g}}"
            sentence = (
                f"the shares of the {power} power must add up to 1: {impedance.name} +"
                f" {current.name} is {{value:g}}, which leaves a negative share of constant power;"
                " lower one of them"
            )
            yield 1 - impedance - current, sentence, impedance + current
