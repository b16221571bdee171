"""Time skew between the voltage and the power channels."""

import numpy as np

from tractexp.extend import INPUTS, Measurement, Parameter, plugin

QUIET = 0.005  # of the voltage before: a change between samples that tells how the current follows it


@plugin
class TimeSkew(Measurement):
    """P and Q reach the record later than the voltage they belong to.

        P_recorded(t) = P(t - tau)

    At tau = 0 the base model. It is the voltage that is moved: the current of the samples on either side follows it
    there, so that an edge of the voltage within the interval is one of the power, not a curve that overshoots. In
    waveforms the currents are cubics through their samples. Before the first sample and after the last all is as there.

    Source: instrument transformers and filters of unequal delay, IEC/IEEE 60255-118-1; the cubic is Catmull and
    Rom's 1974.
    Departures: none.
    """

    skew = Parameter(0.0, (-0.02, 0.02), "s", "delay of power behind voltage", "IEC/IEEE 60255-118-1", r"\tau", 0.0)

    places, kind = ("measurement",), "delay"
    relevant = {"skew": 0.001}
    confused_with = ("stator_resistance", "dc_link_lag", "measurement_window")

    def observe(self, power, drive, values):
        from ._recorder import earlier, moved

        out = np.empty_like(power)
        for e in range(drive.events):
            part, step = drive.part(e), drive.event[e, -1]
            lag, y = values["skew"][e] / step, power[:, :, part]
            rows = dict(zip(INPUTS, drive.inputs[:, part], strict=False))
            if "turn_re" in rows:
                earlier(y, lag, out[:, :, part])
            else:
                moved(y, rows["U"], rows["U_rate"] * step, lag, QUIET * drive.event[e, 0], out[:, :, part])
        return out
