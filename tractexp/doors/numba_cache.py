"""Where Numba keeps what it compiled: in files of ours, which are looked at before they are loaded.

What: `CompileResult._reduce` and `_rebuild`, which make a compiled function into plain parts and back; the attribute
`_cache` of a dispatcher, with its `load_overload` and `save_overload`; and `numba.core.serialize.dumps`.
Why: `njit(cache=True)` unpickles its index and its object files unseen, beside the source: a changed byte gives another
number without a word, and a planted pickle is run. Nothing public says what it reads.
Since: Numba 0.20; looked at in Numba 0.68.
Upstream: numba/numba#10839 says in the manual that the folder must be as trusted as the code; no check is planned.
When mended (Numba checks what it reads, or lets its cache be replaced): drop this module.
"""

import functools
import hashlib
import pickle
import sys
from collections.abc import Callable
from typing import Any

import llvmlite
import numba
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from tractexp.doors.numba_vector_width import compiled_for

Read = Callable[[str], bytes | None]
Write = Callable[[str, bytes], None]


def keep(dispatcher: Any, name: str, read: Read, write: Write) -> Any:
    """Let a function that `njit` made be read from what is kept, or else compiled and written; returns it.

    `name` stands for its source: another source must have another. `read` gives what `write` was given under a name,
    or None; what it gives is executed.
    """
    dispatcher._cache = _Kept(dispatcher.py_func, name, read, write)
    return dispatcher


@functools.cache
def machine() -> str:
    """Letters that stand for all that compiled code hangs on beside its source: processor, system, versions."""
    told = (compiled_for(), sys.implementation.cache_tag, sys.abiflags, numba.__version__, llvmlite.__version__)
    return hashlib.sha256(repr(told).encode()).hexdigest()[:16]


class _Kept(NullCache):
    def __init__(self, function: Any, name: str, read: Read, write: Write):
        self.function, self.name, self.read, self.write = function, name, read, write

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        target_context.refresh()
        held = self.read(self._file(sig))
        return None if held is None else CompileResult._rebuild(target_context, *pickle.loads(held))

    def save_overload(self, sig: Any, cres: Any) -> None:
        if cres.library.has_dynamic_globals or not all(lifted.can_cache for lifted in cres.lifted):
            return  # holds addresses of this process
        self.write(self._file(sig), dumps(cres._reduce()))

    def _file(self, sig: Any) -> str:
        # the module, too: what is kept looks its names up there, and cannot be loaded once a package has another name
        told = repr((sig, self.function.__module__)).encode() + self.function.__code__.co_code
        digest = hashlib.sha256(told).hexdigest()[:16]
        return f"{self.name}.{self.function.__name__}.{machine()}.{digest}.kept"
