"""Least squares from several starts: the fastest way to the bottom of a smooth fit."""

from collections.abc import Iterator

import numpy as np

from tractexp.extend import REFUSED, Box, Evaluate, Optimizer, check_range, plugin
from tractexp.extend.search import LEAST_START_DISTANCE, best_distinct, race

CLOSER = 10  # scatters drawn ever closer about the least refused point before a search gives up


def latin_hypercube(n: int, d: int, rng: np.random.Generator) -> np.ndarray:
    """(n, d) points of the unit cube, each coordinate with one point in every n-th (McKay et al.
    1979).
    """
    cells = rng.permuted(np.tile(np.arange(n), (d, 1)), axis=1).T
    return (cells + rng.random((n, d))) / n


def toward_bounds(unit: np.ndarray) -> np.ndarray:
    """Uniform coordinates made dense near the bounds of the unit cube (arcsine distribution).

    Bounds of times and inertias span decades, and on a linear scale most of what they allow lies
    near the lower one.
    """
    return np.sin(np.pi * unit / 2) ** 2


@plugin
class MultistartLeastSquares(Optimizer):
    """A Latin hypercube, denser near the bounds, then bounded least squares from its best points
    that lie apart.

    Descents are brief, best start first; the lowest so far goes on to the end, the others only
    after all have begun. Candidates without a steady state are never started from. Where the whole
    scatter is refused, it is drawn again about its least refused point, half as wide. One iteration
    is the scatter or one descent.

    Source: Branch, Coleman and Li 1999 (SciPy's trust region reflective); McKay, Beckman and
    Conover 1979.
    Departures: each coordinate has the arcsine distribution, and descents race; the hypercube is
    our own, as importing scipy.stats for it takes longer than the search.
    """

    scatter: int = 100
    starts: int = 30
    trials: int = 100  # steps tried from one start
    tolerance: float = 1e-8  # relative change of objective, step or gradient that ends a start

    def check(self) -> None:
        super().check()
        check_range("optimizer.scatter", self.scatter, 1, 100_000)
        check_range("optimizer.starts", self.starts, 1, self.scatter)
        check_range("optimizer.trials", self.trials, 1)
        check_range("optimizer.tolerance", self.tolerance, 1e-15, 0.1)

    def search(self, evaluate: Evaluate, box: Box, rng: np.random.Generator) -> Iterator[None]:
        center, width = np.full(box.dimension, 0.5), 1.0
        x, f = np.empty((0, box.dimension)), np.empty(0)
        for _ in range(CLOSER):
            unit = latin_hypercube(self.scatter, box.dimension, rng)
            x, f = evaluate(box.from_unit(center + width * (toward_bounds(unit) - 0.5)))
            yield
            if f.min() < REFUSED:
                break
            center, width = box.to_unit(x[f.argmin()]), width / 2
        feasible = f < REFUSED
        x, f = x[feasible], f[feasible]
        chosen = best_distinct(box.to_unit(x), f, LEAST_START_DISTANCE, self.starts)
        yield from race(
            evaluate, box, zip(x[chosen], f[chosen], strict=True), self.tolerance, self.trials
        )
