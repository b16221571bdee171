"""Searches in the store: read back where the same code searched the same problem before, and never
otherwise.

The paper's tables and figures show the same searches over and over, and each has a command of its
own.
"""

import contextlib
import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from tractexp.cache import store
from tractexp.cache.store import DAMAGED, SEARCHES
from tractexp.configuration.plugin import build
from tractexp.identification.search import History, Limits, SearchResult
from tractexp.inference.problem import Problem
from tractexp.storage import files

ARRAYS = ("simulations", "objective", "values", "seconds")  # of a history


class SearchStore:
    """The searches of one problem under some limits, by optimizer and seed.

    The key of a search is the code, the libraries and the processor, the records, the model with
    its bounds, the loss, the optimizer's settings, the seed and the limits. A search with a limit
    in seconds depends on more, and a plugin that stands in no installed file may change unseen:
    these are not stored.
    """

    def __init__(self, problem: Problem, limits: Limits, on: bool = True):
        """The store of one problem's searches, where they can be told apart: no limit of time, all
        parts installed.
        """
        stored = (
            on
            and limits.seconds is None
            and all(map(store.is_installed, (*_list_parts(problem), problem.loss)))
        )
        self.problem = _compute_key(problem, limits) if stored else ""

    def get(self, settings: Mapping[str, Any], seed: int) -> SearchResult | None:
        """The search of an entry; None where there is none, or it is damaged."""
        if (entry := SEARCHES.read_arrays(self._key(settings, seed))) is None:
            return None
        with contextlib.suppress(*DAMAGED):
            history = History(**{name: entry[name] for name in ARRAYS})
            return SearchResult(
                **json.loads(str(entry["ending"])), values=entry["found"], history=history
            )
        return None

    def store_result(self, settings: Mapping[str, Any], seed: int, result: SearchResult) -> None:
        """Keep a result."""
        ending = {k: v for k, v in vars(result).items() if k not in ("values", "history")}
        arrays = {name: getattr(result.history, name) for name in ARRAYS}
        key = self._key(settings, seed)
        SEARCHES.write_arrays(
            key,
            ending=np.array(json.dumps(files.make_plain(ending))),
            found=result.values,
            **arrays,
        )

    def arrays(
        self, what: str, compute: Callable[[], tuple[np.ndarray, ...]]
    ) -> tuple[np.ndarray, ...]:
        """Arrays of something else that is computed for this problem, as `what` says, or of its
        entry.
        """
        return SEARCHES.arrays(self.problem and store.compute_key(self.problem, what), compute)

    def _key(self, settings: Mapping[str, Any], seed: int) -> str:
        """The key of a search; "" where it cannot be kept."""
        optimizer = build("optimizer", dict(settings))
        return (
            store.compute_key(self.problem, repr(optimizer), seed)
            if self.problem and store.is_installed(optimizer)
            else ""
        )


def _list_parts(problem: Problem) -> tuple[Any, ...]:
    """The plugins that a problem is made of."""
    return problem.model.motor, problem.model.static, *problem.model.effects


def _compute_key(problem: Problem, limits: Limits) -> str:
    """The key of all that a search of this problem depends on, but for the optimizer
    and the seed.
    """
    return store.compute_key(
        store.describe_environment(),
        repr((_list_parts(problem), problem.loss, limits)),
        problem.digest(),
    )
