"""Object code of kernels: compiled from IR, kept on disk under all that it hangs on, loaded once a process.

What is kept is executed, so it is read through `tractexp.cache`, which takes nothing that was not written there whole.
"""

import functools
import hashlib
import itertools
import threading
from typing import Any

from tractexp import cache
from tractexp.kernel import target

FUNCTIONS = ("run", "steady")  # what a text may define for callers, one each
_numbers = itertools.count()
_one_at_a_time = threading.Lock()


class Code:
    """A function of machine code, which stays in memory as long as this object."""

    def __init__(self, library: Any, name: str):
        self._library = library
        self.address: int = library[name]


@functools.lru_cache(maxsize=512)
def load(text: str) -> Code:
    """The function that this IR defines, compiled where the cache does not hold it."""
    name = next(name for name in FUNCTIONS if f"define void @{name}(" in text)
    from llvmlite import binding as llvm

    code = keep(text)
    with _one_at_a_time:
        library = llvm.JITLibraryBuilder().add_object_img(code).add_current_process().export_symbol(name)
        return Code(library.link(_linker(), f"{name}_{next(_numbers)}"), name)


def available(text: str) -> bool:
    """Whether the cache holds sound object code of this IR for this machine."""
    return cache.read(_path(text)) is not None


def keep(text: str) -> bytes:
    """Object code of this IR, from the cache or compiled and written there."""
    path = _path(text)
    code = cache.read(path)
    if code is None:
        code = machine_code(text)
        cache.write(path, code)
    return code


def _path(text: str) -> Any:
    digest = hashlib.sha256(f"{target.key()}\n{text}".encode())
    return cache.cache_folder() / f"code_{digest.hexdigest()[:32]}.kept"


def machine_code(text: str, machine: Any = None) -> bytes:
    """Object code of IR, for this machine or another that LLVM knows.

    Of LLVM's passes over IR only the one that reorders sums and products is of use: the text has its common values once
    and its loops as they shall be.
    """
    chosen = machine or target.machine()
    with _one_at_a_time:
        return chosen.emit_object(_ready(text, chosen))


def assembly(text: str) -> str:
    """The same as assembly, for people and benchmarks to read."""
    with _one_at_a_time:
        return target.machine().emit_assembly(_ready(text, target.machine()))


def _ready(text: str, machine: Any) -> Any:
    """The module of a text, its passes made."""
    from llvmlite import binding as llvm

    module = llvm.parse_assembly(text, llvm.create_context())
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    module.verify()
    passes = llvm.create_new_module_pass_manager()
    passes.add_reassociate_pass()
    passes.run(module, llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options()))
    return module


@functools.cache
def _linker() -> Any:
    from llvmlite import binding as llvm

    return llvm.create_lljit_compiler(target.machine())
