"""Window over which the recorder averages power."""

import numpy as np

from tractexp.model.parts import Measurement
from tractexp.parameter import Parameter
from tractexp.plugin import plugin


@plugin
class MeasurementWindow(Measurement):
    """P and Q are averaged over a window centered on their time, as Fourier phasors of one or more cycles are.

        P_recorded(t) = 1/W integral of P over t - W/2 ... t + W/2

    P is linear between samples; before the first and after the last it is what it is there. At W = 0 the base model.
    A window that ends at its time is this one and a `time_skew` of W/2.

    Source: IEC/IEEE 60255-118-1, phasors by a one-cycle discrete Fourier transform (a boxcar on the power).
    Departures: the window acts on power, though the recorder's acts on voltage and current.
    """

    window = Parameter(0.0, (0.0, 0.12), "s", "length of the window", "IEC/IEEE 60255-118-1", "W", 0.0)

    relevant = {"window": 0.02}
    confused_with = ("time_skew", "stator_resistance")

    def observe(self, power, drive, values):
        out = power.copy()
        for e in range(drive.events):
            part, half = drive.part(e), values["window"][e] / drive.event[e, -1] / 2  # samples
            wide = np.flatnonzero(half)
            forward, half = power[:, wide, part], half[wide]
            backward = _ahead(forward[..., ::-1], half)[..., ::-1]
            out[:, wide, part] = (_ahead(forward, half) + backward) / (2 * half[:, None])
        return out


def _ahead(y, half):
    """Integral of y (2, n, N), linear between samples, over the next `half` (n,) samples from each."""
    whole = np.floor(half).astype(int)
    r, N = (half - whole)[:, None], y.shape[2]
    sums = np.zeros_like(y)
    np.cumsum((y[..., 1:] + y[..., :-1]) / 2, axis=2, out=sums[..., 1:])
    at = np.arange(N) + whole[:, None]
    inside, beyond = np.minimum(at, N - 1)[None], np.maximum(at - (N - 1), 0)
    read = lambda values, where: np.take_along_axis(values, where, 2)  # noqa: E731
    here, there = read(y, inside), read(y, np.minimum(inside + 1, N - 1))
    return read(sums, inside) - sums + beyond * y[..., -1:] + r * here + r**2 / 2 * (there - here)
