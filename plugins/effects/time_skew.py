"""Time skew between the voltage and the power channels."""

import numpy as np

from tractexp.model.parts import Measurement
from tractexp.parameter import Parameter
from tractexp.plugin import plugin


@plugin
class TimeSkew(Measurement):
    """P and Q reach the record later than the voltage they belong to.

        P_recorded(t) = P(t - tau)

    At tau = 0 the base model.

    Source: instrument transformers and filters of unequal delay; shift by linear interpolation.
    Departures: none.
    """

    skew = Parameter(0.0, (-0.02, 0.02), "s", "delay of power behind voltage", "IEC/IEEE 60255-118-1", r"\tau", 0.0)

    relevant = {"skew": 0.001}
    confused_with = ("stator_resistance", "dc_link_lag", "measurement_window")

    def observe(self, power, drive, values):
        out = np.empty_like(power)
        for e in range(drive.events):
            part, step = drive.part(e), drive.event[e, -1]
            n = part.stop - part.start
            lag = values["skew"][e] / step  # (candidates,) samples
            whole = np.floor(lag).astype(int)
            late = (lag - whole)[:, None]
            at = np.arange(n) - whole[:, None]
            near, far = np.clip(at, 0, n - 1), np.clip(at - 1, 0, n - 1)
            for c in range(2):
                y = power[c, :, part]
                shifted = (1 - late) * np.take_along_axis(y, near, 1) + late * np.take_along_axis(y, far, 1)
                out[c, :, part] = shifted
        return out
