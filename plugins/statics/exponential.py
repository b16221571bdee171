"""Exponential static load."""

from tractexp.extend import Parameter, Static, plugin

PAPER = "Wu, Fan, Zou 2022, Energies 15(14) 5034, Eq. (6)"


@plugin
class Exponential(Static):
    r"""Static load whose power follows a power of the voltage, independent of frequency.

        P_s = P_s0 (U/U_0)^p_v        Q_s = Q_s0 (U/U_0)^q_v

    P_s0 and Q_s0 are not identified: they are what the motor leaves of the power before the event.

    Of waveforms it is an admittance that follows the size of the voltage over the past half cycle:
    the power is the law's once half a cycle has passed since the voltage changed, and negative
    sequence and harmonics see the admittance of the fundamental.

    Source: Wu, Fan, Zou 2022, Eq. (6).
    Departures: none.
    """

    p_v = Parameter(1.5, (0.0, 4.0), "1", "voltage exponent of active power", PAPER)
    q_v = Parameter(2.5, (0.0, 8.0), "1", "voltage exponent of reactive power", PAPER)

    rival = True

    def law(self, u, p_v, q_v):
        return u**p_v, u**q_v
