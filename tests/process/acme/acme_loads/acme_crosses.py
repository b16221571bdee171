"""Coordinate search with shrinking arms."""

import numpy as np

from tractexp.extend import Optimizer, check_range, plugin


@plugin
class AcmeCrosses(Optimizer):
    """x' = best of x and x +- a e_k over all coordinates k; the arm a is halved when none is
    better.

    Source: ACME handbook 2026, section 3.
    Departures: the first point is the best of ten drawn at random.
    """

    arm: float = 0.25  # of the box, at first
    shortest: float = 1e-6  # of the box, where it ends

    def check(self):
        super().check()
        check_range("optimizer.arm", self.arm, low=1e-3, high=1.0)

    def search(self, evaluate, box, rng):
        x, f = evaluate(box.uniform(rng, 10))
        best, value, arm = x[f.argmin()], f.min(), self.arm
        yield
        while arm > self.shortest:
            arms = np.diag(arm * box.width)
            x, f = evaluate(np.concatenate([best + arms, best - arms]))
            if f.min() < value:
                best, value = x[f.argmin()], f.min()
            else:
                arm /= 2
            yield
