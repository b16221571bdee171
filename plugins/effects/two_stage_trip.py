"""Undervoltage trip of the load in two stages, and its reconnection."""

from tractexp.extend import Effect, Parameter, plugin, sites

from ._relay import opened

SOURCE = "WECC composite load model (Ftr1, Vtr1, Ttr1, Ftr2, Vtr2, Ttr2); NERC 2016, Dynamic Load Modeling, app. A"


@plugin
class TwoStageTrip(Effect):
    """Two relays of their own levels and delays let go a share F_1 and a share F_2 of the load.

        P -> (1 - F_1 g_1 - F_2 g_2) P,   Q -> (1 - F_1 g_1 - F_2 g_2) Q

    At F_2 = 0 it is `undervoltage_trip`, at F_1 = F_2 = 0 the base model. In waveforms the currents fall so.

    Source: WECC composite load model, whose motors trip in two stages.
    Departures: those of `undervoltage_trip`; both stages return along the same ramp.
    """

    stage_1_tripped = Parameter(0.0, (0.0, 0.6), "1", "share that the first stage lets go", SOURCE, "F_1", null=0.0)
    stage_1_level = Parameter(0.7, (0.3, 0.95), "1", "voltage below which it trips, over U_0", SOURCE, "u_{t1}")
    stage_1_delay = Parameter(0.05, (0.0, 0.5), "s", "time below the level before it trips", SOURCE, "T_{t1}")
    stage_1_wait = Parameter(0.5, (0.02, 5.0), "s", "time after recovery before it returns", SOURCE, "T_{r1}")
    stage_1_margin = Parameter(0.05, (0.01, 0.5), "1", "recovered is this much above the level", SOURCE, "h_1")
    stage_2_tripped = Parameter(0.0, (0.0, 0.6), "1", "share that the second stage lets go", SOURCE, "F_2", null=0.0)
    stage_2_level = Parameter(0.6, (0.3, 0.95), "1", "voltage below which it trips, over U_0", SOURCE, "u_{t2}")
    stage_2_delay = Parameter(0.1, (0.0, 0.5), "s", "time below the level before it trips", SOURCE, "T_{t2}")
    stage_2_wait = Parameter(0.5, (0.02, 5.0), "s", "time after recovery before it returns", SOURCE, "T_{r2}")
    stage_2_margin = Parameter(0.05, (0.01, 0.5), "1", "recovered is this much above the level", SOURCE, "h_2")
    stage_ramp = Parameter(0.1, (0.0, 2.0), "s", "time in which a stage returns", SOURCE, "T_{b12}")

    order = 3
    places, kind = ("bus",), "trip"
    family, differs, nests_textbook = "undervoltage_trip", "in two stages", True
    as_textbook = {
        "stage_1_tripped": "tripped_share", "stage_1_level": "trip_level", "stage_1_delay": "trip_delay",
        "stage_1_wait": "reconnect_delay", "stage_2_wait": "reconnect_delay",
        "stage_1_margin": "reconnect_margin", "stage_2_margin": "reconnect_margin", "stage_ramp": "reconnect_ramp",
    }  # fmt: skip
    grid = {"stage_2_level": (0.5, 0.6, 0.7, 0.85), "stage_2_delay": (0.03, 0.15)}
    relevant = {"stage_1_tripped": 0.04, "stage_2_tripped": 0.04}
    confused_with = ("undervoltage_trip", "exponential_recovery")

    def edit(
        self, eq, stage_1_tripped, stage_1_level, stage_1_delay, stage_1_wait, stage_1_margin,
        stage_2_tripped, stage_2_level, stage_2_delay, stage_2_wait, stage_2_margin, stage_ramp,
    ):  # fmt: skip
        first = opened(eq, stage_1_level, stage_1_delay, stage_1_wait, stage_1_margin, stage_ramp, "_1")
        second = opened(eq, stage_2_level, stage_2_delay, stage_2_wait, stage_2_margin, stage_ramp, "_2")
        gone = stage_1_tripped * first + stage_2_tripped * second
        for site in (sites.current, sites.zero_current) if eq.waves else (sites.P, sites.Q):
            eq.edit(site, lambda drawn: drawn * (1 - gone))
