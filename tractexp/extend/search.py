"""Parts of searches: starts that lie apart, least squares from several at once, SciPy's
differential evolution; and the search loop itself, to try an optimizer on a function of one's own.
"""

from tractexp.compat.scipy_differential_evolution import generations
from tractexp.identification.polish import LEAST_START_DISTANCE, race
from tractexp.identification.search import History, Limits, Objective, SearchResult, search
from tractexp.parameter import best_distinct

__all__ = [
    "LEAST_START_DISTANCE",
    "History",
    "Limits",
    "Objective",
    "SearchResult",
    "best_distinct",
    "generations",
    "race",
    "search",
]
