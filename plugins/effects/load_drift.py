"""Load that drifts by itself during the record."""

from tractexp.extend import Measurement, Parameter, plugin
from tractexp.model.drive import INPUTS

SOURCE = "ordinary change of load; rates of feeders and trains stay below some percent a second"


@plugin
class LoadDrift(Measurement):
    """The load changes by itself while the event is recorded, for trains accelerate and others come and go.

        P -> P (1 + d_P t),   Q -> Q (1 + d_Q t),   t since the first sample of the event

    At d_P = d_Q = 0 the base model.

    Source: a straight line is the first term of any slow change.
    Departures: none.
    """

    drift_P = Parameter(0.0, (-0.05, 0.05), "1/s", "relative change of P per second", SOURCE, "d_P", null=0.0)
    drift_Q = Parameter(0.0, (-0.05, 0.05), "1/s", "relative change of Q per second", SOURCE, "d_Q", null=0.0)

    relevant = {"drift_P": 0.003, "drift_Q": 0.003}
    confused_with = ("exponential_recovery", "undervoltage_trip", "frequency_dependence")

    def observe(self, power, drive, values):
        out = power.copy()
        for e in range(drive.events):
            part = drive.part(e)
            for channel, name in zip(out, ("drift_P", "drift_Q"), strict=True):
                channel[:, part] *= 1 + values[name][e][:, None] * drive.inputs[INPUTS.index("t"), part]
        return out
