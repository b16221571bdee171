"""The improved sparrow search algorithm: four ingredients, each a function and a switch."""

import math
from collections.abc import Callable
from typing import ClassVar

import numpy as np

from tractexp.extend import Box, check_choice, check_range, plugin

from ._sparrow import Flock, Sparrow

LEVY_BETA = 1.5  # beta of Eq. (15)
BETTER = 2 / 3  # share of a flock that is better than its mean, about


def tent(z: np.ndarray, alpha: float) -> np.ndarray:
    """The tent map, Eq. (14), on [0, 1]."""
    return np.where(z < alpha, z / alpha, (1.0 - z) / (1.0 - alpha))


def tent_orbit(z: np.ndarray, alpha: float, rng: np.random.Generator) -> np.ndarray:
    """`tent`, with an orbit that has reached its dead point 0 started anew (alpha = 0.5 does so in
    53 steps).
    """
    z = tent(z, alpha)
    dead = (z <= 0.0) | (z >= 1.0)
    return np.where(dead, rng.random(z.shape), z) if dead.any() else z


def levy_sigma(beta: float) -> float:
    """sigma_mu of Eq. (15)."""
    numerator = math.gamma(1 + beta) * math.sin(math.pi * beta / 2)
    return (numerator / (2 ** ((beta - 1) / 2) * beta * math.gamma((1 + beta) / 2))) ** (1 / beta)


def levy_flight(shape: tuple[int, ...], formula: str, rng: np.random.Generator) -> np.ndarray:
    """Levy steps.

    Parameters
    ----------
    shape : tuple of ints
        Of the result.
    formula : str
        "mantegna", mu/|nu|^(1/beta), or "printed" as Eq. (15) is, -mu/|nu|^beta.
    rng : numpy.random.Generator
        Draws mu and nu.

    Returns
    -------
    array of that shape
    """
    mu = levy_sigma(LEVY_BETA) * rng.standard_normal(shape)
    nu = np.abs(rng.standard_normal(shape))
    return mu / nu ** (1 / LEVY_BETA) if formula == "mantegna" else -mu / nu**LEVY_BETA


def vary(x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Gaussian variation, Eq. (17): x (1 + N), N ~ N(0, 1) for each coordinate."""
    return x * (1.0 + rng.standard_normal(x.shape))


def disturb(x: np.ndarray, z: np.ndarray, box: Box) -> np.ndarray:
    """Tent perturbation, Eqs. (18)-(19): half way to the box's point with chaotic coordinates z."""
    return (x + box.from_unit(z)) / 2


@plugin
class ISSA(Sparrow):
    """Sparrow search with tent initialization, Levy flight, Gaussian variation and tent
    perturbation.

    With all four off it is `ssa`, bit for bit. By "fitness" (step 5), sparrows better than the mean
    vary and the others are disturbed, which simulates the population a second time. By "stage"
    (section 3.2.3), all are disturbed in the first half of the iterations; in the second half the
    best alone varies, as Eq. (17) prints.

    Source: traction load paper, Eqs. (14)-(19), steps 1-7 and settings of section 4.2; Mantegna
    1994.
    Departures: as `ssa`. Levy's step is Mantegna's unless levy_formula=printed. The paper does not
    say how step 5 divides the flock: the mean fitness does. Each sparrow has its own chaotic orbit.
    """

    plain: ClassVar[str] = "ssa"
    tent_initialization: bool = True
    levy: bool = True
    gaussian: bool = True
    tent_perturbation: bool = True
    tent_alpha: float = 0.3  # alpha of Eq. (14)
    levy_formula: str = "mantegna"  # "mantegna" or "printed"
    schedule: str = "fitness"  # "fitness" (step 5) or "stage" (section 3.2.3)

    def check(self) -> None:
        super().check()
        check_range("optimizer.tent_alpha", self.tent_alpha, 0.01, 0.99)
        check_choice("optimizer.levy_formula", self.levy_formula, ("mantegna", "printed"))
        check_choice("optimizer.schedule", self.schedule, ("fitness", "stage"))

    def initial(self, box: Box, rng: np.random.Generator) -> np.ndarray:
        if not self.tent_initialization:
            return super().initial(box, rng)
        orbit = [rng.random(box.dimension)]
        while len(orbit) < self.population:
            orbit.append(tent_orbit(orbit[-1], self.tent_alpha, rng))
        return box.from_unit(np.array(orbit))

    def flight(self, shape: tuple[int, int], rng: np.random.Generator) -> np.ndarray | float:
        return (
            levy_flight(shape, self.levy_formula, rng) if self.levy else super().flight(shape, rng)
        )

    def perturbation(
        self, box: Box, iterations: int, rng: np.random.Generator
    ) -> Callable[[int, Flock], None]:
        if not (self.gaussian or self.tent_perturbation):
            return super().perturbation(box, iterations, rng)
        orbit = rng.random((self.population, box.dimension))

        def perturb(t: int, flock: Flock) -> None:
            nonlocal orbit
            orbit = tent_orbit(orbit, self.tent_alpha, rng)
            varied, disturbed = self._divide(t, iterations, flock.f)
            x = np.concatenate(
                (vary(flock.x[varied], rng), disturb(flock.x[disturbed], orbit[disturbed], box))
            )
            if len(x):
                flock.move(np.concatenate((varied, disturbed)), x)

        return perturb

    @property
    def perturbation_cost(self) -> float:
        """Simulations that the perturbation adds to an iteration, on average."""
        shares = self.gaussian * BETTER, self.tent_perturbation * (1.0 - BETTER)
        # all in one half of the iterations, the best alone in the other
        if self.schedule == "stage":
            shares = self.gaussian * 0.5 / self.population, self.tent_perturbation * 0.5
        return self.population * sum(shares)

    def _divide(self, t: int, iterations: int, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows to vary and rows to disturb in iteration t; a switch that is off leaves its rows
        alone.
        """
        if self.schedule == "fitness":
            better = f < f.mean()
            varied, disturbed = better.nonzero()[0], (~better).nonzero()[0]
        elif 2 * t <= iterations:
            varied, disturbed = np.arange(0), np.arange(len(f))
        else:
            varied, disturbed = np.array([f.argmin()]), np.arange(0)
        return varied[: None if self.gaussian else 0], disturbed[
            : None if self.tent_perturbation else 0
        ]
