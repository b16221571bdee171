"""Kernel modules on disk: named by the hash of their source, imported as real modules, compiled once."""

import functools
import hashlib
import importlib.metadata
import importlib.util
import itertools
import os
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType

from tractexp.files import write
from tractexp.model.template import VECTORS
from tractexp.model.vectors import width


def cache_folder() -> Path:
    """Where kernels are kept: $TRACTEXP_CACHE_DIR, or `tractexp` in the user's cache folder, or a temporary one."""
    if chosen := os.environ.get("TRACTEXP_CACHE_DIR"):
        candidates = [Path(chosen)]
    else:
        user = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or Path.home() / ".cache"
        candidates = [Path(user) / "tractexp", Path(tempfile.gettempdir()) / f"tractexp-{os.getpid()}"]
    for folder in candidates:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    raise OSError(f"no kernel cache can be written; tried {', '.join(map(str, candidates))}; set TRACTEXP_CACHE_DIR")


def remembered(parts: Iterable[object], generate: Callable[[], str], what: str = "source") -> str:
    """The text generated for these parts, from the cache where their code and settings are unchanged.

    Deriving a large model takes seconds, reading it back milliseconds. What a text depends on is the settings of
    its parts (their `repr`), every file beside their plugins, this package's own code, and SymPy's version. Of a part
    that stands in no file, such as one typed into a notebook, nothing is remembered.
    """
    parts = tuple(one for part in parts for one in (part, *getattr(part, "members", ())))
    modules = [type(part).__module__ for part in parts]
    files = [getattr(sys.modules.get(module), "__file__", None) for module in modules]
    if None in files:
        return generate()
    digest = hashlib.sha256(f"{importlib.metadata.version('sympy')} {modules} {parts!r}".encode())
    for folder in sorted({Path(__file__).parent, *(Path(file or "").parent for file in files)}):
        digest.update(_code(folder))
    path = cache_folder() / f"{what}_{digest.hexdigest()[:20]}.txt"
    if path.exists():
        return path.read_text()
    text = generate()
    _write(path, text)
    return text


@functools.cache
def _code(folder: Path) -> bytes:
    """The code of a folder, read once: an investigation asks for the sources of some thirty models."""
    return b"".join(file.read_bytes() for file in sorted(folder.glob("*.py")))


@functools.cache
def load(source: str) -> ModuleType:
    """Import the kernel with this source, writing it first where it is new. Safe in parallel processes."""
    source = _for_this_machine(source)
    name = _name(source)
    path = cache_folder() / f"{name}.py"
    if not path.exists() or path.read_text() != source:
        _write(path, source)
    spec = importlib.util.spec_from_file_location(f"tractexp_kernels.{name}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def compile_missing(sources: Iterable[str], tell: Callable[[], None] = lambda: None) -> None:
    """Compile the kernels that the cache lacks, side by side in processes; `tell` is called once if there are any.

    `sources` may be a generator: what it derives next is derived while others compile.
    """
    missing = (s for s in sources if not any(_compiled(s)))
    first = next(missing, None)
    if first is not None:
        from joblib import Parallel, delayed

        tell()
        Parallel(n_jobs=os.cpu_count() or 1)(delayed(_compile)(s) for s in itertools.chain((first,), missing))


def _compiled(source: str) -> Iterable[Path]:
    return (cache_folder() / "__pycache__").glob(f"{_name(_for_this_machine(source))}.run-*.nbc")


def _compile(source: str) -> None:
    from numba import float64, int64

    table, cube = float64[:, ::1], float64[:, :, ::1]
    load(source).run.compile((cube, table, int64[::1], table, table, table, int64[::1], cube, table, cube))


def _for_this_machine(source: str) -> str:
    """The source with the width of its vectors chosen, so that kernels of another width are other files."""
    return source.replace(f"\n{VECTORS}\n", f"\nVECTORS = {width(cache_folder())}\n", 1)


def _name(source: str) -> str:
    return f"kernel_{hashlib.sha256(source.encode()).hexdigest()[:20]}"


def _write(path: Path, source: str) -> None:
    """Write in one move and with a fixed time stamp: Numba's cache is keyed by it, whoever writes first."""
    write(path, source, lasting=False, modified=0.0)
