"""Undervoltage trip of part of the static load, and its reconnection."""

from tractexp.extend import Effect, Parameter, plugin, sites

from ._relay import opened

SOURCE = "NERC 2016, Dynamic Load Modeling, app. A; WECC composite load model (Ftr1, Vtr1, Ttr1, Vrc1, Trc1)"


@plugin
class StaticTrip(Effect):
    """A share F_s of the static load drops out and returns, as `undervoltage_trip` lets the whole load.

        P_s -> (1 - F_s g) P_s,   Q_s -> (1 - F_s g) Q_s

    The motors stay and do not notice: contactors of lighting and electronics, not of drives. At F_s = 0 the base model.

    Source: NERC 2016, Dynamic Load Modeling, app. A; WECC composite load model.
    Departures: those of `undervoltage_trip`.
    """

    static_tripped = Parameter(0.0, (0.0, 0.9), "1", "share of the static load that trips", SOURCE, "F_s", null=0.0)
    static_level = Parameter(0.7, (0.3, 0.95), "1", "voltage below which it trips, over U_0", SOURCE, "u_{ts}")
    static_delay = Parameter(0.05, (0.0, 0.5), "s", "time below the level before it trips", SOURCE, "T_{ts}")
    static_wait = Parameter(0.5, (0.02, 5.0), "s", "time after recovery before it returns", SOURCE, "T_{rs}")
    static_margin = Parameter(0.05, (0.01, 0.5), "1", "recovered is this much above the level", SOURCE, "h_s")
    static_ramp = Parameter(0.1, (0.0, 2.0), "s", "time in which it returns", SOURCE, "T_{bs}")

    order = 3
    places, kind = ("static P", "static Q"), "trip"
    family, differs = "undervoltage_trip", "of the static load only"
    as_textbook = {
        "static_tripped": "tripped_share", "static_level": "trip_level", "static_delay": "trip_delay",
        "static_wait": "reconnect_delay", "static_margin": "reconnect_margin", "static_ramp": "reconnect_ramp",
    }  # fmt: skip
    grid = {"static_level": (0.5, 0.7, 0.8, 0.9), "static_delay": (0.02, 0.08), "static_wait": (0.2, 1.0)}
    relevant = {"static_tripped": 0.04}
    confused_with = ("undervoltage_trip", "exponential_recovery")

    def edit(self, eq, static_tripped, static_level, static_delay, static_wait, static_margin, static_ramp):
        gone = opened(eq, static_level, static_delay, static_wait, static_margin, static_ramp, "_static")
        for site in (sites.P_static, sites.Q_static):
            eq.edit(site, lambda power: power * (1 - static_tripped * gone))
