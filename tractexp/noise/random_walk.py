"""Slow wandering of the load: trains accelerate and others come and go while an event is recorded.

A random walk over an event is a sum of cosines whose amplitudes fall with the frequency (Karhunen
and Loeve); their prior is divided out of the residuals like the rest of the noise, so that no slow
effect is named for it.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.model.drive import Drive
from tractexp.noise.color import Autoregression, fit_autoregression
from tractexp.noise.span import compute_basis, project_out
from tractexp.record import Event

MODES = 48
# of the level of a load in both channels: one that has less of the first does not wander by it
LEAST_LEVEL_SHARE = 0.3
# cosines of a stretch that belong to wandering before its fast noise is modelled
WANDERING_COSINES = 3
# of the strongest direction: columns that differ by less from others are none of their own
LEAST_DIRECTION_SHARE = 0.03
# log-likelihood below the largest at which the intensity is taken: the larger end of an interval of
# 84 %
LESS = 1.0
# Twice the log-likelihood from which a load is said to wander before its events, and twice that by
# what the events show. Half a chi-square of one degree is beyond it in 8 % of channels. One that is
# not there costs an estimate a third of its precision; one that is not seen costs a wrong name, or
# an interval without the truth.
LEAST_WANDERING = 2.0
# of the intensity, variances of the channel per second
GRID = np.concatenate(([0.0], np.geomspace(1e-3, 1e4, 71)))
EventRest = tuple[np.ndarray, np.ndarray, np.ndarray]  # as of `find`


@dataclass(frozen=True, eq=False)
class Walk:
    """A stretch that is white noise of unit variance and modes of random amplitude.

    Attributes
    ----------
    values : (k,)
        Singular values of the modes.
    basis : (k, n)
        Their orthonormal directions.
    along : (k,)
        The stretch in this basis.
    """

    values: np.ndarray  # (k,) singular values of the modes
    basis: np.ndarray  # (k, n)
    along: np.ndarray  # (k,) the stretch in this basis

    @classmethod
    def from_stretch(cls, stretch: np.ndarray, fixed: np.ndarray, modes: np.ndarray) -> "Walk":
        """The walk of one stretch.

        Parameters
        ----------
        stretch : (n,)
            Whitened samples.
        fixed : (m, n)
            Orthonormal rows of any amplitude, such as a mean: they tell nothing.
        modes : (k, n)
            Modes of unit intensity.

        Returns
        -------
        Walk
        """
        _, values, basis = np.linalg.svd(project_out(modes, fixed), full_matrices=False)
        return cls(values, basis, basis @ project_out(stretch, fixed))

    def likelihood(self, grid: np.ndarray) -> np.ndarray:
        """The logarithm of the likelihood of each intensity of a grid (g,), up to a constant."""
        spread = 1 + np.outer(grid, self.values**2)
        return -(np.log(spread) + self.along**2 / spread).sum(axis=1) / 2

    def share(self, intensity: float) -> np.ndarray:
        """The share (k,) of each direction's variance that is mode and not noise.

        Examples
        --------
        >>> walk = Walk(np.array([1.0, 3.0]), np.eye(2), np.zeros(2))
        >>> walk.share(1.0).tolist()
        [0.5, 0.9]
        """
        power = intensity * self.values**2
        return power / (1 + power)


@dataclass(frozen=True, eq=False)
class Load:
    """The active and reactive power of events, over the apparent power before each.

    Attributes
    ----------
    power : (2, N)
        P and Q, events end to end.
    before : (E, 2)
        Their means before each event.
    """

    power: np.ndarray  # (2, N)
    before: np.ndarray  # (E, 2)

    @classmethod
    def from_powers(cls, measured: np.ndarray, before: np.ndarray, first: np.ndarray) -> "Load":
        """The load of measured powers.

        Parameters
        ----------
        measured : (2, N) [pu]
            P and Q, events end to end; gaps count as 0.
        before : (E, 2) [pu]
            Their means before each event.
        first : (E + 1,) ints
            The first sample of each event, and the end.

        Returns
        -------
        Load

        Examples
        --------
        >>> P, Q = [0.6, 0.3], [0.8, 0.4]
        >>> load = Load.from_powers(np.array([P, Q]), np.array([[0.6, 0.8]]), np.array([0, 2]))
        >>> load.apparent.tolist()
        [1.0, 0.5]
        """
        level = np.maximum(np.linalg.norm(before, axis=1), 1e-9)
        return cls(
            np.nan_to_num(measured) / np.repeat(level, np.diff(first)), before / level[:, None]
        )

    @functools.cached_property
    def apparent(self) -> np.ndarray:
        """The apparent power (N,), over that before each event."""
        return np.linalg.norm(self.power, axis=0)


@dataclass(frozen=True, eq=False)
class RandomWalk:
    """Random walks of two mixed channels.

    What wanders are customers, whose active and reactive power go together, in a dip and after it,
    too: what the first channel does the second follows as the load's power says. Beside that the
    second wanders by itself.

    Attributes
    ----------
    intensity : (2,)
        Variance that each gains in a second before an event.
    step : float [s]
        Between samples.
    load : Load
        The power by which the wandering goes.
    """

    intensity: np.ndarray
    step: float  # s
    load: Load

    def modes(self, event: int, part: slice, mix: np.ndarray) -> np.ndarray:
        """The modes of the walk in one event.

        Parameters
        ----------
        event : int
            Its number, from 0.
        part : slice
            Its samples.
        mix : (2, 2)
            What makes the channels independent.

        Returns
        -------
        (2 k, 2, samples) array
            Cosines, scaled by the standard deviation of their amplitudes.
        """
        n = part.stop - part.start
        walk = _compute_walk_modes(n, self.step, min(MODES, n // 8))
        level, power = mix @ self.load.before[event], mix @ self.load.power[:, part]
        whole = max(abs(level[0]), LEAST_LEVEL_SHARE * float(np.linalg.norm(level)))
        together = np.sqrt(self.intensity[0]) / whole * walk[:, None] * power
        apart = np.sqrt(self.intensity[1]) * walk * self.load.apparent[part]
        return np.concatenate([together, np.stack([np.zeros_like(apart), apart], axis=1)])


def find(
    before: Sequence[np.ndarray],
    step: float,
    load: Load,
    rests: Sequence[EventRest] = (),
) -> RandomWalk | None:
    """The wandering of two channels before some events.

    To be safe the intensity is the largest whose log-likelihood is at most `LESS` below the
    likeliest's, given the fast noise; in both channels where it is seen in one, for what wanders is
    the load. What is left of the events counts, too, where both show twice as much, but no more
    than the stretches before them allow: what answers a dip does not wander.

    Parameters
    ----------
    before : sequence of (2, n_i) arrays
        Stretches of the mixed channels before the events.
    step : float [s]
        Between samples.
    load : Load
        The power of the events.
    rests : sequence of (left, columns, profile)
        What a fit leaves of the mixed channels in each event (2, n), changes that something known
        could make (k, 2, n), and the apparent power over that before (n,).

    Returns
    -------
    RandomWalk or None
        None where no wandering is seen.
    """
    stretches = [b for b in before if b.shape[1] >= 8 * (WANDERING_COSINES + 2)]
    if not stretches:
        return None
    fast = [
        fit_autoregression([remove_slow(s[c]) for s in stretches], sparing=True) for c in (0, 1)
    ]
    total = np.array(
        [_compute_likelihoods([s[c] for s in stretches], fast[c], step) for c in (0, 1)]
    )
    total -= total[:, :1]
    most = [_find_last(row) for row in total]
    walk = RandomWalk(GRID[most], step, load)
    if 2 * total.max() >= LEAST_WANDERING:
        return walk
    rest = np.array(
        [
            sum(_compute_rest_likelihoods(r, c, fast[c], step) for r in rests) * np.ones(len(GRID))
            for c in (0, 1)
        ]
    )
    both = total + rest - rest[:, :1]
    gained = max(2 * row[: last + 1].max() for row, last in zip(both, most, strict=True))
    return walk if gained >= 2 * LEAST_WANDERING else None


def find_load_walk(
    events: Sequence[Event],
    drive: Drive,
    load: Load,
    left: np.ndarray | None,
    columns: np.ndarray | None,
    valid: np.ndarray,
    mix: np.ndarray,
) -> RandomWalk | None:
    """The wandering of the load before and during its events, as `find` tells it.

    Parameters
    ----------
    events : sequence of Event
        The E events of the drive.
    drive : Drive
        Their measurements (C, N).
    load : Load
        Their power.
    left : (C, N) [pu] or None
        What a fit leaves; it counts with all `columns` and where there is no gap.
    columns : (k, C, N) [pu] or None
        What could explain it.
    valid : (C, N) bools
        Which samples count.
    mix : (C, C)
        What makes the channels independent.

    Returns
    -------
    RandomWalk or None
    """
    parts = drive.parts
    before = [
        drive.measurements[:, part][:, event.steady]
        for part, event in zip(parts, events, strict=True)
    ]
    rests = []
    if left is not None and columns is not None and valid.all():
        mixed = np.einsum("ij,kjt->kit", mix, columns)
        rests = [(mix @ left[:, part], mixed[:, :, part], load.apparent[part]) for part in parts]
    stretches = [mix @ b for b in before if np.isfinite(b).all()]
    return find(stretches, events[0].record.step, load, rests)


def _find_last(likelihood: np.ndarray) -> int:
    """The position of the largest intensity whose log-likelihood is within `LESS` of the
    largest.
    """
    return int(np.flatnonzero(likelihood > likelihood.max() - LESS)[-1])


def remove_slow(stretch: np.ndarray) -> np.ndarray:
    """A stretch (n,) without its mean and its three slowest cosines."""
    basis = np.vstack([np.ones(len(stretch)), compute_cosines(len(stretch), WANDERING_COSINES)])
    basis /= np.linalg.norm(basis, axis=1, keepdims=True)
    return project_out(stretch, basis)


def remove_drift(stretches: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Stretches (n_i,) without the slope that they share: a load that drifts does so in every
    event.

    Examples
    --------
    >>> [left.round(6).tolist() for left in remove_drift([np.array([1.0, 2.0, 3.0])])]
    [[2.0, 2.0, 2.0]]
    """
    times = [np.arange(len(s)) - (len(s) - 1) / 2 for s in stretches]
    slope = sum(t @ s for t, s in zip(times, stretches, strict=True)) / sum(t @ t for t in times)
    return [s - slope * t for t, s in zip(times, stretches, strict=True)]


def compute_cosines(samples: int, count: int) -> np.ndarray:
    """Cosines of half a wave over a stretch, a whole one, and so on.

    Parameters
    ----------
    samples, count : int
        Length of the stretch, and how many cosines.

    Returns
    -------
    (count, samples) array
        Orthonormal rows.

    Examples
    --------
    >>> rows = compute_cosines(50, 3)
    >>> np.allclose(rows @ rows.T, np.eye(3))
    True
    """
    angle = np.pi * np.arange(1, count + 1)[:, None] / samples * (np.arange(samples) + 0.5)
    return np.sqrt(2 / samples) * np.cos(angle)


def _compute_walk_modes(samples: int, step: float, count: int) -> np.ndarray:
    """Modes (count, samples) of a random walk that gains a variance of one in a second."""
    return (
        np.sqrt(step)
        * samples
        / np.pi
        / np.arange(1, count + 1)[:, None]
        * compute_cosines(samples, count)
    )


def _compute_likelihoods(
    stretches: Sequence[np.ndarray], fast: Autoregression, step: float
) -> np.ndarray:
    """Logarithm of the likelihood of each intensity of the grid in stretches (n_i,) of
    one channel.
    """
    total = np.zeros(len(GRID))
    for stretch in remove_drift(stretches):
        total += _compute_log_likelihood(stretch, np.ones((1, len(stretch))), fast, step)
    return total


def _compute_rest_likelihoods(
    rest: EventRest, channel: int, fast: Autoregression, step: float
) -> np.ndarray:
    """The logarithm of the likelihood of each intensity of the grid in what is left of one event,
    without what its columns explain.
    """
    left, known, profile = rest
    columns = known[:, channel]
    columns = columns[np.linalg.norm(columns, axis=1) > 0]
    fixed = np.vstack([np.ones(columns.shape[1]), columns])
    return _compute_log_likelihood(left[channel], fixed, fast, step, profile)


def _compute_log_likelihood(
    stretch: np.ndarray,
    columns: np.ndarray,
    fast: Autoregression,
    step: float,
    profile: np.ndarray | float = 1.0,
) -> np.ndarray:
    """Logarithm of the likelihood of each intensity in a stretch (n,) with columns (k, n) of any
    amplitude.
    """
    n, k = len(stretch), len(columns)
    modes = _compute_walk_modes(n, step, min(MODES, n // 8)) * profile
    rows = fast.whiten(np.vstack([columns, stretch, modes]), np.ones(n, dtype=bool))
    return Walk.from_stretch(
        rows[k], compute_basis(rows[:k], LEAST_DIRECTION_SHARE), rows[k + 1 :]
    ).likelihood(GRID)
