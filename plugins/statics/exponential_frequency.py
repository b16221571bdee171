"""Exponential static load that follows voltage and frequency."""

from tractexp.extend import Parameter, Static, plugin

SOURCE = "Milano 2010, Power System Modelling and Scripting, ch. 14"


@plugin
class ExponentialFrequency(Static):
    r"""Static load whose power follows a power of the voltage and a power of the frequency.

        P_s = P_s0 (U/U_0)^p_v (f/f_0)^p_f        Q_s = Q_s0 (U/U_0)^q_v (f/f_0)^q_f

    with f/f_0 = (omega_n + omega_s)/(omega_n + omega_s0), the recorded frequency over that before
    the event. Where no frequency is given the ratio is 1: p_f and q_f then have no effect, and an
    identification is refused.

    Not to be confused with the effect `frequency_dependence`, which adds a term linear in frequency
    to whatever static load there is; the two agree to first order, and together would count the
    same thing twice.

    Source: Milano 2010, ch. 14 (frequency-dependent load); ANDES FLoad.
    Departures: the frequency is the recorded one, without the measurement filter of FLoad.
    """

    p_v = Parameter(1.5, (0.0, 4.0), "1", "voltage exponent of active power", SOURCE)
    q_v = Parameter(2.5, (0.0, 8.0), "1", "voltage exponent of reactive power", SOURCE)
    p_f = Parameter(1.0, (-2.0, 4.0), "1", "frequency exponent of active power", SOURCE)
    q_f = Parameter(-1.0, (-4.0, 4.0), "1", "frequency exponent of reactive power", SOURCE)

    reads = ("f",)
    phasors_only = (
        "its frequency is a recorded channel, and a waveform has none; take model/static=branch,"
        " whose reactance follows the frequency by itself"
    )

    def law(self, u, f, p_v, q_v, p_f, q_f):
        return u**p_v * f**p_f, u**q_v * f**q_f
