"""CMA-ES, pycma's, with restarts."""

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from tractexp.extend import Box, Evaluate, Iterative, UserError, check_range, plugin


def _pycma() -> Any:
    try:
        import cma
    except ImportError as error:
        raise UserError(
            "optimizer=cmaes needs the package 'cma', which is not installed: pip install"
            " 'tractexp[cmaes]'"
        ) from error
    return cma


@plugin
class CMAES(Iterative):
    """Covariance matrix adaptation, restarted with a doubled population from a new random point
    when it stalls.

    Source: Hansen and Ostermeier 2001; restarts (IPOP) by Auger and Hansen 2005; the implementation
    is pycma.
    Departures: none; pycma draws from the search's own generator and leaves NumPy's global state
    alone.
    """

    population: int = 0  # 0: pycma's 4 + 3 ln d
    usual: ClassVar[int] = 1000  # of all restarts together
    restarts: int = 9
    sigma: float = 0.25  # first standard deviation, of the box's width

    def check(self) -> None:
        super().check()
        if self.population != 0:
            check_range("optimizer.population", self.population, 4, 100_000)
        check_range("optimizer.restarts", self.restarts, 0)
        check_range("optimizer.sigma", self.sigma, 1e-6, 1)

    def search(self, evaluate: Evaluate, box: Box, rng: np.random.Generator) -> Iterator[None]:
        cma = _pycma()
        population = self.population or 4 + int(3 * np.log(box.dimension))
        _, steps = self.laid_out(evaluate.budget, 0, population)
        remaining = iter(steps)
        for restart in range(self.restarts + 1):
            settings = {
                "bounds": [0.0, 1.0],
                "popsize": population * 2**restart,
                "randn": lambda *shape: rng.standard_normal(shape),
                "seed": np.nan,  # pycma's "do nothing": no global seeding
                "verbose": -9,
            }
            strategy = cma.CMAEvolutionStrategy(rng.random(box.dimension), self.sigma, settings)
            while not strategy.stop() and next(remaining, None) is not None:
                points = strategy.ask()
                strategy.tell(points, evaluate(box.from_unit(np.array(points)))[1])
                yield
