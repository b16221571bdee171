"""Static load of constant power."""

from tractexp.extend import Static, plugin


@plugin
class ConstantPower(Static):
    """Static load that draws the same power at any voltage: nothing about it is identified.

        P_s = P_s0        Q_s = Q_s0

    `exponential` with p_v = q_v = 0, and `zip` without a_Z, a_I, b_Z, b_I. Its current grows as the
    voltage falls, which no real load sustains in a deep dip; the effects `constant_power_converter`
    and `voltage_dependent_power_limit` are what to add then.

    Of waveforms it is an admittance that follows the size of the voltage over the past half cycle:
    the power is the law's once half a cycle has passed since the voltage changed, and negative
    sequence and harmonics see the admittance of the fundamental. When the voltage returns after a
    dip it draws, for that half cycle, the current of the small voltage before.

    Not to be confused with a converter behind a current limit.

    Source: Kundur 1994, Power System Stability and Control, section 7.1.1.
    Departures: none.
    """

    def law(self, u):
        return 1, 1
