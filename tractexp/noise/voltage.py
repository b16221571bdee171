"""The voltage channel's own noise. The load never saw it, but a simulation driven by the record
does.

Where the voltage is smooth it is replaced by a cubic and cosines whose amplitudes fall with the
square of the frequency: a smoothing spline in other words, its stiffness the likeliest (Wahba
1990). Near the edges of a dip it is left as recorded. Either way something of the noise remains;
how much, and in which shapes, is known, and what they do to the calculated power is part of the
noise of a study. Left out of account they would do harm: whatever smooths the calculated power, or
wanders slowly, would seem to be there.
"""

from dataclasses import dataclass, replace

import numpy as np

from tractexp.noise.random_walk import Walk, compute_cosines
from tractexp.record import Event
from tractexp.record.change import find_runs

HALF_WIDTHS = (1, 2, 3, 5, 8)  # samples of the averages that must agree where the voltage is smooth
AGREE = 2.5  # standard deviations within which they do
EDGE_MARGIN = 3  # samples beside an edge that are not smooth
# standard deviations of an average that smoothing may leave, and beside an edge
BOUND, BESIDE = 4.0, 3.0
SHORTEST_SMOOTHED_STRETCH = 24  # samples of a stretch worth smoothing
DEGREE, COSINES = 3, 32  # of the curve through a smooth stretch
# samples as recorded whose errors are followed up, the nearest to the dip: each costs a simulation
MOST_FOLLOWED_SAMPLES = 400
# intensities of a curve that are tried, in variances of a stretch's noise
STIFF = np.concatenate(([0.0], np.geomspace(1e-4, 1e12, 97)))
LEAST_NOISE_SHARE = 0.01  # share of a direction's noise: less of it is left out
SILENT = 1e-5  # pu: less noise than this is none


@dataclass(frozen=True, eq=False)
class SmoothedEvent:
    """An event with a smooth voltage, and what may still be wrong with it.

    Attributes
    ----------
    event : Event
        Its voltage smooth.
    errors : (k, N) [pu]
        Independent shapes of what may be wrong, each of one standard deviation.
    """

    event: Event
    errors: np.ndarray

    def off_by(self, shape: int) -> Event:
        """The event with one of the errors added to its voltage; without where there are fewer."""
        if shape >= len(self.errors):
            return self.event
        record = self.event.record
        return replace(self.event, record=replace(record, U=record.U + self.errors[shape]))


def smooth_voltage(event: Event) -> SmoothedEvent:
    """Take the noise of the voltage out of one event.

    Where the voltage is smooth a curve is put in its place, near the edges of the dip it is left as
    recorded.

    Parameters
    ----------
    event : Event
        As recorded.

    Returns
    -------
    SmoothedEvent
        With no errors where the voltage has less than `SILENT` [pu] of noise.
    """
    U = event.record.U
    deviation = estimate_voltage_noise(event.record.U[event.steady])
    if deviation < SILENT:
        return SmoothedEvent(event, np.empty((0, len(U))))
    rough = _find_edges(U, deviation)
    rough[[event.start, min(event.end, len(U) - 1)]] = True
    rough = _widen_rough_stretches(rough)
    while True:
        smooth = U.copy()
        errors = []
        for part in find_runs(~rough):
            curve, own = _fit_curve(U[part], deviation)
            smooth[part] = curve
            errors.append(np.zeros((len(own), len(U))))
            errors[-1][:, part] = own
        far = (
            _measure_distance(U - smooth, deviation)
            / np.where(_widen_rough_stretches(rough), BESIDE, BOUND)
            * ~rough
        )
        if far.max() < 1:
            break
        rough[far.argmax()] = True
        rough = _widen_rough_stretches(rough)
    raw = np.flatnonzero(rough)
    apart = np.maximum(event.start - raw, 0) + np.maximum(raw - event.end, 0)
    raw = raw[np.argsort(apart, kind="stable")[:MOST_FOLLOWED_SAMPLES]]
    errors.append(deviation * (np.arange(len(U)) == raw[:, None]))
    return SmoothedEvent(
        replace(event, record=replace(event.record, U=smooth)), np.concatenate(errors)
    )


def estimate_voltage_noise(U: np.ndarray) -> float:
    """The standard deviation [pu] of white noise on a smooth voltage (n,), from its third
    differences.

    Examples
    --------
    >>> t = np.linspace(0, 1, 2000)
    >>> noise = 0.001 * np.random.default_rng(1).standard_normal(len(t))
    >>> round(estimate_voltage_noise(1 - 0.2 * t**2 + noise), 4)
    0.001
    """
    third = np.diff(U, 3)
    return float(np.median(np.abs(third)) / 0.6745 / np.sqrt(20)) if len(third) else 0.0


def _find_edges(U: np.ndarray, deviation: float) -> np.ndarray:
    """Where the voltage (N,) moves faster than averages can follow."""
    index = np.arange(len(U))
    sums = np.concatenate(([0.0], np.cumsum(U)))
    low = U - AGREE * deviation
    high = U + AGREE * deviation
    for half in HALF_WIDTHS:
        # symmetric at the ends too, or a slope would bend
        h = np.minimum(half, np.minimum(index, index[::-1]))
        mean = (sums[index + h + 1] - sums[index - h]) / (2 * h + 1)
        reach = AGREE * deviation / np.sqrt(2 * h + 1)
        low = np.maximum(low, mean - reach)
        high = np.minimum(high, mean + reach)
    return low > high


def _widen_rough_stretches(rough: np.ndarray) -> np.ndarray:
    """Rough samples with those beside them, and the stretches between them that are too short to be
    smoothed.
    """
    wide = np.convolve(rough, np.ones(2 * EDGE_MARGIN + 1), "same") > 0.5
    for part in find_runs(~wide):
        if part.stop - part.start < SHORTEST_SMOOTHED_STRETCH:
            wide[part] = True
    return wide


def _measure_distance(left: np.ndarray, deviation: float) -> np.ndarray:
    """How far the worst average around each sample of what is left (N,) is from zero, in standard
    deviations.
    """
    far = np.abs(left)
    for half in HALF_WIDTHS:
        window = np.ones(2 * half + 1) / np.sqrt(2 * half + 1)
        far = np.maximum(far, np.abs(np.convolve(left, window, "same")))
    return far / deviation


def _fit_curve(U: np.ndarray, deviation: float) -> tuple[np.ndarray, np.ndarray]:
    """The likeliest curve through a stretch (n,), and its errors (k, n) of one standard deviation
    each.
    """
    n = len(U)
    fixed = np.linalg.qr(np.polynomial.legendre.legvander(np.linspace(-1, 1, n), DEGREE))[0].T
    count = min(COSINES, n // 8)
    walk = Walk.from_stretch(
        U / deviation, fixed, compute_cosines(n, count) / np.arange(1, count + 1)[:, None] ** 2
    )
    share = walk.share(float(STIFF[walk.likelihood(STIFF).argmax()]))
    curve = (U @ fixed.T) @ fixed + deviation * ((walk.along * share) @ walk.basis)
    seen = share > LEAST_NOISE_SHARE
    return curve, deviation * np.concatenate([fixed, np.sqrt(share[seen, None]) * walk.basis[seen]])
