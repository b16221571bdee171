"""Whether a simulation has reached its periodic steady state when the record begins."""

import numpy as np

from tractexp.record import WaveEvent


def unsettled(event: WaveEvent, currents: np.ndarray) -> float:
    """By how much calculated currents (3, N) still change from cycle to cycle before the record, a share of them.

    The rms of the last cycle of the lead less the one before it, over the rms of the last one; nan where the lead is
    shorter than two cycles. A cycle is no whole number of samples: the earlier one is read off a cubic spline.
    """
    from scipy.interpolate import CubicSpline

    cycle = event.rate / event.f0
    last = np.arange(event.lead - round(cycle), event.lead)
    if event.lead < 2 * cycle + 2:
        return float("nan")
    first = int(last[0] - cycle) - 2
    before = CubicSpline(np.arange(first, event.lead), currents[:, first : event.lead], axis=1)(last - cycle)
    late = event.of_phases(currents[:, last])
    return float(np.sqrt(np.mean((late - event.of_phases(before)) ** 2) / max(np.mean(late**2), 1e-30)))
