"""A shrinking random step from the best point."""

from tractexp.extend import Optimizer, check_range, plugin


@plugin
class AcmeDescent(Optimizer):
    """x' = x_best + r N(0, 1), r halved every tenth iteration.

    Source: ACME handbook 2026, section 2.
    Departures: none.
    """

    tries: int = 20
    iterations: int = 60

    def check(self):
        super().check()
        check_range("optimizer.tries", self.tries, low=1)

    def search(self, evaluate, box, rng):
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
