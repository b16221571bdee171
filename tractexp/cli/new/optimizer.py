"""An optimizer."""

from collections.abc import Iterator

import numpy as np

from tractexp.extend import Box, Evaluate, Optimizer, check_range, plugin


@plugin
class Example(Optimizer):
    """A random step from the best point, halved every tenth iteration.

        x = x_best + r N(0, 1)

    Source: author year, equation.
    Departures: none.
    """

    tries: int = 20
    iterations: int = 60

    def check(self) -> None:
        super().check()
        check_range("optimizer.tries", self.tries, low=1)

    def search(self, evaluate: Evaluate, box: Box, rng: np.random.Generator) -> Iterator[None]:
        x, f = evaluate(box.uniform(rng, self.tries))
        best, value = x[f.argmin()], f.min()
        yield
        for t in range(self.iterations):
            steps = (
                0.5 ** (t // 10)
                * 0.2
                * box.width
                * rng.standard_normal((self.tries, box.dimension))
            )
            x, f = evaluate(best + steps)
            if f.min() < value:
                best, value = x[f.argmin()], f.min()
            yield
