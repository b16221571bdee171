"""Many searches on the cores of this computer, without composing a configuration for each."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tractexp.identification.search import Limits, SearchResult, search
from tractexp.inference.problem import Problem
from tractexp.plugin import build
from tractexp.studies.paper.search_store import SearchStore
from tractexp.workers import Workers

CHUNK = 5  # searches that share the composition of a model
# what a worker builds its problem from: a `Problem` holds compiled code
Recipe = Callable[[], Problem]
Variant = Mapping[str, Any]  # settings of an optimizer: {"name": "issa", "levy": False}


def run(
    recipe: Recipe,
    variants: Mapping[str, Variant],
    seeds: int,
    limits: Limits | None = None,
    workers: int | None = None,
    tell: Callable[[int, int], None] = lambda done, total: None,
    remember: bool = True,
    note: Callable[[str], None] = lambda line: None,
) -> dict[str, list[SearchResult]]:
    """Search with every variant under seeds 0, 1, ...; `tell(done, total)` counts the searches
    done.

    One seed gives one history, whatever the number of workers (None: one for each core). What was
    searched before by the same code on the same problem is read back where it is to `remember`, and
    `note` is told; its seconds are those of then.
    """
    problem, limits = recipe(), limits or Limits()
    stored = SearchStore(problem, limits, remember)
    results = {
        label: [stored.get(settings, seed) for seed in range(seeds)]
        for label, settings in variants.items()
    }
    missing = {
        label: [seed for seed in range(seeds) if several[seed] is None]
        for label, several in results.items()
    }
    done, total = 0, sum(map(len, missing.values()))
    if earlier := seeds * len(variants) - total:
        note(
            f"  {earlier} of them were made before by the same code on the same records, and are"
            " read back"
        )
    chunks = [
        (label, part[k : k + CHUNK])
        for label, part in missing.items()
        for k in range(0, len(part), CHUNK)
    ]
    if not chunks:
        return results  # type: ignore[return-value]
    # compiled once, for all
    problem.objective(problem.space.from_unit(np.full((1, problem.space.dimension), 0.5)))
    jobs = [(recipe, dict(variants[label]), part, limits) for label, part in chunks]
    for k, outcome in Workers(workers or -1).completed(_chunk, jobs, len(jobs)):
        label, part = chunks[k]
        for seed, one in zip(part, outcome, strict=True):
            results[label][seed] = one
            stored.put(variants[label], seed, one)
        done += len(part)
        tell(done, total)
    return results  # type: ignore[return-value]


def _chunk(job: tuple[Recipe, dict[str, Any], Sequence[int], Limits]) -> list[SearchResult]:
    recipe, settings, seeds, limits = job
    problem, optimizer = recipe(), build("optimizer", settings)
    return [search(problem, optimizer, seed, limits) for seed in seeds]
