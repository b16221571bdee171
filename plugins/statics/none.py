"""No static load: a motor alone."""

from tractexp.extend import Static, plugin


@plugin
class NoStatic(Static):
    """The motor draws all of the power before the event, and nothing else takes up what it leaves:
    P_s = Q_s = 0.

    With a static load P_0 and Q_0 are met exactly, whatever the motor's parameters, because the
    static load draws the remainder. Without one they are met as well as the motor can: T_m is its
    active power, and X', C and T_m make its reactive power, all fitted to the samples before the
    event as to every other. A motor that drives a load consumes both powers, so a record with P_0
    or Q_0 at or below zero is refused.

    Not to be confused with a static load of which little is left: P_s0 and Q_s0 may be near zero in
    any model.

    Source: Wu, Fan, Zou 2022, Eq. (7) without its static load.
    Departures: none.
    """

    def law(self, u):
        return None

    def require(self, P0, Q0):
        for power, name in ((P0, "active"), (Q0, "reactive")):
            sentence = (
                f"a motor alone consumes {name} power, and before the event {power.name} is"
                f" {{value:.3g}} pu; choose a static load, such as model/static=exponential"
            )
            yield power, sentence
