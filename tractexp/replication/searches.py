"""Many searches on the cores of this computer, without composing a configuration for each."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tractexp.identification.problem import Problem
from tractexp.identification.search import Found, Limits, search
from tractexp.plugin import build
from tractexp.record import Event

CHUNK = 5  # searches that share the composition of a model
Recipe = Callable[[], Problem]  # what a worker builds its problem from: a `Problem` holds compiled code
Variant = Mapping[str, Any]  # settings of an optimizer: {"name": "issa", "levy": False}


def run(
    recipe: Recipe,
    variants: Mapping[str, Variant],
    seeds: int,
    limits: Limits | None = None,
    workers: int | None = None,
    tell: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, list[Found]]:
    """Search with every variant under seeds 0, 1, ...; `tell(done, total)` counts the searches done.

    One seed gives one history, whatever the number of workers (None: one for each core).
    """
    from joblib import Parallel, cpu_count, delayed

    problem = recipe()
    problem.objective(problem.space.from_unit(np.full((1, problem.space.dimension), 0.5)))  # compiled once, for all
    chunks = [
        (label, range(first, min(first + CHUNK, seeds))) for label in variants for first in range(0, seeds, CHUNK)
    ]
    found: dict[str, list[Found]] = {label: [] for label in variants}
    parallel: Any = Parallel(n_jobs=min(workers or cpu_count(), len(chunks)), return_as="generator")
    jobs = (delayed(_chunk)(recipe, dict(variants[label]), part, limits or Limits()) for label, part in chunks)
    done = 0
    for (label, part), outcome in zip(chunks, parallel(jobs), strict=True):
        found[label] += outcome
        done += len(part)
        tell(done, len(variants) * seeds)
    return found


def _chunk(recipe: Recipe, settings: dict[str, Any], seeds: Sequence[int], limits: Limits) -> list[Found]:
    problem, optimizer = recipe(), build("optimizer", settings)
    return [search(problem, optimizer, seed, limits) for seed in seeds]


def best_at(found: Found, simulations: float) -> float:
    """The best objective [pu²] by the end of the last iteration within so many simulations."""
    within = np.flatnonzero(found.history.simulations <= simulations)
    return float(found.history.objective[within[-1] if len(within) else 0])


def by_depth(events: Sequence[Event], fitted: Sequence[Event]) -> list[str]:
    """ "interpolation" for a dip no deeper than the deepest that was fitted, else "extrapolation"."""
    deepest = max(event.depth for event in fitted)
    return ["interpolation" if event.depth <= deepest else "extrapolation" for event in events]


def mean_residual(measured: np.ndarray, calculated: np.ndarray) -> float:
    """Eq. (21): the mean of |measured - calculated| [pu], both (N,); gaps (nan) left out."""
    return float(np.nanmean(np.abs(measured - calculated)))
