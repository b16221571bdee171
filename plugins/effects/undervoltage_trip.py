"""Undervoltage trip of part of the load, and its reconnection."""

from tractexp.extend import Effect, Parameter, plugin, sites

from ._relay import opened

SOURCE = "NERC 2016, Dynamic Load Modeling, app. A; WECC composite load model (Ftr1, Vtr1, Ttr1, Vrc1, Trc1)"


@plugin
class UndervoltageTrip(Effect):
    """A share F of the load drops out when the voltage stays below U_trip, and returns after it has recovered.

    Two timers run on the samples: the first while the voltage is below u_t, the second while it is above u_t + h;
    each is empty again as soon as its condition ends. When the first reaches T_t the share is gone, when the second
    reaches T_r it comes back along a ramp of T_b:

        P -> (1 - F g) P,   Q -> (1 - F g) Q,   g = 1 while tripped, down to 0 within T_b, else 0

    At F = 0 the base model, whatever the thresholds. In waveforms the currents fall by F g, and the relay sees U, the
    positive sequence of the last half cycle.

    Source: NERC 2016, Dynamic Load Modeling, app. A; WECC composite load model (one stage).
    Departures: levels count from the voltage before the event; thresholds are softened over 1 % of voltage and one
    sample so that derivatives exist; the tripped motors come back as if they had run on.
    """

    tripped_share = Parameter(0.0, (0.0, 0.9), "1", "share of the load that trips", SOURCE, "F", null=0.0)
    trip_level = Parameter(0.7, (0.3, 0.95), "1", "voltage below which it trips, over U_0", SOURCE, "u_t")
    trip_delay = Parameter(0.05, (0.0, 0.5), "s", "time below the level before it trips", SOURCE, "T_t")
    reconnect_delay = Parameter(0.5, (0.02, 5.0), "s", "time after recovery before it returns", SOURCE, "T_r")
    reconnect_margin = Parameter(0.05, (0.01, 0.5), "1", "recovered is this much above the level", SOURCE, "h")
    reconnect_ramp = Parameter(0.1, (0.0, 2.0), "s", "time in which it returns", SOURCE, "T_b")

    places, kind = ("bus",), "trip"
    order = 3
    grid = {"trip_level": (0.5, 0.7, 0.8, 0.9), "trip_delay": (0.02, 0.08), "reconnect_delay": (0.2, 1.0)}
    relevant = {"tripped_share": 0.02}
    confused_with = ("exponential_recovery", "second_motor_group", "load_drift")

    def edit(self, eq, tripped_share, trip_level, trip_delay, reconnect_delay, reconnect_margin, reconnect_ramp):
        tripped = opened(eq, trip_level, trip_delay, reconnect_delay, reconnect_margin, reconnect_ramp)
        for site in (sites.current, sites.zero_current) if eq.waves else (sites.P, sites.Q):
            eq.edit(site, lambda drawn: drawn * (1 - tripped_share * tripped))
