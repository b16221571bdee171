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
from tractexp.noise.span import compute_basis
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
# of a single stretch, in variances of its noise
STIFF = np.concatenate(([0.0], np.geomspace(1e-4, 1e12, 97)))


@dataclass(frozen=True, eq=False)
class Walk:
    """A stretch of white noise of unit variance and of modes of random amplitude, whose intensity
    is looked for.
    """

    values: np.ndarray  # (k,) singular values of the modes
    basis: np.ndarray  # (k, n)
    along: np.ndarray  # (k,) the stretch in this basis

    @classmethod
    def from_stretch(cls, stretch: np.ndarray, fixed: np.ndarray, modes: np.ndarray) -> "Walk":
        """A stretch (n,) with orthonormal rows `fixed` of any amplitude, and modes of unit
        intensity (k, n).
        """
        _, values, basis = np.linalg.svd(modes - (modes @ fixed.T) @ fixed, full_matrices=False)
        return cls(values, basis, basis @ (stretch - (stretch @ fixed.T) @ fixed))

    def likelihood(self, grid: np.ndarray) -> np.ndarray:
        """Logarithm of the likelihood of each intensity, up to a constant."""
        spread = 1 + np.outer(grid, self.values**2)
        return -(np.log(spread) + self.along**2 / spread).sum(axis=1) / 2

    @property
    def likeliest(self) -> float:
        """The intensity of most likelihood, on a wide grid."""
        return float(STIFF[self.likelihood(STIFF).argmax()])

    def share(self, intensity: float) -> np.ndarray:
        """Share (k,) of each direction that is mode and not noise."""
        power = intensity * self.values**2
        return power / (1 + power)


@dataclass(frozen=True, eq=False)
class Load:
    """Active and reactive power of events end to end, over the apparent power before each."""

    power: np.ndarray  # (2, N)
    before: np.ndarray  # (E, 2)

    @classmethod
    def from_powers(cls, measured: np.ndarray, before: np.ndarray, first: np.ndarray) -> "Load":
        """Of P and Q (2, N) with means `before` (E, 2); events begin at `first` (E + 1,)."""
        level = np.maximum(np.linalg.norm(before, axis=1), 1e-9)
        return cls(
            np.nan_to_num(measured) / np.repeat(level, np.diff(first)), before / level[:, None]
        )

    @functools.cached_property
    def apparent(self) -> np.ndarray:
        """Apparent power (N,)."""
        return np.linalg.norm(self.power, axis=0)


@dataclass(frozen=True, eq=False)
class RandomWalk:
    """Random walks of two mixed channels: `intensity` (2,) is the variance gained in a second
    before an event.

    What wanders are customers, whose active and reactive power go together, in a dip and after it,
    too: what the first channel does the second follows as the load's power says. Beside that the
    second wanders by itself.
    """

    intensity: np.ndarray
    step: float  # s
    load: Load

    def modes(self, event: int, part: slice, mix: np.ndarray) -> np.ndarray:
        """Cosines (2 k, 2, samples) of one event, scaled by the standard deviation of their
        amplitudes.
        """
        n = part.stop - part.start
        walk = _random_walk(n, self.step, min(MODES, n // 8))
        level, power = mix @ self.load.before[event], mix @ self.load.power[:, part]
        whole = max(abs(level[0]), LEAST_LEVEL_SHARE * float(np.linalg.norm(level)))
        together = np.sqrt(self.intensity[0]) / whole * walk[:, None] * power
        apart = np.sqrt(self.intensity[1]) * walk * self.load.apparent[part]
        return np.concatenate([together, np.stack([np.zeros_like(apart), apart], axis=1)])


@dataclass(frozen=True, eq=False)
class Rest:
    """What a fit leaves of an event (2, n), and all that something known could still explain (k, 2,
    n).
    """

    left: np.ndarray
    columns: np.ndarray
    profile: np.ndarray  # (n,) power over that before


def find(
    before: Sequence[np.ndarray],
    step: float,
    load: Load,
    rests: Sequence[Rest] = (),
) -> RandomWalk | None:
    """The wandering of two channels in stretches (2, n_i) before the events; None where there is
    none to be seen.

    To be safe the largest intensity whose log-likelihood is at most `LESS` below the likeliest's,
    given the fast noise; in both channels where it is seen in one, for what wanders is the load. It
    is seen where twice the log-likelihood gains `LEAST_WANDERING`. What is left of the events
    counts, too, where both show twice that, but no more than the stretches before them allow: what
    answers a dip does not wander.
    """
    stretches = [b for b in before if b.shape[1] >= 8 * (WANDERING_COSINES + 2)]
    if not stretches:
        return None
    fast = [
        fit_autoregression([without_slow(s[c]) for s in stretches], sparing=True) for c in (0, 1)
    ]
    total = np.array([_likelihood([s[c] for s in stretches], fast[c], step) for c in (0, 1)])
    total -= total[:, :1]
    most = [_last(row) for row in total]
    walk = RandomWalk(GRID[most], step, load)
    if 2 * total.max() >= LEAST_WANDERING:
        return walk
    rest = np.array(
        [sum(_within(r, c, fast[c], step) for r in rests) * np.ones(len(GRID)) for c in (0, 1)]
    )
    both = total + rest - rest[:, :1]
    gained = max(2 * row[: last + 1].max() for row, last in zip(both, most, strict=True))
    return walk if gained >= 2 * LEAST_WANDERING else None


def walk_of_load(
    events: Sequence[Event],
    drive: Drive,
    load: Load,
    left: np.ndarray | None,
    columns: np.ndarray | None,
    valid: np.ndarray,
    mix: np.ndarray,
) -> RandomWalk | None:
    """How the load wanders before the events, and during them, in channels mixed by `mix`, as
    `find` tells it.

    What a fit leaves (C, N) counts where it is there with all columns that could explain it (k, C,
    N) and has no gap.
    """
    parts = [drive.part(e) for e in range(drive.events)]
    before = [
        drive.measurements[:, part][:, event.steady]
        for part, event in zip(parts, events, strict=True)
    ]
    rests = []
    if left is not None and columns is not None and valid.all():
        mixed = np.einsum("ij,kjt->kit", mix, columns)
        rests = [
            Rest(mix @ left[:, part], mixed[:, :, part], load.apparent[part]) for part in parts
        ]
    stretches = [mix @ b for b in before if np.isfinite(b).all()]
    return find(stretches, events[0].record.step, load, rests)


def _last(likelihood: np.ndarray) -> int:
    """Index of the last of the intensities that are less likely than the likeliest by no more than
    `LESS`.
    """
    return int(np.flatnonzero(likelihood > likelihood.max() - LESS)[-1])


def without_slow(stretch: np.ndarray) -> np.ndarray:
    """A stretch (n,) without its mean and slowest cosines."""
    basis = np.vstack([np.ones(len(stretch)), cosines(len(stretch), WANDERING_COSINES)])
    basis /= np.linalg.norm(basis, axis=1, keepdims=True)
    return stretch - (stretch @ basis.T) @ basis


def without_drift(stretches: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Stretches (n_i,) without the slope that they share: a load that drifts does so in every
    event.
    """
    times = [np.arange(len(s)) - (len(s) - 1) / 2 for s in stretches]
    slope = sum(t @ s for t, s in zip(times, stretches, strict=True)) / sum(t @ t for t in times)
    return [s - slope * t for t, s in zip(times, stretches, strict=True)]


def cosines(samples: int, count: int) -> np.ndarray:
    """Half a wave over a stretch, a whole one, ...: (count, samples), each of length one."""
    angle = np.pi * np.arange(1, count + 1)[:, None] / samples * (np.arange(samples) + 0.5)
    return np.sqrt(2 / samples) * np.cos(angle)


def _random_walk(samples: int, step: float, count: int) -> np.ndarray:
    """Modes (count, samples) of a random walk that gains a variance of one in a second."""
    return (
        np.sqrt(step) * samples / np.pi / np.arange(1, count + 1)[:, None] * cosines(samples, count)
    )


def _likelihood(stretches: Sequence[np.ndarray], fast: Autoregression, step: float) -> np.ndarray:
    """Logarithm of the likelihood of each intensity of the grid in stretches (n_i,) of
    one channel.
    """
    total = np.zeros(len(GRID))
    for stretch in without_drift(stretches):
        total += _compute_log_likelihood(stretch, np.ones((1, len(stretch))), fast, step)
    return total


def _within(rest: Rest, channel: int, fast: Autoregression, step: float) -> np.ndarray:
    """The same of what is left of one event, whatever its columns explain left out."""
    columns = rest.columns[:, channel]
    columns = columns[np.linalg.norm(columns, axis=1) > 0]
    fixed = np.vstack([np.ones(columns.shape[1]), columns])
    return _compute_log_likelihood(rest.left[channel], fixed, fast, step, rest.profile)


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
    modes = _random_walk(n, step, min(MODES, n // 8)) * profile
    rows = fast.whiten(np.vstack([columns, stretch, modes]), np.ones(n, dtype=bool))
    return Walk.from_stretch(
        rows[k], compute_basis(rows[:k], LEAST_DIRECTION_SHARE), rows[k + 1 :]
    ).likelihood(GRID)
