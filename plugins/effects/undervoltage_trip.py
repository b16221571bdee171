"""Undervoltage trip of part of the load, and its reconnection."""

from tractexp.model.parts import Effect
from tractexp.parameter import Parameter
from tractexp.plugin import plugin

SOURCE = "NERC 2016, Dynamic Load Modeling, app. A; WECC composite load model (Ftr1, Vtr1, Ttr1, Vrc1, Trc1)"


@plugin
class UndervoltageTrip(Effect):
    """A share F of the load drops out when the voltage stays below U_trip, and returns after it has recovered.

    Timers run on the samples: time below U_trip fills the first, time above U_reconnect the second; both empty at
    once where their condition ends. Tripped, the load is (1 - F) of what it would be; after the reconnection
    delay it returns along a ramp.

        P = (1 - F g) P,   Q = (1 - F g) Q,   g = 1 while tripped, 0 before the trip

    At F = 0 the base model, whatever the thresholds.

    Source: NERC 2016, Dynamic Load Modeling, app. A; WECC composite load model (one stage).
    Departures: the threshold is softened over 1 % of voltage so that derivatives exist; the trip level counts from
    the voltage before the event.
    """

    tripped_share = Parameter(0.0, (0.0, 0.9), "1", "share of the load that trips", SOURCE, "F", null=0.0)
    trip_level = Parameter(0.7, (0.3, 0.95), "1", "voltage below which it trips, over U_0", SOURCE, "u_t")
    trip_delay = Parameter(0.05, (0.0, 0.5), "s", "time below the level before it trips", SOURCE, "T_t")
    reconnect_delay = Parameter(0.5, (0.02, 5.0), "s", "time after recovery before it returns", SOURCE, "T_r")

    relevant = {"tripped_share": 0.02}
    confused_with = ("exponential_recovery", "second_motor_group", "load_drift")

    def edit(self, eq):
        from tractexp.model.equations import sympy

        share, level, delay, back = eq.declare(self.parameters)
        below = eq.memory("time_below", "t_b")
        tripped = eq.memory("tripped", "g")
        low = 1 / (1 + sympy.exp((eq.U / eq.U0 - level) / 0.0025))  # 1 below the level, 0 above
        eq.renews(below, low * (below + eq.step), 0)
        fires = 1 / (1 + sympy.exp(-(below - delay) / eq.step))  # within a sample or two of the delay
        returns = (1 - low) * eq.step / back
        eq.renews(tripped, tripped + fires * low * (1 - tripped) - tripped * returns, 0)
        eq.P, eq.Q = eq.P * (1 - share * tripped), eq.Q * (1 - share * tripped)
        eq.settled = False
