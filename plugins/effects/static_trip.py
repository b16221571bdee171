"""Undervoltage trip of part of the static load, and its reconnection."""

from tractexp.extend import plugin, sites

from ._trip import _Trip, relay


@plugin
class StaticTrip(_Trip):
    """A share F_s of the static load drops out and returns, as `undervoltage_trip` lets the whole
    load.

        P_s -> (1 - F_s g) P_s,   Q_s -> (1 - F_s g) Q_s

    The motors stay and do not notice: contactors of lighting and electronics, not of drives. At F_s
    = 0 the base model.

    Source: NERC 2016, Dynamic Load Modeling, app. A; WECC composite load model.
    Departures: those of `undervoltage_trip`.
    """

    static_tripped, static_level, static_delay, static_wait, static_margin, static_ramp = relay(
        "share of the static load that trips", "s"
    )

    stage = "_static"
    phasor_sites = wave_sites = sites.P_static, sites.Q_static
    places = ("static P", "static Q")
    family, differs = "undervoltage_trip", "of the static load only"
    relevant = {"static_tripped": 0.04}
    confused_with = ("undervoltage_trip", "exponential_recovery")
