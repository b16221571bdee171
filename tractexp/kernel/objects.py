"""Object code of kernels: compiled from IR, stored under all that it depends on, loaded once a
process.

An entry is executed, so it is read through `tractexp.cache.store`, which takes nothing that was
not written there whole.
"""

import functools
import itertools
import threading
from typing import Any

from tractexp.cache.store import CODE, compute_key
from tractexp.kernel import target

FUNCTIONS = ("run", "steady")  # what a text may define for callers, one each
_numbers = itertools.count()
_one_at_a_time = threading.Lock()


class MachineCode:
    """A function of machine code, which stays in memory as long as this object."""

    def __init__(self, library: Any, name: str):
        """The function of a name in a loaded library, which lives as long as this does."""
        self._library = library
        self.address: int = library[name]


@functools.cache  # for good: to free one while another thread links the next is not safe
def load(text: str) -> MachineCode:
    """The function that this IR defines, compiled where the store does not hold it."""
    name = next(name for name in FUNCTIONS if f"define void @{name}(" in text)
    from llvmlite import binding as llvm

    code = load_object_code(text)
    with _one_at_a_time:
        library = (
            llvm.JITLibraryBuilder().add_object_img(code).add_current_process().export_symbol(name)
        )
        return MachineCode(library.link(_choose_linker(), f"{name}_{next(_numbers)}"), name)


def load_object_code(text: str) -> bytes:
    """Object code of this IR, from the store or compiled and written there."""
    return CODE.get(compute_key(target.compute_key(), text), lambda: compile_machine_code(text))


def compile_machine_code(text: str, machine: Any = None) -> bytes:
    """Object code of IR, for this machine or another that LLVM knows.

    Of LLVM's passes over IR only the one that reorders sums and products is of use: the text has
    its common values once and its loops as they shall be.
    """
    chosen = machine or target.choose_machine()
    with _one_at_a_time:
        return chosen.emit_object(_prepare_module(text, chosen))


def write_assembly(text: str) -> str:
    """The machine code as assembly, for people and benchmarks to read."""
    with _one_at_a_time:
        return target.choose_machine().emit_assembly(_prepare_module(text, target.choose_machine()))


def _prepare_module(text: str, machine: Any) -> Any:
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
def _choose_linker() -> Any:
    """LLVM's linker that places all sections of an object in one piece of memory.

    Code finds its constants within 2 GB. The older linker places each section where the system has
    room, and where a process has much memory mapped that can be further: it then ends the process.
    """
    from llvmlite import binding as llvm

    return llvm.create_lljit_compiler(target.choose_machine(), use_jit_link=True)
