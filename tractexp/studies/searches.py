"""Many searches on the cores of this computer, without composing a configuration for each."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.configuration.plugin import build, place_in_plugin
from tractexp.errors import UserError
from tractexp.identification.optimizer import Optimizer
from tractexp.identification.search import Limits, SearchResult, search
from tractexp.inference.problem import Problem
from tractexp.process.workers import Workers
from tractexp.studies.search_store import SearchStore

CHUNK = 5  # searches that share the composition of a model
TRIES = 2  # how often searches are made whose worker is killed
KILLED = f"its worker was killed {TRIES} times; is there enough memory for it?"
# what a worker builds its problem from: a `Problem` holds compiled code
Recipe = Callable[[], Problem]
Variant = Mapping[str, Any]  # settings of an optimizer: {"name": "issa", "levy": False}


@dataclass(frozen=True)
class FailedSearch:
    """A search that ended with an error: the sentence on it."""

    why: str


@dataclass(frozen=True)
class _Chunk:
    """The searches that a worker is sent. The optimizer goes as it was built, so that the worker
    imports the module of a plugin that stands in no installed package.
    """

    label: str
    seeds: Sequence[int]
    optimizer: Optimizer
    recipe: Recipe
    limits: Limits


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
    """Search with every variant under seeds 0, 1, ..., as `attempt`. Raises `UserError` where a
    search failed.
    """
    made = attempt(recipe, variants, range(seeds), limits, workers, tell, remember, note)
    for label, several in made.items():
        for seed, one in enumerate(several):
            if isinstance(one, FailedSearch):
                raise UserError(f"the search by {label} with seed {seed} failed: {one.why}")
    return made  # type: ignore[return-value]


def _cut_chunks(
    missing: Mapping[str, Sequence[int]],
    variants: Mapping[str, Variant],
    recipe: Recipe,
    limits: Limits,
) -> Iterator[_Chunk]:
    """The searches of each variant under the seeds that it misses, `CHUNK` at a time."""
    for label, seeds in missing.items():
        for k in range(0, len(seeds), CHUNK):
            optimizer = build("optimizer", variants[label])
            yield _Chunk(label, seeds[k : k + CHUNK], optimizer, recipe, limits)


def attempt(
    recipe: Recipe,
    variants: Mapping[str, Variant],
    seeds: Sequence[int],
    limits: Limits | None = None,
    workers: int | None = None,
    tell: Callable[[int, int], None] = lambda done, total: None,
    remember: bool = True,
    note: Callable[[str], None] = lambda line: None,
) -> dict[str, list[SearchResult | FailedSearch]]:
    """Search with every variant under each of the seeds; `tell(done, total)` counts those done.

    One seed gives one history, whatever the number of workers (None: one for each core). What was
    searched before by the same code on the same problem is read back where it is to `remember`, and
    `note` is told; its seconds are those of then.
    """
    problem, limits = recipe(), limits or Limits()
    stored = SearchStore(problem, limits, remember)
    results: dict[str, dict[int, Any]] = {
        label: {seed: stored.get(settings, seed) for seed in seeds}
        for label, settings in variants.items()
    }
    missing = {
        label: [seed for seed in seeds if several[seed] is None]
        for label, several in results.items()
    }
    done, total = 0, sum(map(len, missing.values()))
    if earlier := len(seeds) * len(variants) - total:
        note(
            f"  {earlier} of them were made before by the same code on the same records, and are"
            " read back"
        )
    chunks = list(_cut_chunks(missing, variants, recipe, limits))
    if chunks:  # compiled once, for all
        problem.objective(problem.space.from_unit(np.full((1, problem.space.dimension), 0.5)))
    for chunk, outcome in Workers(workers or -1).results(_search_chunk, chunks, TRIES):
        ends = outcome or [FailedSearch(KILLED)] * len(chunk.seeds)
        for seed, one in zip(chunk.seeds, ends, strict=True):
            results[chunk.label][seed] = one
            if isinstance(one, SearchResult):
                stored.store_result(variants[chunk.label], seed, one)
        done += len(chunk.seeds)
        tell(done, total)
    return {label: [several[seed] for seed in seeds] for label, several in results.items()}


def _search_chunk(chunk: _Chunk) -> list[SearchResult | FailedSearch]:
    """The results of a chunk's seeds, in order; runs in a worker."""
    problem = chunk.recipe()
    return [_search_once(problem, chunk, seed) for seed in chunk.seeds]


def _search_once(problem: Problem, chunk: _Chunk, seed: int) -> SearchResult | FailedSearch:
    """One search, or why it failed: a fault of one plugin ends no search of the others."""
    try:
        return search(problem, chunk.optimizer, seed, chunk.limits)
    except UserError as error:
        return FailedSearch(str(error))
    except Exception as error:
        place = place_in_plugin(error)
        where = f" in {place}" if place else ""
        return FailedSearch(f"{type(error).__name__}{where}: {error}")
