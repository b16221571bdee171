"""Kernel modules: named by the hash of their source, compiled once, kept on disk and checked when they are read."""

import contextlib
import functools
import hashlib
import importlib.metadata
import itertools
import os
import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType
from typing import Any

from tractexp import files, workers
from tractexp.errors import UserError
from tractexp.model import cache
from tractexp.model.cache import cache_folder
from tractexp.model.template import VECTORS
from tractexp.model.vectors import width

NUMBA_KEEPS, WE_KEEP = "njit(cache=True, ", "njit("  # of a kernel's text
ADDRESS = re.compile(r" at 0x[0-9a-f]+>", re.IGNORECASE)  # in the `repr` of what has none of its own


def remembered(parts: Iterable[object], generate: Callable[[], str], what: str = "source") -> str:
    """The text generated for these parts, from the cache where their code and settings are unchanged.

    Deriving a large model takes seconds, reading it back milliseconds. What a text depends on is the settings of
    its parts (their `repr`), every file beside their plugins, this package's own code, and SymPy's version. Of a part
    that stands in no file, such as one typed into a notebook, or whose `repr` tells an address instead of its settings,
    nothing is remembered: another object may stand at that address later.
    """
    parts = tuple(one for part in parts for one in (part, *getattr(part, "members", ())))
    modules = [type(part).__module__ for part in parts]
    written = [getattr(sys.modules.get(module), "__file__", None) for module in modules]
    settings = repr(parts)
    if None in written or ADDRESS.search(settings):
        return generate()
    digest = hashlib.sha256(f"{importlib.metadata.version('sympy')} {modules} {settings}".encode())
    for folder in sorted({Path(__file__).parent, *(Path(file or "").parent for file in written)}):
        digest.update(_code(folder))
    path = cache_folder() / f"{what}_{digest.hexdigest()[:20]}.kept"
    if (held := cache.read(path)) is not None:
        return held.decode()
    text = generate()
    cache.write(path, text.encode())
    return text


@functools.cache
def _code(folder: Path) -> bytes:
    """The code of a folder, read once: an investigation asks for the sources of some thirty models."""
    return b"".join(file.read_bytes() for file in sorted(folder.glob("*.py")))


@functools.cache
def load(source: str) -> ModuleType:
    """The kernel with this source. Safe in parallel processes.

    The source is executed as it is given; the file of the same text is for people. What Numba compiles of it is kept in
    files of ours instead of Numba's own, which are loaded unseen.
    """
    source = _for_this_machine(source)
    name = _name(source)
    path = cache_folder() / f"{name}.py"
    with contextlib.suppress(OSError, UserError):
        if not path.exists() or path.read_bytes() != source.encode():
            files.write(path, source, lasting=False)
    module = ModuleType(f"tractexp_kernels.{name}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module
    exec(compile(source.replace(NUMBA_KEEPS, WE_KEEP), path, "exec"), vars(module))
    if NUMBA_KEEPS in source:
        for function in [f for f in vars(module).values() if hasattr(f, "py_func")]:
            _keep(function, name)
    return module


def kept(function: Any) -> Any:
    """A function that Numba compiles, kept as kernels are; for the loops of a plugin.

    It takes the place of `cache=True`, and is written above `@njit(...)`. The names it hangs on must stand in its file.
    """
    path = Path(function.py_func.__code__.co_filename)
    return _keep(function, f"{path.stem}_{hashlib.sha256(path.read_bytes()).hexdigest()[:20]}")


def _keep(function: Any, name: str) -> Any:
    from tractexp.doors.numba_cache import keep

    return keep(
        function,
        name,
        lambda file: cache.read(cache_folder() / file),
        lambda file, content: cache.write(cache_folder() / file, content),
    )


def compile_missing(sources: Iterable[str], tell: Callable[[], None] = lambda: None) -> None:
    """Compile the kernels that the cache lacks, side by side in processes; `tell` is called once if there are any.

    `sources` may be a generator: what it derives next is derived while others compile.
    """
    missing = (s for s in sources if not any(_compiled(s)))
    first = next(missing, None)
    if first is not None:
        from joblib import Parallel, delayed

        tell()
        with workers.replaced():
            Parallel(n_jobs=os.cpu_count() or 1)(delayed(_compile)(s) for s in itertools.chain((first,), missing))


def _compiled(source: str) -> Iterable[Path]:
    """The sound files of a kernel for this machine."""
    from tractexp.doors.numba_cache import machine

    kernels = cache_folder().glob(f"{_name(_for_this_machine(source))}.run.{machine()}.*.kept")
    return (file for file in kernels if cache.read(file) is not None)


def _compile(source: str) -> None:
    from numba import float64, int64

    table, cube = float64[:, ::1], float64[:, :, ::1]
    load(source).run.compile((cube, table, int64[::1], table, table, table, int64[::1], cube, table, cube))


def _for_this_machine(source: str) -> str:
    """The source with the width of its vectors chosen, so that kernels of another width are other files."""
    return source.replace(f"\n{VECTORS}\n", f"\nVECTORS = {width(cache_folder())}\n", 1)


def _name(source: str) -> str:
    return f"kernel_{hashlib.sha256(source.encode()).hexdigest()[:20]}"
