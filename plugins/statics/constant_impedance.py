"""Static load of constant impedance."""

from tractexp.extend import Static, plugin


@plugin
class ConstantImpedance(Static):
    """Static load that draws the current of a fixed admittance: nothing about it is identified.

        P_s = P_s0 (U/U_0)^2        Q_s = Q_s0 (U/U_0)^2

    `exponential` with p_v = q_v = 2, and `zip` with a_Z = b_Z = 1. Two parameters fewer to
    identify, for records that cannot tell the static part from the motor.

    Source: Kundur 1994, Power System Stability and Control, section 7.1.1.
    Departures: none.
    """

    def law(self, u):
        return u**2, u**2
