"""The contract of an optimizer: what it forgives."""

from tractexp.extend import Optimizer
from tractexp.testing.searches import finds_the_bottom_of_a_bowl


class ShrinkingCloud(Optimizer):
    """Points that shrink about the best, written into the arrays that `evaluate` returned."""

    name = "shrinking_cloud"

    def search(self, evaluate, box, rng):
        x, f = evaluate(box.uniform(rng, 20))
        for k in range(1, 10**6):
            yield
            scatter = 0.5 * 0.7**k * box.width * rng.standard_normal(x.shape)
            new_x, new_f = evaluate(x[f.argmin()] + scatter)
            better = new_f < f
            x[better], f[better] = new_x[better], new_f[better]


def test_an_optimizer_may_change_the_arrays_that_it_is_given():
    finds_the_bottom_of_a_bowl(ShrinkingCloud)
