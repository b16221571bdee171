"""Kernels of many models derived and compiled side by side."""

import os
import time
from collections.abc import Callable, Iterable
from typing import Any

from tractexp import workers
from tractexp.model.model import Model

FEW = 8  # models that one process derives and compiles sooner than several have started
PATIENCE = 2.0  # s: below it nothing is said about compiling


def compile_missing(models: Iterable[Model], tell: Callable[[], None] = lambda: None) -> bool:
    """Derive and compile the kernels that the cache lacks, side by side in processes where they are many.

    `tell` is called once, where it takes longer than `PATIENCE`. Returns whether it was.
    """
    missing = [model for model in models if not model.has_kernel]
    started, said = time.monotonic(), False
    for _ in _compiling(missing):
        if not said and time.monotonic() - started > PATIENCE:
            tell()
            said = True
    return said


def _compiling(missing: list[Model]) -> Iterable[None]:
    if len(missing) <= FEW or (os.cpu_count() or 1) < 2:
        yield from (model.compile() for model in missing)
        return
    from joblib import Parallel, delayed

    with workers.replaced():
        several: Any = Parallel(n_jobs=os.cpu_count() or 1, return_as="generator_unordered")
        yield from several(delayed(_compile)(model.bare()) for model in missing)


def _compile(model: Model) -> None:
    model.compile()
