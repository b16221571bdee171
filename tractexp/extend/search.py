"""Parts of searches: starts that lie apart, least squares from several at once, SciPy's
differential evolution.
"""

from tractexp.compat.scipy_differential_evolution import generations
from tractexp.identification.polish import LEAST_START_DISTANCE, race
from tractexp.parameter import best_distinct

__all__ = ["LEAST_START_DISTANCE", "best_distinct", "generations", "race"]
