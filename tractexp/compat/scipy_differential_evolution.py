"""SciPy's differential evolution, a generation at a time.

What: `scipy.optimize._differentialevolution.DifferentialEvolutionSolver`, its `next`, `converged`
and `random_number_generator`. Why: the public `differential_evolution` returns when it is done, but
an optimizer of ours is a generator, which the search loop counts and stops after any generation. A
callback cannot yield, short of a thread. Since: SciPy 0.17 (scipy/scipy#5606); looked at in 1.17.
Upstream: scipy/scipy#6923, a public class to step through, was closed without one. When mended:
drop this module and make the public class in the optimizer's `search`.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np


def generations(
    function: Callable[[np.ndarray], np.ndarray],
    bounds: Sequence[tuple[float, float]],
    rng: np.random.Generator,
    **settings: Any,
) -> Iterator[None]:
    """Yield after each generation until the search has converged; first after the initial
    population.

    `function` takes points (d, n) and returns their n values; `settings` are
    `differential_evolution`'s.
    """
    from scipy.optimize._differentialevolution import DifferentialEvolutionSolver

    solver = DifferentialEvolutionSolver(
        function, bounds, vectorized=True, updating="deferred", **settings
    )
    solver.random_number_generator = rng  # its argument is `seed` before SciPy 1.15 and `rng` since
    while True:
        next(solver)
        yield
        if solver.converged():
            return
