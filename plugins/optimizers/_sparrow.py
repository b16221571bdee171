"""The sparrow search shared by `ssa` and `issa`: one operator per equation, and the loop that
applies them.

Equation numbers are those of the traction load paper, section 3; ranks i count from 1, best first.
An operator takes positions (k, d), draws from the generator it is given, and returns new positions
(k, d), not yet clipped.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from tractexp.extend import Box, Evaluate, Iterative, check_choice, check_range

SMALLEST_GAP = 1e-50  # epsilon of Eq. (13), the value in the SSA authors' code
EXP_MAX = 700.0  # exp overflows beyond it; any box ends long before


def produce(x: np.ndarray, alarmed: bool, iterations: int, rng: np.random.Generator) -> np.ndarray:
    """The moves of the producers, Eq. (11).

        x exp(-i/(alpha iter_max)), or x + Q L once R2 >= ST

    Parameters
    ----------
    x : (k, d)
        Positions of ranks 1 to k.
    alarmed : bool
        Whether R2 >= ST.
    iterations : int
        iter_max.
    rng : numpy.random.Generator
        Draws alpha and Q.

    Returns
    -------
    (k, d) array
    """
    if alarmed:
        return x + rng.standard_normal((len(x), 1))
    rank = np.arange(1, len(x) + 1)[:, None]
    alpha = 1.0 - rng.random((len(x), 1))  # in (0, 1]
    return x * np.exp(-rank / (alpha * iterations))


def follow(
    x: np.ndarray,
    leader: np.ndarray,
    flight: np.ndarray | float,
    scalar: bool,
    rng: np.random.Generator,
) -> np.ndarray:
    """Scroungers up to rank n/2, Eqs. (12) and (16): X_P + s |x - X_P| A+ L, where A is +-1 and A+
    = A^T (A A^T)^-1.

    As printed, shapes (1, d), (d, 1) and (1, d) make one number for all coordinates, with A+ = A^T
    / d: `scalar`. Element-wise, the equation holds for each coordinate by itself, d = 1, where A+ =
    A.
    """
    signed = flight * np.abs(x - leader) * (2.0 * rng.integers(0, 2, x.shape) - 1.0)
    return leader + (signed.mean(axis=1, keepdims=True) if scalar else signed)


def starve(
    x: np.ndarray, worst: np.ndarray, rank: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Scroungers of rank (k,) beyond n/2, Eq. (12): Q exp((X_worst - x) / i^2)."""
    grown = np.exp(np.minimum((worst - x) / rank[:, None] ** 2, EXP_MAX))
    return rng.standard_normal((len(x), 1)) * grown


def perceive(
    x: np.ndarray,
    f: np.ndarray,
    best: tuple[np.ndarray, float],
    worst: tuple[np.ndarray, float],
    rng: np.random.Generator,
) -> np.ndarray:
    """Perceivers with objectives f (k,), Eq. (13): about the best, or, for the best itself, away
    from the worst.
    """
    beta = rng.standard_normal(x.shape)
    k = rng.uniform(-1.0, 1.0, (len(x), 1))
    away = x + k * np.abs(x - worst[0]) / (f - worst[1] + SMALLEST_GAP)[:, None]
    return np.where((f > best[1])[:, None], best[0] + beta * np.abs(x - best[0]), away)


class Flock:
    """Positions x (n, d) with their objectives f (n,), and the best position met so far."""

    def __init__(self, x: np.ndarray, evaluate: Evaluate, better_only: bool):
        self.evaluate, self.better_only = evaluate, better_only
        self.x, self.f = evaluate(x)
        self.best = self.x[0], np.inf
        self._keep_best()

    def _keep_best(self) -> None:
        first = int(self.f.argmin())
        if self.f[first] < self.best[1]:
            self.best = self.x[first].copy(), float(self.f[first])

    def sort(self) -> None:
        """Rank the sparrows, best first."""
        order = self.f.argsort(kind="stable")
        self.x, self.f = self.x[order], self.f[order]

    def move(self, rows: np.ndarray, x: np.ndarray) -> None:
        """Propose positions x (k, d) to the sparrows `rows` (k,), which take them always, or only
        where better.
        """
        x, f = self.evaluate(x)
        if self.better_only:
            better = f < self.f[rows]
            rows, x, f = rows[better], x[better], f[better]
        self.x[rows], self.f[rows] = x, f
        self._keep_best()


@dataclass(frozen=True, kw_only=True)
class Sparrow(Iterative):
    """The loop: rank, producers, scroungers and perceivers, and what a subclass adds at three
    places.
    """

    population: int = 50
    producers: float = 0.2  # share of the population, the best
    # share of the population, drawn anew in each iteration: SD of section 4.3
    perceivers: float = 0.4
    safety_threshold: float = 0.8  # ST of Eq. (11)
    acceptance: str = "better"  # "better": a sparrow moves only to improve; "all": always
    # A+ L of Eq. (12): "elementwise" or, as printed, one "scalar" for all coordinates
    step: str = "elementwise"

    def check(self) -> None:
        super().check()
        check_range("optimizer.population", self.population, 2, 100_000)
        check_range("optimizer.producers", self.producers, 0, 1)
        check_range("optimizer.perceivers", self.perceivers, 0, 1)
        check_range("optimizer.safety_threshold", self.safety_threshold, 0, 1)
        check_choice("optimizer.acceptance", self.acceptance, ("better", "all"))
        check_choice("optimizer.step", self.step, ("elementwise", "scalar"))

    def initial(self, box: Box, rng: np.random.Generator) -> np.ndarray:
        """The first positions (n, d)."""
        return box.uniform(rng, self.population)

    def flight(self, shape: tuple[int, int], rng: np.random.Generator) -> np.ndarray | float:
        """The step s of Eq. (16) for each coordinate; Eq. (12) has none."""
        return 1.0

    def perturbation(
        self, box: Box, iterations: int, rng: np.random.Generator
    ) -> Callable[[int, Flock], None]:
        """The change of the flock at the end of iteration t = 1, 2, ... of so many; traditionally
        none.
        """
        return lambda t, flock: None

    @property
    def perturbation_cost(self) -> float:
        """The simulations that the perturbation of an iteration costs, on average."""
        return 0.0

    @property
    def _foraging_cost(self) -> float:
        """The simulations of Eqs. (11)-(13) in an iteration, on average: producers who perceive
        move twice.
        """
        return self.population * (1.0 + self.perceivers * self.producers)

    def search(self, evaluate: Evaluate, box: Box, rng: np.random.Generator) -> Iterator[None]:
        flock = Flock(self.initial(box, rng), evaluate, self.acceptance == "better")
        each = self._foraging_cost + self.perturbation_cost
        iterations, steps = self.laid_out(evaluate.budget, self.population, each)
        perturb = self.perturbation(box, iterations, rng)
        yield
        for t in steps:
            self._forage(flock, iterations, rng)
            perturb(t, flock)
            yield

    def _forage(self, flock: Flock, iterations: int, rng: np.random.Generator) -> None:
        """Eqs. (11)-(13). X_P is the best producer after its move; a perceiver makes that move
        instead of its own.

        The authors' code simulates a scrounger's move even where the perceiver's then replaces it;
        here it is not, which changes no position.
        """
        n = self.population
        p = max(1, round(self.producers * n))
        half = max(p, n // 2)
        flock.sort()
        worst = flock.x[-1], flock.f[-1]
        alarmed = rng.random() >= self.safety_threshold
        flock.move(np.arange(p), produce(flock.x[:p], alarmed, iterations, rng))
        leader = flock.x[flock.f[:p].argmin()]

        x = flock.x.copy()
        flight = self.flight(x[p:half].shape, rng)
        x[p:half] = follow(x[p:half], leader, flight, self.step == "scalar", rng)
        x[half:] = starve(x[half:], worst[0], np.arange(half + 1, n + 1), rng)
        watch = rng.permutation(n)[: round(self.perceivers * n)]
        x[watch] = perceive(flock.x[watch], flock.f[watch], flock.best, worst, rng)
        moved = np.arange(n) >= p
        moved[watch] = True
        flock.move(moved.nonzero()[0], x[moved])
