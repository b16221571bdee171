"""Undervoltage trip of the load in two stages, and its reconnection."""

from tractexp.extend import Effect, Parameter, plugin, sites

from ._relay import compute_open_share
from ._trip import relay

SOURCE = (
    "WECC composite load model (Ftr1, Vtr1, Ttr1, Ftr2, Vtr2, Ttr2); NERC 2016, Dynamic Load"
    " Modeling, app. A"
)


@plugin
class TwoStageTrip(Effect):
    """Two relays of their own levels and delays let go a share F_1 and a share F_2 of the load.

        P -> (1 - F_1 g_1 - F_2 g_2) P,   Q -> (1 - F_1 g_1 - F_2 g_2) Q

    At F_2 = 0 it is `undervoltage_trip`, at F_1 = F_2 = 0 the base model. In waveforms the currents
    fall so.

    Source: WECC composite load model, whose motors trip in two stages.
    Departures: those of `undervoltage_trip`; both stages return along the same ramp.
    """

    stage_1_tripped, stage_1_level, stage_1_delay, stage_1_wait, stage_1_margin = relay(
        "share that the first stage lets go", "1", 0.6, source=SOURCE
    )[:5]
    stage_2_tripped, stage_2_level, stage_2_delay, stage_2_wait, stage_2_margin = relay(
        "share that the second stage lets go", "2", 0.6, 0.6, 0.1, SOURCE
    )[:5]
    stage_ramp = Parameter(0.1, (0.0, 2.0), "s", "time in which a stage returns", SOURCE, "T_{b12}")

    order = 3
    places, kind = ("bus",), "trip"
    family, differs, nests_textbook = "undervoltage_trip", "in two stages", True
    as_textbook = {
        "stage_1_tripped": "tripped_share",
        "stage_1_level": "trip_level",
        "stage_1_delay": "trip_delay",
        "stage_1_wait": "reconnect_delay",
        "stage_2_wait": "reconnect_delay",
        "stage_1_margin": "reconnect_margin",
        "stage_2_margin": "reconnect_margin",
        "stage_ramp": "reconnect_ramp",
    }
    grid = {"stage_2_level": (0.5, 0.6, 0.7, 0.85), "stage_2_delay": (0.03, 0.15)}
    relevant = {"stage_1_tripped": 0.04, "stage_2_tripped": 0.04}
    confused_with = ("undervoltage_trip", "exponential_recovery")

    def edit(
        self,
        eq,
        stage_1_tripped,
        stage_1_level,
        stage_1_delay,
        stage_1_wait,
        stage_1_margin,
        stage_2_tripped,
        stage_2_level,
        stage_2_delay,
        stage_2_wait,
        stage_2_margin,
        stage_ramp,
    ):
        first = compute_open_share(
            eq, stage_1_level, stage_1_delay, stage_1_wait, stage_1_margin, stage_ramp, "_1"
        )
        second = compute_open_share(
            eq, stage_2_level, stage_2_delay, stage_2_wait, stage_2_margin, stage_ramp, "_2"
        )
        gone = stage_1_tripped * first + stage_2_tripped * second
        for site in (sites.current, sites.zero_current) if eq.waves else (sites.P, sites.Q):
            eq.edit(site, lambda drawn: drawn * (1 - gone))
