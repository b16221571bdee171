"""A band of P and Q for a dip that a model has not seen, from what it missed of those that it has.

Of each channel half the band is the root of

    N² + (F m a)² + (1.96 s)²

N is the largest excursion that noise makes in so many samples; a the largest change of S that the
model calculates, as means over a cycle; m what it missed of the known events beyond their noise, at
worst, over their a (the root of the mean of squares over the events); F how far the next event may
exceed that; s the largest scatter of the calculated power by that of the parameters. What noise
adds to the worst of a known event is what it makes in every second one (the median); by as much as
it may make less, in 95 % of cases, the model may have missed more. That part, of K events less by
their root, is in m, and F does not multiply it.

Within a load the logarithm of m scatters from event to event by `EVENT_SPREAD`, the next event's
about that of K known ones by `EVENT_SPREAD` √(1 + 1/K). It was measured on loads that the benchmark
`next_dip` draws.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.domain import Playback
from tractexp.errors import UserError
from tractexp.inference.interval import INTERVAL_LEVEL, compute_interval_factor

EVENT_SPREAD = 0.45
SCATTER_STEP = 0.02  # standard errors by which the scatter of the calculated power is probed
MEDIAN = 0.5
NO_CHANGE = 1e-9  # pu: an event that changes S by less tells nothing of a share of it


@dataclass(frozen=True)
class PredictionBand:
    """What the width of the band hangs on.

    Attributes
    ----------
    noise : (P, Q) [pu]
        Standard deviations.
    share : (P, Q)
        What the model misses, of the largest change of S.
    events : int
        Number of events that this is known from.
    """

    noise: tuple[float, float]
    share: tuple[float, float]
    events: int

    def find_half_width(self, change: float, samples: int, scatter: np.ndarray) -> np.ndarray:
        """Half the band of P and of Q for an event.

        Parameters
        ----------
        change : float [pu]
            The largest change of S that is calculated.
        samples : int
            Number of samples from the dip on.
        scatter : (2,) [pu]
            Standard error of what is calculated, where it is largest.

        Returns
        -------
        (2,) array [pu]
        """
        noise = find_noise_peak(samples) * np.array(self.noise)
        model = _find_next_event_factor(self.events) * np.array(self.share) * change
        return np.sqrt(noise**2 + model**2 + (compute_interval_factor() * scatter) ** 2)


def measure_band(played: Sequence[Playback]) -> PredictionBand | None:
    """The band of a model, from what it missed of events.

    Parameters
    ----------
    played : sequence of Playback
        What it calculates of each event.

    Returns
    -------
    PredictionBand or None
        None where its motor stalls on one, or where none changes the load.
    """
    missed = []
    hidden = []
    noises = []
    for one in played:
        event = one.event
        record = one.event.record
        left = np.stack([one.P - record.P, one.Q - record.Q])
        calculated = one.P + 1j * one.Q - complex(event.P0, event.Q0)
        change = find_largest_change(calculated[event.start :], record.step, event.f0)
        if one.stalls or not np.isfinite(change):
            return None
        if change < NO_CHANGE:
            continue
        noise = np.nanstd(left[:, event.steady], axis=1)
        after = np.nan_to_num(left[:, event.start :])
        levels = (MEDIAN, 1 - INTERVAL_LEVEL)
        usual, least = ((find_noise_peak(after.shape[1], one) * noise) ** 2 for one in levels)
        missed.append((np.abs(after).max(axis=1) ** 2 - usual) / change**2)
        hidden.append((usual - least) / change**2)
        noises.append(noise)
    if not missed:
        return None
    events = len(missed)
    unknown = find_rms(hidden) / np.sqrt(events) / _find_next_event_factor(events) ** 2
    share = np.sqrt(np.maximum(np.mean(missed, axis=0), 0.0) + unknown).tolist()
    level = find_rms(noises).tolist()
    return PredictionBand((level[0], level[1]), (share[0], share[1]), events)


def find_rms(rows: Sequence[np.ndarray]) -> np.ndarray:
    """The root of the mean of squares of rows (K, n): (n,)."""
    return np.sqrt(np.mean(np.square(rows), axis=0))


def find_noise_peak(samples: int, level: float = INTERVAL_LEVEL) -> float:
    """The standard deviations that no sample of white noise exceeds in this share of cases.

    Examples
    --------
    >>> round(find_noise_peak(1), 2), round(find_noise_peak(1000), 2)
    (1.96, 4.05)
    """
    from scipy.special import ndtri

    return float(ndtri((1 + level ** (1 / max(samples, 1))) / 2))


def find_largest_change(change: np.ndarray, step: float, frequency: float) -> float:
    """The largest change of S, as means over a cycle.

    Decaying offsets of waveforms are no change of the load.

    Parameters
    ----------
    change : (N,) complex [pu]
        P + jQ less that before.
    step : float [s]
        Between samples.
    frequency : float [Hz]
        Of the network.

    Returns
    -------
    float [pu]

    Examples
    --------
    >>> find_largest_change(np.array([0.0, 0.1, 0.3, 0.1]), 0.01, 50.0)
    0.2
    """
    samples = min(max(1, round(1 / (frequency * step))), len(change))
    means = np.convolve(change, np.full(samples, 1 / samples), "valid")
    return float(np.abs(means).max())


def find_scatter(
    calculate: Callable[[np.ndarray], np.ndarray], values: np.ndarray, root: np.ndarray
) -> np.ndarray:
    """The largest standard error of calculated P and Q.

    Parameters
    ----------
    calculate : (d,) -> (2, N) [pu]
        P and Q for values of the parameters.
    values : (d,)
        The estimate.
    root : (k, d)
        Rows whose products add up to the covariance of the values. A row to neither side of which
        there is a steady state tells nothing.

    Returns
    -------
    (2,) array [pu]
    """
    here = calculate(values)
    squares = np.zeros_like(here)
    for row in root:
        for step in (SCATTER_STEP * row, -SCATTER_STEP * row):
            try:
                moved = calculate(values + step)
            except UserError:
                continue
            if np.isfinite(moved).all():
                squares += ((moved - here) / SCATTER_STEP) ** 2
                break
    return np.sqrt(squares.max(axis=1))


def _find_next_event_factor(events: int) -> float:
    """Factor by which the model misses more of the next event than of the known ones, at most in
    95 % of cases.
    """
    from scipy.special import ndtri

    return float(np.exp(ndtri(INTERVAL_LEVEL) * EVENT_SPREAD * np.sqrt(1 + 1 / events)))
