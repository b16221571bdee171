"""Time skew between the voltage and the power channels."""

import numpy as np

from tractexp.extend import Measurement, Parameter, plugin


@plugin
class TimeSkew(Measurement):
    """P and Q reach the record later than the voltage they belong to.

        P_recorded(t) = P(t - tau)

    At tau = 0 the base model. Between samples P is a cubic through its neighbors, so that the response has a
    derivative in tau everywhere; before the first sample and after the last it is what it is there.

    Source: instrument transformers and filters of unequal delay, IEC/IEEE 60255-118-1; the cubic is Catmull and
    Rom's 1974.
    Departures: none.
    """

    skew = Parameter(0.0, (-0.02, 0.02), "s", "delay of power behind voltage", "IEC/IEEE 60255-118-1", r"\tau", 0.0)

    relevant = {"skew": 0.001}
    confused_with = ("stator_resistance", "dc_link_lag", "measurement_window")

    def observe(self, power, drive, values):
        from tractexp_plugins.effects._recorder import earlier

        out = np.empty_like(power)
        for e in range(drive.events):
            part = drive.part(e)
            earlier(power[:, :, part], values["skew"][e] / drive.event[e, -1], out[:, :, part])
        return out
