"""Uniform random search, the negative control."""

import itertools
from collections.abc import Iterator

import numpy as np

from tractexp.extend import Box, Evaluate, Iterative, check_range, plugin


@plugin
class RandomSearch(Iterative):
    """Points drawn uniformly, none better informed than the last: what any other optimizer must
    beat.

    Source: Anderson 1953, "Recent advances in finding best operating conditions".
    Departures: none; the points come in batches of `population`.
    """

    population: int = 50

    def check(self) -> None:
        super().check()
        check_range("optimizer.population", self.population, 1, 100_000)

    def search(self, evaluate: Evaluate, box: Box, rng: np.random.Generator) -> Iterator[None]:
        _, steps = self.laid_out(evaluate.budget, self.population, self.population)
        for _ in itertools.chain((0,), steps):
            evaluate(box.uniform(rng, self.population))
            yield
