"""Time skew between the voltage and the power channels."""

import numpy as np

from tractexp.model.parts import Measurement
from tractexp.parameter import Parameter
from tractexp.plugin import plugin


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
        out = power.copy()
        for e in range(drive.events):
            part, lag = drive.part(e), values["skew"][e] / drive.event[e, -1]  # samples
            late = np.flatnonzero(lag)
            out[:, late, part] = _earlier(power[:, late, part], lag[late])
        return out


def _earlier(y, lag):
    """y (2, n, N) read `lag` (n,) samples earlier."""
    whole = np.floor(lag).astype(int)
    r = (lag - whole)[:, None]
    at = np.arange(y.shape[2]) - whole[:, None]
    weights = (r**2 * (r - 1), r * (1 + r * (4 - 3 * r)), 2 + r**2 * (3 * r - 5), -r * (1 - r) ** 2)
    read = lambda back: np.take_along_axis(y, np.clip(at - back, 0, y.shape[2] - 1)[None], 2)  # noqa: E731
    return sum(weight / 2 * read(back) for weight, back in zip(weights, (2, 1, 0, -1), strict=True))
