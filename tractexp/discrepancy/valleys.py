"""The valleys of a base model: its best fits from all over its box, because a few random starts may all miss the best.

What a model seems to miss in a wrong valley is not missing.
"""

from collections.abc import Sequence

import numpy as np

from tractexp.identification.descent import Apart, descend
from tractexp.identification.likelihood import Likelihood
from tractexp.identification.problem import Problem
from tractexp.identification.starts import best_distinct, even

SCREENED = 4096  # points of the box that are simulated
STARTS, APART = 24, 0.5  # the best of them that are so far apart in the unit cube
FEW, SAME, PROMISING = 8, 0.05, 10  # iterations after which only so many, so far apart, are refined
MORE, TOLERANCE = 12, 0.1  # iterations of those, and of the deviance
KEPT, DISTINCT = 4, 0.2  # of their ends, and how far apart in the unit cube: several end in the same valley


def best_fits(problem: Problem, apart: Sequence[Apart]) -> np.ndarray:
    """Coordinates (at most 4, free + 2 E) of the best fits of distinct valleys: parameters, P0 and Q0 of each event.

    The best of them may not stay so once what the recorder did is free.
    """
    likelihood, points = Likelihood.of(problem), even(SCREENED, problem.space.dimension)
    points = points[best_distinct(points, problem.objective(problem.space.from_unit(points)), APART, STARTS, norm=2)]
    begin = np.full((len(points), points.shape[1] + 2 * problem.drive.events), 0.5)
    begin[:, : points.shape[1]] = points
    begun = descend(likelihood.rows, begin, None, FEW, TOLERANCE, apart)
    free = slice(points.shape[1])
    promising = begun.unit[best_distinct(begun.unit[:, free], begun.deviance, SAME, PROMISING, norm=2)]
    done = descend(likelihood.rows, promising, None, MORE, TOLERANCE, apart)
    return done.unit[best_distinct(done.unit[:, free], done.deviance, DISTINCT, KEPT, norm=2)]
