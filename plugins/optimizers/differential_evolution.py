"""Differential evolution, SciPy's."""

from collections.abc import Iterator

import numpy as np

from tractexp.extend import Box, Evaluate, Iterative, check_choice, check_range, plugin
from tractexp.extend.search import generations

STRATEGIES = tuple(
    f"{kind}{crossover}"
    for crossover in ("bin", "exp")
    for kind in ("best1", "best2", "rand1", "rand2", "randtobest1", "currenttobest1")
)


@plugin
class DifferentialEvolution(Iterative):
    """SciPy's differential evolution, a generation as one batch, its factor F drawn anew for each
    (dither).

    Ends after `iterations`, or once the spread of the population's objectives is `tolerance` of
    their mean.

    Source: Storn and Price 1997, as scipy.optimize.differential_evolution.
    Departures: a trial competes at the end of its generation (SciPy's updating='deferred'). SciPy
    evaluates the initial population and the first generation in one step, so iteration 0 spends
    both.
    """

    population: int = 50
    strategy: str = "best1bin"
    mutation_low: float = 0.5  # F is drawn between the two
    mutation_high: float = 1.0
    recombination: float = 0.7
    tolerance: float = 1e-6

    def check(self) -> None:
        super().check()
        check_range("optimizer.population", self.population, 5, 100_000)
        check_choice("optimizer.strategy", self.strategy, STRATEGIES)
        check_range("optimizer.mutation_low", self.mutation_low, 0, self.mutation_high)
        check_range("optimizer.mutation_high", self.mutation_high, 0, 1.99)
        check_range("optimizer.recombination", self.recombination, 0, 1)
        check_range("optimizer.tolerance", self.tolerance, 0)

    def search(self, evaluate: Evaluate, box: Box, rng: np.random.Generator) -> Iterator[None]:
        evolution = generations(
            lambda x: evaluate(x.T)[1],
            list(zip(box.lower, box.upper, strict=True)),
            rng,
            init=box.uniform(rng, self.population),
            strategy=self.strategy,
            tol=self.tolerance,
            mutation=(self.mutation_low, self.mutation_high),
            recombination=self.recombination,
            polish=False,
        )
        _, steps = self.laid_out(evaluate.budget, self.population, self.population)
        for _ in zip(steps, evolution, strict=False):
            yield
