"""What an optimizer costs beside the simulations: microseconds per evaluation of a trivial
objective.

    python benchmarks/search.py [--json] [--repeats 5]

Population 50, 7 parameters, 15,000 evaluations through the one search loop (clipping, counting,
history included); the median of the repeats, less the objective itself, timed on batches of the
same size. Beside them, where installed, pycma by ask and tell and SciPy's differential evolution by
themselves, one call per candidate and vectorized.
"""

import argparse
import json
import statistics
import time
from collections.abc import Callable

import numpy as np

from tractexp.configuration.plugin import build, discover
from tractexp.identification.search import Limits, search

DIMENSION, POPULATION, EVALUATIONS = 7, 50, 15_000


class Trivial:
    """A shifted sphere, the cheapest problem that has a minimum and residuals."""

    lower, upper = np.full(DIMENSION, -1.0), np.full(DIMENSION, 3.0)
    center = np.linspace(-0.5, 2.0, DIMENSION)

    def residuals(self, values: np.ndarray) -> np.ndarray:
        return values - self.center

    def objective(self, values: np.ndarray) -> np.ndarray:
        r = values - self.center
        return np.einsum("nd,nd->n", r, r)


def ours(name: str) -> Callable[[], int]:
    """One search by a plugin, with the benchmark's population where it has one; returns the
    evaluations made.
    """
    settings = {"name": name}
    if hasattr(discover()["optimizer"][name], "population"):
        settings["population"] = POPULATION
    optimizer = build("optimizer", settings)
    return lambda: search(Trivial(), optimizer, 0, Limits(simulations=EVALUATIONS)).simulations


def pycma() -> int:
    import cma

    problem, rng = Trivial(), np.random.default_rng(0)
    spent = 0
    while spent < EVALUATIONS:
        settings = {"bounds": [-1, 3], "popsize": POPULATION, "verbose": -9, "seed": 1}
        strategy = cma.CMAEvolutionStrategy(rng.uniform(-1, 3, DIMENSION), 1.0, settings)
        while spent < EVALUATIONS and not strategy.stop():
            points = strategy.ask()
            strategy.tell(points, problem.objective(np.array(points)))
            spent += POPULATION
    return spent


def scipy_differential_evolution(vectorized: bool) -> int:
    from scipy.optimize import differential_evolution

    problem = Trivial()
    start = np.random.default_rng(0).uniform(-1, 3, (POPULATION, DIMENSION))
    one = lambda x: problem.objective(x[None])[0]  # noqa: E731
    found = differential_evolution(
        (lambda x: problem.objective(x.T)) if vectorized else one,
        [(-1, 3)] * DIMENSION,
        init=start,
        maxiter=EVALUATIONS // POPULATION - 1,
        tol=0,
        polish=False,
        vectorized=vectorized,
        updating="deferred",
    )
    return (found.nit + 1) * POPULATION


def objective_microseconds(batch: int) -> float:
    """The trivial objective itself, per candidate."""
    problem, x = Trivial(), np.random.default_rng(0).random((batch, DIMENSION))
    start = time.perf_counter()
    for _ in range(2000):
        problem.objective(x)
    return (time.perf_counter() - start) / (2000 * batch) * 1e6


def measure(run: Callable[[], int], repeats: int, objective: float) -> dict[str, float]:
    """The run's cost per evaluation, the objective's taken off; the first run warms up and is not
    counted.
    """
    evaluations, times = run(), []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return {
        "evaluations": evaluations,
        "microseconds": statistics.median(times) / evaluations * 1e6 - objective,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print JSON instead of the table")
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args()

    runs = {name: (ours(name), POPULATION) for name in sorted(discover()["optimizer"])}
    runs["SciPy DE, vectorized"] = lambda: scipy_differential_evolution(True), POPULATION
    runs["SciPy DE, one by one"] = lambda: scipy_differential_evolution(False), 1
    runs["pycma, ask and tell"] = pycma, POPULATION
    rows = {}
    for name, (run, batch) in runs.items():
        if "cma" in name and not _installed("cma"):
            continue
        rows[name] = measure(run, given.repeats, objective_microseconds(batch))

    if given.json:
        setting = {
            "population": POPULATION,
            "dimension": DIMENSION,
            "budget": EVALUATIONS,
            "repeats": given.repeats,
        }
        print(json.dumps({**setting, "overhead": rows}, indent=2))
        return
    print(f"{'optimizer':28}{'evaluations':>12}{'us per evaluation':>20}")
    for name, row in rows.items():
        print(f"{name:28}{row['evaluations']:12d}{row['microseconds']:20.2f}")


def _installed(package: str) -> bool:
    from importlib.util import find_spec

    return find_spec(package) is not None


if __name__ == "__main__":
    main()
