"""Undervoltage trip of part of the motors, and their reconnection."""

from tractexp.extend import Effect, Parameter, plugin, sites

from ._relay import opened

SOURCE = "NERC 2016, Dynamic Load Modeling, app. A; WECC composite load model (Ftr1, Vtr1, Ttr1, Vrc1, Trc1)"


@plugin
class MotorTrip(Effect):
    """A share F_m of the motors drops out and returns, as `undervoltage_trip` lets the whole load.

        P_d -> (1 - F_m g) P_d,   Q_d -> (1 - F_m g) Q_d

    The static load stays. In waveforms the motors' current falls by F_m g. At F_m = 0 the base model.

    Source: NERC 2016, Dynamic Load Modeling, app. A; WECC composite load model.
    Departures: those of `undervoltage_trip`.
    """

    motor_tripped = Parameter(0.0, (0.0, 0.9), "1", "share of the motors that trips", SOURCE, "F_m", null=0.0)
    motor_level = Parameter(0.7, (0.3, 0.95), "1", "voltage below which it trips, over U_0", SOURCE, "u_{tm}")
    motor_delay = Parameter(0.05, (0.0, 0.5), "s", "time below the level before it trips", SOURCE, "T_{tm}")
    motor_wait = Parameter(0.5, (0.02, 5.0), "s", "time after recovery before it returns", SOURCE, "T_{rm}")
    motor_margin = Parameter(0.05, (0.01, 0.5), "1", "recovered is this much above the level", SOURCE, "h_m")
    motor_ramp = Parameter(0.1, (0.0, 2.0), "s", "time in which it returns", SOURCE, "T_{bm}")

    order = 3
    places, kind = ("motor",), "trip"
    family, differs = "undervoltage_trip", "of the motors only"
    as_textbook = {
        "motor_tripped": "tripped_share", "motor_level": "trip_level", "motor_delay": "trip_delay",
        "motor_wait": "reconnect_delay", "motor_margin": "reconnect_margin", "motor_ramp": "reconnect_ramp",
    }  # fmt: skip
    grid = {"motor_level": (0.5, 0.7, 0.8, 0.9), "motor_delay": (0.02, 0.08), "motor_wait": (0.2, 1.0)}
    relevant = {"motor_tripped": 0.04}
    confused_with = ("undervoltage_trip", "exponential_recovery")

    def edit(self, eq, motor_tripped, motor_level, motor_delay, motor_wait, motor_margin, motor_ramp):
        gone = opened(eq, motor_level, motor_delay, motor_wait, motor_margin, motor_ramp, "_motor")
        for site in (sites.motor_current,) if eq.waves else (sites.P_motor, sites.Q_motor):
            eq.edit(site, lambda drawn: drawn * (1 - motor_tripped * gone))
