"""The valleys of the objective: where searches and random points descend to, and the way along a
parameter between.
"""

from dataclasses import dataclass

import numpy as np

from tractexp.identification.search import REFUSED
from tractexp.inference.least_squares import descend
from tractexp.inference.problem import Problem

SAME_VALLEY_RATIO = 1.02  # descents that end within so many times of each other are in one valley
GAIN = 1e-6  # of the lowest objective: a descent's step that gains less ends it
MOST_DESCENT_STEPS = 200  # of a descent, at most


@dataclass(frozen=True, eq=False)
class Ends:
    """Where descents by least squares end: objectives (n,) [pu²] and values (n, free)."""

    objective: np.ndarray
    values: np.ndarray

    def group_valleys(self) -> list[tuple[float, int, np.ndarray]]:
        """Objective, count and values of each valley, the lowest first."""
        rest, groups = np.argsort(self.objective), []
        while len(rest):
            lowest = rest[0]
            same = self.objective[rest] <= SAME_VALLEY_RATIO * self.objective[lowest]
            groups.append(
                (float(self.objective[lowest]), int(np.count_nonzero(same)), self.values[lowest])
            )
            rest = rest[~same]
        return groups


def run_descents(problem: Problem, values: np.ndarray, floor: float, held: str = "") -> Ends:
    """Least squares from each of the values (n, free), all at once, with one parameter `held` where
    it is.
    """
    space, scale = problem.space, 1 / np.sqrt(GAIN * floor)

    def rows(unit: np.ndarray, lanes: np.ndarray) -> np.ndarray:
        return scale * problem.residuals(space.from_unit(unit))

    unit = np.array([space.to_unit(v) for v in values])
    frozen = np.tile([name == held for name in space.names], (len(unit), 1))
    ends = descend(rows, unit, frozen, iterations=MOST_DESCENT_STEPS, tolerance=1.0)
    return Ends(ends.deviance / scale**2, space.from_unit(ends.unit))


def draw_uniform_points(problem: Problem, n: int, seed: int) -> np.ndarray:
    """n points (n, free), uniform among those of the bounds that have a steady state."""
    rng, points = np.random.default_rng(seed), np.empty((0, problem.space.dimension))
    while len(points) < n:
        drawn = problem.space.from_unit(rng.random((n, problem.space.dimension)))
        points = np.concatenate((points, drawn[problem.objective(drawn) < REFUSED]))
    return points[:n]


def rebound_problem(problem: Problem, name: str, low: float, high: float) -> Problem:
    """The problem with other bounds of one parameter, and as many Runge-Kutta steps a sample."""
    bounds = {p.name: p.bounds for p in problem.parameters} | {name: (low, high)}
    step = int(problem.step.substeps.max())
    return Problem(
        problem.model, problem.events, bounds, problem.fixed, step, problem.per_event, problem.loss
    )


def follow_valley(
    problem: Problem, starts: np.ndarray, name: str, grid: np.ndarray, floor: float
) -> Ends:
    """The lowest objective at each value of a parameter, all others fitted: followed from each
    start both ways.
    """
    column = problem.space.names.index(name)
    best, values = np.full(len(grid), np.inf), np.empty((len(grid), problem.space.dimension))
    for start in starts:
        nearest = int(np.abs(grid - start[column]).argmin())
        for way in (range(nearest, len(grid)), range(nearest - 1, -1, -1)):
            at = start
            for k in way:
                moved = np.where(np.arange(len(at)) == column, grid[k], at)
                fit = run_descents(problem, moved[None], floor, held=name)
                if not np.isfinite(fit.objective[0]):
                    break
                at = fit.values[0]
                if fit.objective[0] < best[k]:
                    best[k], values[k] = fit.objective[0], at
    return Ends(best, values)
