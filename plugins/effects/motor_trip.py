"""Undervoltage trip of part of the motors, and their reconnection."""

from tractexp.extend import plugin, sites

from ._trip import _Trip, relay


@plugin
class MotorTrip(_Trip):
    """A share F_m of the motors drops out and returns, as `undervoltage_trip` lets the whole load.

        P_d -> (1 - F_m g) P_d,   Q_d -> (1 - F_m g) Q_d

    The static load stays. In waveforms the motors' current falls by F_m g. At F_m = 0 the base
    model.

    Source: NERC 2016, Dynamic Load Modeling, app. A; WECC composite load model.
    Departures: those of `undervoltage_trip`.
    """

    motor_tripped, motor_level, motor_delay, motor_wait, motor_margin, motor_ramp = relay(
        "share of the motors that trips", "m"
    )

    stage = "_motor"
    phasor_sites = sites.P_motor, sites.Q_motor
    wave_sites = (sites.motor_current,)
    places = ("motor",)
    family, differs = "undervoltage_trip", "of the motors only"
    relevant = {"motor_tripped": 0.04}
    confused_with = ("undervoltage_trip", "exponential_recovery")
