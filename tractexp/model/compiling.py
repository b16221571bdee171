"""Kernels of many models derived and compiled side by side."""

import os
import time
from collections.abc import Callable, Iterable

from tractexp.model.model import Model
from tractexp.progress import Counting, uncounted
from tractexp.workers import Workers

FEW = 8  # models that one process derives and compiles sooner than several have started
PATIENCE = 2.0  # s: below it nothing is said about compiling


def compile_missing(
    models: Iterable[Model], tell: Callable[[], None] = lambda: None, parts: Callable[[int], Counting] = uncounted
) -> bool:
    """Derive and compile the kernels that the cache lacks, side by side in processes where they are many.

    `tell` is called once, where it takes longer than `PATIENCE`; `parts` counts the kernels. Returns whether it was.
    """
    missing = [model for model in models if not model.has_kernel]
    started, said = time.monotonic(), False
    with parts(len(missing)) if missing else uncounted(0) as ended:
        for _ in _compiling(missing):
            ended()
            if not said and time.monotonic() - started > PATIENCE:
                tell()
                said = True
    return said


def _compiling(missing: list[Model]) -> Iterable[object]:
    if len(missing) <= FEW or (os.cpu_count() or 1) < 2:
        yield from (model.compile() for model in missing)
        return
    yield from Workers(os.cpu_count() or 1).completed(Model.compile, (model.bare() for model in missing), len(missing))
