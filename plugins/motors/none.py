"""No motor: a static load alone."""

from tractexp.extend import Motor, plugin


@plugin
class NoMotor(Motor):
    """Nothing rotates: all of the power before the event is the static load's, P_s0 = P_0 and Q_s0
    = Q_0.

    For loads behind converters or of heating, and as the null that a motor must beat. A model of
    this and a static load has no state: its power at an instant is a function of the voltage at
    that instant.

    Not to be confused with a motor of small T_m, which still draws magnetizing power.

    Source: Wu, Fan, Zou 2022, Eq. (7) without its motor.
    Departures: none.
    """

    within_a_cycle = True

    def declare(self, eq):
        return None
