"""Arrays on disk, computed once: read back where the same was computed before, and never otherwise.

What an array depends on is in its name, so a file is either right or not there; a damaged one is made again.
"""

import contextlib
import dataclasses
import hashlib
import importlib.metadata
import io
import platform
import sys
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tractexp import cache, provenance
from tractexp.cache import cache_folder

BEHIND = ("numpy", "scipy", "llvmlite")  # whose versions may change the last digits
DAMAGED = (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile)
SHELVES = {"searches": 3000, "descents": 4000, "draws": 100}  # kept on each, draws of 10 MB, others of some kB


def behind() -> str:
    """What stands behind every number computed here: the code of all plugins, libraries, interpreter, processor."""
    versions = [f"{name} {importlib.metadata.version(name)}" for name in BEHIND]
    return repr((provenance.code(), versions, sys.version, platform.machine(), platform.processor()))


def installed(part: Any) -> bool:
    """Whether a part's code is among that whose digest is taken: a plugin in no installed file may change unseen."""
    file = getattr(sys.modules.get(type(part).__module__), "__file__", None)
    return file is not None and any(Path(file).is_relative_to(folder) for folder in provenance.folders())


def told(*things: Any) -> str:
    """SHA-256 of numbers, texts, arrays, and of collections and dataclasses of them: equal for what is equal."""
    made = hashlib.sha256()
    for thing in things:
        made.update(_told(thing))
    return made.hexdigest()


def _told(thing: Any) -> bytes:
    if isinstance(thing, np.ndarray):
        return f"{thing.dtype.str} {thing.shape} ".encode() + np.ascontiguousarray(thing).tobytes()
    if dataclasses.is_dataclass(thing):
        known = {field.name: getattr(thing, field.name) for field in dataclasses.fields(thing) if field.init}
        return f"{type(thing).__qualname__} ".encode() + _told(known)
    if isinstance(thing, Mapping):
        return b"{%s}" % told(*(item for pair in thing.items() for item in pair)).encode()
    if isinstance(thing, list | tuple):
        return b"[%s]" % told(*thing).encode()
    return f"{type(thing).__name__} {thing!r} ".encode()


def place(shelf: str, what: str) -> Path:
    """Where what this text says is kept."""
    return cache_folder() / shelf / f"{hashlib.sha256(what.encode()).hexdigest()[:40]}.kept"


def read(path: Path) -> dict[str, np.ndarray] | None:
    """The arrays of a file by name; None where it is not there or damaged."""
    held = cache.read(path) or b""
    with contextlib.suppress(*DAMAGED), np.load(io.BytesIO(held), allow_pickle=False) as kept:
        return {name: kept[name] for name in kept.files}
    return None


def keep(path: Path, **arrays: np.ndarray) -> None:
    """Keep arrays; where that is impossible, they are computed again next time."""
    packed = io.BytesIO()
    np.savez_compressed(packed, **arrays)  # type: ignore[arg-type]
    cache.write(path, packed.getvalue())
    with contextlib.suppress(OSError):
        _forget(path.parent)


def arrays(shelf: str, what: str, make: Callable[[], tuple[np.ndarray, ...]]) -> tuple[np.ndarray, ...]:
    """What `make` computes, made only where it was not before; the text says all that it depends on."""
    path = place(shelf, what)
    if (kept := read(path)) is not None:
        return tuple(kept.values())
    made = make()
    keep(path, **{f"arr_{k}": array for k, array in enumerate(made)})
    return made


def damaged(folder: Path) -> list[Path]:
    """The files of a cache's shelves that cannot be read."""
    return [path for shelf in SHELVES for path in (folder / shelf).glob("*.kept") if read(path) is None]


def _forget(folder: Path) -> None:
    """Remove the oldest where there are too many."""
    kept = list(folder.glob("*.kept"))
    if len(kept) > SHELVES.get(folder.name, 0):
        with contextlib.suppress(FileNotFoundError):  # another process forgets, too
            kept.sort(key=lambda path: path.stat().st_mtime)
            for path in kept[: len(kept) - SHELVES[folder.name]]:
                path.unlink(missing_ok=True)
