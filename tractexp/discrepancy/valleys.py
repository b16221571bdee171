"""The valleys of a base model: its best fits from all over its box, because a few random starts may all miss the best.

What a model seems to miss in a wrong valley is not missing.
"""

from collections.abc import Sequence

import numpy as np

from tractexp.identify.descent import Apart, descend
from tractexp.identify.likelihood import Likelihood
from tractexp.identify.problem import Problem, even

SCREENED = 4096  # points of the box that are simulated
STARTS, APART = 24, 0.5  # the best of them that are so far apart in the unit cube
FEW, PROMISING = 8, 10  # iterations after which only so many of them are refined
MORE, TOLERANCE = 12, 0.1  # iterations of those, and of the deviance
KEPT = 3


def best_fits(problem: Problem, apart: Sequence[Apart]) -> np.ndarray:
    """Coordinates (at most 3, free + 2 E) of the best fits: free parameters, then P0 and Q0 of each event."""
    likelihood, points = Likelihood.of(problem), _best_apart(problem)
    begin = np.full((len(points), points.shape[1] + 2 * problem.drive.events), 0.5)
    begin[:, : points.shape[1]] = points
    begun = descend(likelihood.rows, begin, None, FEW, TOLERANCE, apart)
    promising = begun.unit[np.argsort(begun.deviance)[:PROMISING]]
    done = descend(likelihood.rows, promising, None, MORE, TOLERANCE, apart)
    return done.unit[np.argsort(done.deviance)[:KEPT]]


def _best_apart(problem: Problem) -> np.ndarray:
    """The best of many points that fill the unit cube, none near another, (at most 24, free)."""
    points = even(SCREENED, problem.space.dimension)
    chosen: list[int] = []
    for k in np.argsort(problem.objective(problem.space.from_unit(points)), kind="stable"):
        if all(np.linalg.norm(points[k] - points[c]) > APART for c in chosen):
            chosen.append(int(k))
        if len(chosen) == STARTS:
            break
    return points[chosen]
