"""A sparrow search that steps by the flock's own spread: not drawn to zero, and at home in turned
valleys.
"""

from collections.abc import Iterator

import numpy as np

from tractexp.extend import Box, Evaluate, Iterative, check_range, plugin

from ._sparrow import Flock

# relative spread of the objectives of a flock that has nothing left to compare
FLAT_OBJECTIVE = 1e-12


def differences(x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """For each sparrow of x (n, d) the way from one sparrow to another, both drawn, never the same
    one twice.
    """
    n = len(x)
    one = rng.integers(0, n, n)
    return x[one] - x[(one + rng.integers(1, n, n)) % n]


def draw_varied_points(
    best: np.ndarray, better: np.ndarray, k: int, rng: np.random.Generator
) -> np.ndarray:
    """(k, d) normal numbers about `best` with the covariance of the sparrows `better` (h, d)."""
    spread = (better - better.mean(axis=0)) / np.sqrt(len(better))
    return best + rng.standard_normal((k, len(better))) @ spread


def mix_coordinates(
    x: np.ndarray, proposed: np.ndarray, share: float, rng: np.random.Generator
) -> np.ndarray:
    """x (n, d) with about a share of its coordinates from `proposed`, at least one of
    each sparrow.
    """
    taken = rng.random(x.shape) < share
    taken[np.arange(len(x)), rng.integers(0, x.shape[1], len(x))] = True
    return np.where(taken, proposed, x)


@plugin
class CovariantSparrow(Iterative):
    """Producers, scroungers and perceivers, stepping by differences and the covariance of the
    flock.

    Ranks i = 1 ... n, best first; D = x_a - x_b of two sparrows and a producer X_P are drawn for
    each; Q, N ~ N(0, 1):

        producers                   x + Q D
        scroungers, i <= n/2        x + F (X_P - x) + F D
        scroungers, i > n/2         X_P + F D
        perceivers, drawn anew      X_best + sum_k N_k (x_k - mean) / sqrt(n/2),
        over the better half

    A sparrow takes each coordinate of its new position with the probability `mixing`, and moves
    only to improve. Once the flock is narrower than `collapse` or its objectives are all the same,
    another flock is drawn.

    Source: the roles of the traction load paper, Eqs. (11)-(13) and (17); differences and mixing of
    Storn and Price 1997, those toward one of the best of Zhang and Sanderson 2009, Eq. (6).
    Departures: Eqs. (11)-(13) step by |x - X_best|, coordinate by coordinate, shrink toward zero
    and land near the diagonal; here each step is a way between sparrows, so that the search is the
    same wherever the box lies, and as narrow and as turned as the valley. The Gaussian variation
    has the covariance of the better half; the Levy flight and the tent map are left out. A sparrow
    is simulated once in an iteration.
    """

    population: int = 30
    producers: float = 0.2  # share of the population, the best
    perceivers: float = 0.2  # share of the population
    factor: float = 0.6  # F
    mixing: float = 0.8
    collapse: float = 1e-6  # of the box's width

    def check(self) -> None:
        super().check()
        check_range("optimizer.population", self.population, 4, 100_000)
        check_range("optimizer.producers", self.producers, 0, 1)
        check_range("optimizer.perceivers", self.perceivers, 0, 1)
        check_range("optimizer.factor", self.factor, 0, 2)
        check_range("optimizer.mixing", self.mixing, 0, 1)
        check_range("optimizer.collapse", self.collapse, 0, 1)

    def search(self, evaluate: Evaluate, box: Box, rng: np.random.Generator) -> Iterator[None]:
        flock = Flock(box.uniform(rng, self.population), evaluate, better_only=True)
        _, steps = self.laid_out(evaluate.budget, self.population, self.population)
        yield
        for _ in steps:
            if self._has_collapsed(flock, box):
                flock = Flock(box.uniform(rng, self.population), evaluate, better_only=True)
            else:
                flock.sort()
                flock.move(np.arange(self.population), self._propose_points(flock.x, rng))
            yield

    def _propose_points(self, x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Where the sparrows x (n, d), best first, would go."""
        n, p, half = len(x), max(1, round(self.producers * len(x))), len(x) // 2
        way, leader = differences(x, rng), x[rng.integers(0, p, n)]
        new = x + self.factor * (leader - x + way)
        new[half:] = leader[half:] + self.factor * way[half:]
        new[:p] = x[:p] + rng.standard_normal((p, 1)) * way[:p]
        watch = rng.permutation(n)[: round(self.perceivers * n)]
        new[watch] = draw_varied_points(x[0], x[:half], len(watch), rng)
        return mix_coordinates(x, new, self.mixing, rng)

    def _has_collapsed(self, flock: Flock, box: Box) -> bool:
        narrow = (np.ptp(flock.x, axis=0) <= self.collapse * box.width).all()
        return bool(narrow or np.ptp(flock.f) <= FLAT_OBJECTIVE * np.abs(flock.f).max())
