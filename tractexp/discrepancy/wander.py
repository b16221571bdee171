"""Slow wandering of the load: trains accelerate and others come and go while an event is recorded.

A random walk over an event is a sum of cosines whose amplitudes fall with the frequency (Karhunen and Loeve); their
prior is divided out of the residuals like the rest of the noise, so that no slow effect is named for it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.identify.noise import fit_autoregression

MODES = 32
SLOW = 3  # cosines of a stretch that belong to wandering before its fast noise is modelled
SEEN = 2.0  # of twice the log-likelihood, without which there is no wandering
LESS = 1.0  # of the log-likelihood: the intensity taken is the largest that is no less likely than this
GRID = np.concatenate(([0.0], np.geomspace(1e-3, 1e4, 71)))  # of the intensity, variances of the channel per second
STIFF = np.concatenate(([0.0], np.geomspace(1e-4, 1e12, 97)))  # of a single stretch, in variances of its noise


@dataclass(frozen=True, eq=False)
class Walk:
    """A stretch of white noise of unit variance and of modes of random amplitude, whose intensity is looked for."""

    values: np.ndarray  # (k,) singular values of the modes
    basis: np.ndarray  # (k, n)
    along: np.ndarray  # (k,) the stretch in this basis

    @classmethod
    def of(cls, stretch: np.ndarray, fixed: np.ndarray, modes: np.ndarray) -> "Walk":
        """A stretch (n,) with orthonormal rows `fixed` of any amplitude, and modes of unit intensity (k, n)."""
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
class Wander:
    """Random walks of two channels: `intensity` (2,) is the variance gained in a second."""

    intensity: np.ndarray
    step: float  # s

    def modes(self, channel: int, samples: int) -> np.ndarray:
        """Cosines (k, samples) scaled by the standard deviation of their amplitudes."""
        return np.sqrt(self.intensity[channel]) * _random_walk(samples, self.step, min(MODES, samples // 8))


def find(before: Sequence[np.ndarray], step: float) -> Wander | None:
    """The wandering of two channels in stretches (2, n_i) before the events; None where there is none to be seen.

    To be safe the largest intensity that is nearly as likely as the likeliest, given the fast noise; in both channels
    where it is seen in one, for what wanders is the load.
    """
    stretches = [b for b in before if b.shape[1] >= 8 * (SLOW + 2)]
    if not stretches:
        return None
    total = np.array([_likelihood([s[c] for s in stretches], step) for c in (0, 1)])
    total -= total[:, :1]
    if 2 * total.max() < SEEN:
        return None
    likely = total > total.max(axis=1, keepdims=True) - LESS
    return Wander(np.array([GRID[np.flatnonzero(row)[-1]] for row in likely]), step)


def without_slow(stretch: np.ndarray) -> np.ndarray:
    """A stretch (n,) without its mean and slowest cosines."""
    basis = np.vstack([np.ones(len(stretch)), cosines(len(stretch), SLOW)])
    basis /= np.linalg.norm(basis, axis=1, keepdims=True)
    return stretch - (stretch @ basis.T) @ basis


def without_drift(stretches: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Stretches (n_i,) without the slope that they share: a load that drifts does so in every event."""
    times = [np.arange(len(s)) - (len(s) - 1) / 2 for s in stretches]
    slope = sum(t @ s for t, s in zip(times, stretches, strict=True)) / sum(t @ t for t in times)
    return [s - slope * t for t, s in zip(times, stretches, strict=True)]


def cosines(samples: int, count: int) -> np.ndarray:
    """Half a wave over a stretch, a whole one, ...: (count, samples), each of length one."""
    angle = np.pi * np.arange(1, count + 1)[:, None] / samples * (np.arange(samples) + 0.5)
    return np.sqrt(2 / samples) * np.cos(angle)


def _random_walk(samples: int, step: float, count: int) -> np.ndarray:
    """Modes (count, samples) of a random walk that gains a variance of one in a second."""
    return np.sqrt(step) * samples / np.pi / np.arange(1, count + 1)[:, None] * cosines(samples, count)


def _likelihood(stretches: Sequence[np.ndarray], step: float) -> np.ndarray:
    """Logarithm of the likelihood of each intensity of the grid in stretches (n_i,) of one channel."""
    fast = fit_autoregression([without_slow(s) for s in stretches], sparing=True)
    stretches = without_drift(stretches)
    total = np.zeros(len(GRID))
    for stretch in stretches:
        n = len(stretch)
        rows = np.vstack([np.ones(n), stretch, _random_walk(n, step, min(MODES, n // 8))])
        one, x, *modes = fast.whiten(rows, np.ones(n, dtype=bool))
        one /= np.linalg.norm(one)
        total += Walk.of(x, one[None], np.array(modes)).likelihood(GRID)
    return total
