"""SciPy, imported without what only its manual and other array libraries need.

What: within `light`, `scipy._lib._docscrape.FunctionDoc` leaves docstrings as they are, and `numpy.f2py` is a module
that is loaded when it is used (`importlib.util.LazyLoader`).
Why: at its import SciPy takes some 280 docstrings apart and writes them anew with a note on array libraries, and looks
at every name of NumPy, which loads the compiler of Fortran interfaces: a third of what importing `scipy.special`,
`linalg` and `optimize` takes, 0.15 s of CPU in each command that fits.
Since: SciPy 1.15; looked at in 1.17.
Upstream: not reported yet.
When mended: drop this module and its call.
"""

import importlib
import importlib.util
import inspect
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def light() -> Iterator[None]:
    """Within it SciPy is imported faster. What was imported before stays as it is."""
    _load_later("numpy.f2py")
    try:
        docscrape: Any = importlib.import_module("scipy._lib._docscrape")
    except ImportError:  # before SciPy 1.15
        yield
        return
    written_anew, docscrape.FunctionDoc = docscrape.FunctionDoc, Unchanged
    try:
        yield
    finally:
        docscrape.FunctionDoc = written_anew


class Unchanged(dict[str, list[Any]]):
    """A docstring that is as it was, whatever is added to its sections."""

    def __init__(self, function: Callable[..., Any], **_: Any):
        super().__init__()
        self.text = inspect.getdoc(function) or ""

    def __missing__(self, section: str) -> list[Any]:
        return []

    def __str__(self) -> str:
        return f"\n{self.text}"  # its users take off the line of a signature


def _load_later(name: str) -> None:
    spec = importlib.util.find_spec(name)
    if name in sys.modules or spec is None or spec.loader is None:
        return
    spec.loader = importlib.util.LazyLoader(spec.loader)
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    package, _, last = name.rpartition(".")
    setattr(sys.modules[package], last, module)
