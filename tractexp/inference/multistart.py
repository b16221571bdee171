"""Many starts all over the box, and the local minima they end in: a few random ones may all miss
the best.

What a model seems to miss in a wrong valley is not missing, and what is estimated there is not the
estimate.
"""

import numpy as np

from tractexp.inference.least_squares import Descent
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.problem import Problem
from tractexp.parameter import best_distinct, even

SCREENED = 4096  # points of the box that are simulated
STARTS, APART = 24, 0.5  # the best of them that are so far apart in the unit cube
FEW, SAME, PROMISING = 8, 0.05, 10  # iterations after which only so many, so far apart, are refined
MORE, TOLERANCE = 12, 0.1  # iterations of those, and of the deviance
# of their ends, and how far apart in the unit cube: several end in the same valley
MOST, DISTINCT = 4, 0.2
ALONG = (0.3, 0.6, 0.9)  # of the way to the wall: where other valleys are looked for


def screen_points(problem: Problem) -> tuple[np.ndarray, float]:
    """The most promising points (at most 24, d) of the box by Eq. (8), far apart, and the least
    objective [pu²].
    """
    points = even(SCREENED, problem.space.dimension)
    objective = problem.objective(problem.space.from_unit(points))
    return points[best_distinct(points, objective, APART, STARTS, norm=2)], float(objective.min())


def explore_minima(likelihood: Likelihood, points: np.ndarray | None = None) -> Descent:
    """Where descents from promising `points` (n, d) of the box, by default those screened, end: at
    most 10.
    """
    points = screen_points(likelihood.problem)[0] if points is None else points
    begun = likelihood.descent(likelihood.place_parameters(points), None, FEW, TOLERANCE)
    free = slice(points.shape[1])
    promising = begun.unit[
        best_distinct(begun.unit[:, free], begun.deviance, SAME, PROMISING, norm=2)
    ]
    return likelihood.descent(promising, None, MORE, TOLERANCE)


def distinct(ends: Descent, free: int) -> np.ndarray:
    """Coordinates (at most 4, D) of the ends of distinct valleys, the best first."""
    return ends.unit[best_distinct(ends.unit[:, :free], ends.deviance, DISTINCT, MOST, norm=2)]


def valleys(likelihood: Likelihood) -> np.ndarray:
    """Coordinates (at most 4, D) of distinct best fits from all over the box and beside the best,
    the best first.
    """
    ends = explore_minima(likelihood)
    beside = likelihood.descent(along_least_certain(likelihood, ends.best))
    return distinct(ends.join_descent(beside), likelihood.free)


def along_least_certain(likelihood: Likelihood, unit: np.ndarray) -> np.ndarray:
    """Points (6, D) on either side of an optimum (D,), in the direction that the records know
    least.

    Where q_v is near 2, for instance, the static load takes over the motor's U²/X' and any C will
    do, so that there is one valley on either side of it.
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
