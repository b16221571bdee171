"""COBYQA, SciPy's derivative-free trust region, from several starts."""

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from tractexp.extend import REFUSED, Box, Evaluate, Iterative, check_range, plugin
from tractexp.extend.search import best_distinct

APART = 0.3  # of the box, in the coordinate in which two starts differ most


@plugin
class COBYQA(Iterative):
    """Quadratic models of the objective, in a trust region within the bounds, from the best points
    of a scatter.

    A model m(x) = c + g'x + x'Hx/2 passes through 2 d + 1 points, with the least change of H since
    the last one; a step goes to its minimum in |x - x_best| <= Delta within the bounds, one
    simulation; Delta grows where the model was right and shrinks where not, and a descent ends once
    it is below `precision`. An iteration is one descent. When the starts of a scatter are used up,
    another is drawn.

    Source: Ragonneau 2022, "Model-based derivative-free optimization methods and software", as
    scipy.optimize.minimize(method="COBYQA"); uniform scatter and starts are our own.
    Departures: objectives of refused candidates are lowered to the worst of the scatter, as a
    parabola through 1e12 is no model of its neighborhood. It evaluates one point at a time and
    itself takes about a millisecond for each.
    """

    usual: ClassVar[int] = 10  # descents
    scatter: int = 100
    radius: float = 0.1  # first trust region, of the box's width
    precision: float = 1e-7  # last trust region, of the box's width

    def check(self) -> None:
        super().check()
        check_range("optimizer.scatter", self.scatter, 1, 100_000)
        check_range("optimizer.radius", self.radius, 1e-6, 0.5)
        check_range("optimizer.precision", self.precision, 1e-15, self.radius)

    def search(self, evaluate: Evaluate, box: Box, rng: np.random.Generator) -> Iterator[None]:
        starts: list[np.ndarray] = []
        ceiling = np.inf
        _, steps = self.laid_out(evaluate.budget, self.scatter, self.scatter)
        for _ in steps:
            if not starts:
                x, f = evaluate(box.uniform(rng, self.scatter))
                yield
                able = f < max(REFUSED, np.nextafter(f.min(), np.inf))
                unit, f = box.to_unit(x[able]), f[able]
                starts, ceiling = list(unit[best_distinct(unit, f, APART, self.scatter)]), f.max()
            self._descend(evaluate, box, starts.pop(0), ceiling)
            yield

    def _descend(self, evaluate: Evaluate, box: Box, start: np.ndarray, ceiling: float) -> None:
        """One descent in the unit cube, from `start` (d,)."""
        from scipy.optimize import minimize

        minimize(
            lambda unit: min(float(evaluate(box.from_unit(unit[None]))[1][0]), ceiling),
            start,
            method="COBYQA",
            bounds=[(0.0, 1.0)] * box.dimension,
            options={
                "initial_tr_radius": self.radius,
                "final_tr_radius": self.precision,
                "maxfev": 10**9,
                "maxiter": 10**9,
            },
        )
