"""Undervoltage trip of part of the load, and its reconnection."""

from tractexp.extend import plugin, sites

from ._trip import _Trip, relay


@plugin
class UndervoltageTrip(_Trip):
    """A share F of the load drops out when the voltage stays below U_trip, and returns after it has
    recovered.

    Two timers run: the first while the voltage is below u_t, the second while it is above u_t + h;
    each is empty again as soon as its condition ends. When the first reaches T_t the share is gone,
    when the second reaches T_r it comes back along a ramp of T_b:

        P -> (1 - F g) P,   Q -> (1 - F g) Q,   g = 1 while tripped, down to 0 within T_b, else 0

    At F = 0 the base model, whatever the thresholds. In waveforms the currents fall by F g, and the
    relay sees U, the positive sequence of the last half cycle.

    Source: NERC 2016, Dynamic Load Modeling, app. A; WECC composite load model (one stage).
    Departures: levels count from the voltage before the event; the timers take the voltage between
    samples for a line; thresholds are softened over 1 % of voltage and one sample so that
    derivatives exist; the tripped motors come back as if they had run on.
    """

    tripped_share, trip_level, trip_delay, reconnect_delay, reconnect_margin, reconnect_ramp = (
        relay("share of the load that trips")
    )

    phasor_sites = sites.P, sites.Q
    wave_sites = sites.current, sites.zero_current
    places = ("bus",)
    relevant = {"tripped_share": 0.02}
    confused_with = ("exponential_recovery", "second_motor_group", "load_change")
