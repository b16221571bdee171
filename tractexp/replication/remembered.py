"""Searches on disk: read back where the same code searched the same problem before, and never otherwise.

The paper's tables and figures show the same searches over and over, and each is made by a command of its own.
"""

import contextlib
import hashlib
import importlib.metadata
import io
import json
import platform
import sys
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tractexp import files, provenance
from tractexp.identification.problem import Problem
from tractexp.identification.search import Found, History, Limits
from tractexp.model import cache
from tractexp.model.cache import cache_folder
from tractexp.plugin import build

MOST = 3000  # searches that are kept, of some 20 kB each, four studies of 30 seeds: beyond, the oldest go
BEHIND = ("numpy", "numba", "scipy", "llvmlite")  # whose versions may change the last digits
DAMAGED = (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile)
ARRAYS = ("simulations", "objective", "values", "seconds")  # of a history


class Remembered:
    """The searches of one problem under some limits, by optimizer and seed.

    What a search depends on is in its name: the code, the libraries and the processor, the records, the model with its
    bounds, the loss, the optimizer's settings, the seed and the limits. A search with a limit in seconds depends on
    more, and a plugin that stands in no installed file may change unseen: of these nothing is kept.
    """

    def __init__(self, problem: Problem, limits: Limits, on: bool = True):
        self.on = on and limits.seconds is None and all(map(_installed, (*_parts(problem), problem.loss)))
        self.problem = _digest(problem, limits) if self.on else ""

    def get(self, settings: Mapping[str, Any], seed: int) -> Found | None:
        """The search that was made before; None where there is none, or its file is damaged."""
        path = self._path(settings, seed)
        held = cache.read(path) if path else None
        if held is None:
            return None
        with contextlib.suppress(*DAMAGED), np.load(io.BytesIO(held), allow_pickle=False) as kept:
            history = History(**{name: kept[name] for name in ARRAYS})
            return Found(**json.loads(str(kept["told"])), values=kept["found"], history=history)
        return None

    def put(self, settings: Mapping[str, Any], seed: int, found: Found) -> None:
        """Keep a search; where that is impossible, it is made again next time."""
        path = self._path(settings, seed)
        if path is None:
            return
        told = {k: v for k, v in vars(found).items() if k not in ("values", "history")}
        made = io.BytesIO()
        arrays = {name: getattr(found.history, name) for name in ARRAYS}
        np.savez_compressed(made, told=np.array(json.dumps(files.plain(told))), found=found.values, **arrays)
        _keep(path, made.getvalue())

    def arrays(self, told: str, make: Callable[[], tuple[np.ndarray, ...]]) -> tuple[np.ndarray, ...]:
        """What else was computed for this problem from what is `told`, made only where it was not before."""
        if not self.on:
            return make()
        path = self._file(told)
        held = cache.read(path) or b""
        with contextlib.suppress(*DAMAGED), np.load(io.BytesIO(held), allow_pickle=False) as kept:
            return tuple(kept[name] for name in kept.files)
        made = make()
        written = io.BytesIO()
        np.savez_compressed(written, *made)
        _keep(path, written.getvalue())
        return made

    def _path(self, settings: Mapping[str, Any], seed: int) -> Path | None:
        optimizer = build("optimizer", dict(settings))
        return self._file(f"{optimizer!r} {seed}") if self.on and _installed(optimizer) else None

    def _file(self, told: str) -> Path:
        name = hashlib.sha256(f"{self.problem} {told}".encode()).hexdigest()[:40]
        return cache_folder() / "searches" / f"{name}.kept"


def _keep(path: Path, content: bytes) -> None:
    cache.write(path, content)
    with contextlib.suppress(OSError):
        _forget(path.parent)


def _parts(problem: Problem) -> tuple[Any, ...]:
    return problem.model.motor, problem.model.static, *problem.model.effects


def _installed(part: Any) -> bool:
    """Whether a part's code is among that whose digest is taken."""
    file = getattr(sys.modules.get(type(part).__module__), "__file__", None)
    return file is not None and any(Path(file).is_relative_to(folder) for folder in provenance.folders())


def _digest(problem: Problem, limits: Limits) -> str:
    """SHA-256 of all that a search of this problem depends on, but for the optimizer and the seed."""
    versions = [f"{name} {importlib.metadata.version(name)}" for name in BEHIND]
    told = (
        provenance.code(), versions, sys.version, platform.machine(), platform.processor(), _parts(problem),
        problem.loss, limits, problem.digest(),
    )  # fmt: skip
    return hashlib.sha256(repr(told).encode()).hexdigest()


def _forget(folder: Path) -> None:
    """Remove the oldest searches where there are too many."""
    kept = list(folder.glob("*.kept"))
    if len(kept) > MOST:
        kept.sort(key=lambda path: path.stat().st_mtime)
        for path in kept[: len(kept) - MOST]:
            path.unlink(missing_ok=True)
