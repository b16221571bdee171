"""Searches on disk: read back where the same code searched the same problem before, and never otherwise.

The paper's tables and figures show the same searches over and over, and each is made by a command of its own.
"""

import contextlib
import hashlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tractexp import files
from tractexp.identification import shelf
from tractexp.identification.problem import Problem
from tractexp.identification.search import History, Limits, SearchResult
from tractexp.identification.shelf import DAMAGED, installed
from tractexp.plugin import build

SHELF = "searches"
ARRAYS = ("simulations", "objective", "values", "seconds")  # of a history


class Remembered:
    """The searches of one problem under some limits, by optimizer and seed.

    What a search depends on is in its name: the code, the libraries and the processor, the records, the model with its
    bounds, the loss, the optimizer's settings, the seed and the limits. A search with a limit in seconds depends on
    more, and a plugin that stands in no installed file may change unseen: of these nothing is kept.
    """

    def __init__(self, problem: Problem, limits: Limits, on: bool = True):
        self.on = on and limits.seconds is None and all(map(installed, (*_parts(problem), problem.loss)))
        self.problem = _digest(problem, limits) if self.on else ""

    def get(self, settings: Mapping[str, Any], seed: int) -> SearchResult | None:
        """The search that was made before; None where there is none, or its file is damaged."""
        path = self._path(settings, seed)
        if path is None or (kept := shelf.read(path)) is None:
            return None
        with contextlib.suppress(*DAMAGED):
            history = History(**{name: kept[name] for name in ARRAYS})
            return SearchResult(**json.loads(str(kept["told"])), values=kept["found"], history=history)
        return None

    def put(self, settings: Mapping[str, Any], seed: int, found: SearchResult) -> None:
        """Keep a search; where that is impossible, it is made again next time."""
        path = self._path(settings, seed)
        if path is None:
            return
        told = {k: v for k, v in vars(found).items() if k not in ("values", "history")}
        arrays = {name: getattr(found.history, name) for name in ARRAYS}
        shelf.keep(path, told=np.array(json.dumps(files.plain(told))), found=found.values, **arrays)

    def arrays(self, told: str, make: Callable[[], tuple[np.ndarray, ...]]) -> tuple[np.ndarray, ...]:
        """What else was computed for this problem from what is `told`, made only where it was not before."""
        return shelf.arrays(SHELF, f"{self.problem} {told}", make) if self.on else make()

    def _path(self, settings: Mapping[str, Any], seed: int) -> Path | None:
        optimizer = build("optimizer", dict(settings))
        return self._file(f"{optimizer!r} {seed}") if self.on and installed(optimizer) else None

    def _file(self, told: str) -> Path:
        return shelf.place(SHELF, f"{self.problem} {told}")


def _parts(problem: Problem) -> tuple[Any, ...]:
    return problem.model.motor, problem.model.static, *problem.model.effects


def _digest(problem: Problem, limits: Limits) -> str:
    """SHA-256 of all that a search of this problem depends on, but for the optimizer and the seed."""
    told = shelf.behind(), _parts(problem), problem.loss, limits, problem.digest()
    return hashlib.sha256(repr(told).encode()).hexdigest()
