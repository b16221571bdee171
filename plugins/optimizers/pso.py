"""Particle swarm optimization, the paper's second reference."""

from collections.abc import Iterator

import numpy as np

from tractexp.extend import Box, Evaluate, Iterative, check_range, plugin


@plugin
class PSO(Iterative):
    """Global-best particle swarm with an inertia weight, the whole swarm in one step.

        v <- omega v + c1 r1 (p - x) + c2 r2 (g - x),    x <- x + v

    p is a particle's own best, g the swarm's; r1, r2 are uniform in [0, 1) for each particle and
    coordinate.

    Source: Shi and Eberhart 1998, Eqs. (3)-(4); omega, c1, c2, population and iterations from
    section 4.3 of the traction load paper.
    Departures: the paper is silent on the rest. Velocities start at zero; a particle stopped by a
    wall loses the velocity that carried it there. The paper prints no limit of the velocity: none
    is felt below 1, the box's width.
    """

    population: int = 50
    inertia: float = 0.8  # omega
    cognitive: float = 0.5  # c1
    social: float = 1.0  # c2
    velocity_limit: float = 1.0  # of the box's width, per iteration

    def check(self) -> None:
        super().check()
        check_range("optimizer.population", self.population, 1, 100_000)
        check_range("optimizer.inertia", self.inertia, 0)
        check_range("optimizer.cognitive", self.cognitive, 0)
        check_range("optimizer.social", self.social, 0)
        check_range("optimizer.velocity_limit", self.velocity_limit, 1e-6, 1)

    def search(self, evaluate: Evaluate, box: Box, rng: np.random.Generator) -> Iterator[None]:
        x, f = evaluate(box.uniform(rng, self.population))
        v, limit = np.zeros_like(x), self.velocity_limit * box.width
        own, own_f = x.copy(), f.copy()
        yield
        _, steps = self.laid_out(evaluate.budget, self.population, self.population)
        for _ in steps:
            r1, r2 = rng.random((2, *x.shape))
            swarm = own[own_f.argmin()]
            v = self.inertia * v + self.cognitive * r1 * (own - x) + self.social * r2 * (swarm - x)
            wanted = x + np.clip(v, -limit, limit)
            reached, f = evaluate(wanted)
            v = np.where(reached == wanted, wanted - x, 0.0)
            x = reached
            better = f < own_f
            own[better], own_f[better] = x[better], f[better]
            yield
