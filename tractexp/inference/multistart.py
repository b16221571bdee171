"""Many starts all over the box, and the local minima they end in: a few random ones may all miss
the best.

What a model seems to miss at a wrong local minimum is not missing, and what is estimated there is
not the estimate.
"""

import numpy as np

from tractexp.inference.least_squares import Descent
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.problem import Problem
from tractexp.parameter import best_distinct, spread_evenly

SCREENED = 4096  # points of the box that are simulated
STARTS, APART = 24, 0.5  # the best of them that are so far apart in the unit cube
FEW, SAME, PROMISING = 8, 0.05, 10  # iterations after which only so many, so far apart, are refined
MORE, TOLERANCE = 12, 0.1  # iterations of those, and of the deviance
# of their ends, and how far apart in the unit cube: several end in one local minimum
MOST, DISTINCT = 4, 0.2
ALONG = (0.3, 0.6, 0.9)  # of the way to the bound: where other minima are sought


def screen_points(problem: Problem) -> tuple[np.ndarray, float]:
    """The most promising of 4096 points that fill the box evenly.

    Parameters
    ----------
    problem : Problem
        Whose objective, Eq. (8), ranks the points.

    Returns
    -------
    (at most 24, d) array
        Points of the unit cube, no two nearer than 0.5.
    float [pu²]
        The least objective of all points.
    """
    points = spread_evenly(SCREENED, problem.space.dimension)
    objective = problem.objective(problem.space.from_unit(points))
    return points[best_distinct(points, objective, APART, STARTS, norm=2)], float(objective.min())


def search_box(problem: Problem) -> tuple[Likelihood, Descent]:
    """The ends of descents by least squares from all over the box.

    Parameters
    ----------
    problem : Problem
        That is fitted.

    Returns
    -------
    Likelihood
        Eq. (8), in units of what the best point of the box leaves.
    Descent
        As of `explore_minima`.
    """
    points, least = screen_points(problem)
    likelihood = Likelihood.of_objective(problem, least)
    return likelihood, explore_minima(likelihood, points)


def explore_minima(likelihood: Likelihood, points: np.ndarray | None = None) -> Descent:
    """The ends of descents from all over the box.

    All starts descend for 8 iterations; the best of what they reach goes on.

    Parameters
    ----------
    likelihood : Likelihood
        Whose deviance is lowered.
    points : (n, d)
        Starts in the unit cube; by default those of `screen_points`.

    Returns
    -------
    Descent
        Of at most 10 ends.
    """
    points = screen_points(likelihood.problem)[0] if points is None else points
    begun = likelihood.descent(likelihood.place_parameters(points), None, FEW, TOLERANCE)
    free = slice(points.shape[1])
    promising = begun.unit[
        best_distinct(begun.unit[:, free], begun.deviance, SAME, PROMISING, norm=2)
    ]
    return likelihood.descent(promising, None, MORE, TOLERANCE)


def select_distinct(ends: Descent, free: int) -> np.ndarray:
    """The ends of descents that are different local minima.

    Parameters
    ----------
    ends : Descent
        Where descents ended.
    free : int
        Number of free parameters: P0 and Q0, which follow them, do not count.

    Returns
    -------
    (at most 4, D) array
        Coordinates, the best first.
    """
    return ends.unit[best_distinct(ends.unit[:, :free], ends.deviance, DISTINCT, MOST, norm=2)]


def find_local_minima(likelihood: Likelihood) -> np.ndarray:
    """The distinct local minima of a likelihood, from all over the box and beside the best.

    Parameters
    ----------
    likelihood : Likelihood
        Whose deviance is lowered.

    Returns
    -------
    (at most 4, D) array
        Coordinates, the best first.
    """
    ends = explore_minima(likelihood)
    beside = likelihood.descent(place_along_least_certain(likelihood, ends.best))
    return select_distinct(ends.join_descent(beside), likelihood.free)


def place_along_least_certain(likelihood: Likelihood, unit: np.ndarray) -> np.ndarray:
    """Points on either side of a minimum, in the direction that the records know least.

    Where q_v is near 2, for instance, the static load takes over the motor's U²/X' and any C will
    do, so that there is a local minimum on either side.

    Parameters
    ----------
    likelihood : Likelihood
        Whose sensitivities tell the direction.
    unit : (D,)
        Coordinates of the minimum.

    Returns
    -------
    (6, D) array
        At 0.3, 0.6 and 0.9 of the way to the bounds.
    """
    _, J = likelihood.jacobian(unit)
    direction = np.linalg.svd(J.shared_columns, full_matrices=False)[2][-1]
    points = []
    for way in (direction, -direction):
        room = np.where(way > 0, 1 - unit[: len(way)], unit[: len(way)]) / np.maximum(
            np.abs(way), 1e-12
        )
        for share in ALONG:
            points.append(unit.copy())
            points[-1][: len(way)] += share * room.min() * way
    return np.array(points)
