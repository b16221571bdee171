"""What kernels are compiled for: this processor, as LLVM tells it, or the most general one of its
kind.

LLVM is loaded where it is first needed, which takes longer than what a command without a simulation
does.
"""

import functools
import os
from typing import Any

from tractexp.errors import check_choice

# the environment's; set to `generic` results do not hang on the processor
CHOICE, GENERIC = "TRACTEXP_CPU", "generic"


@functools.cache
def describe_processor() -> tuple[str, str]:
    """LLVM's name of the processor and its features, as `+avx2,-avx512f,...`.

    Raises `UserError` where TRACTEXP_CPU is set to anything but `generic`.
    """
    if chosen := os.environ.get(CHOICE):
        check_choice(CHOICE, chosen, (GENERIC,))
        return GENERIC, ""
    from llvmlite import binding as llvm

    return llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


@functools.cache
def choose_machine() -> Any:
    """LLVM's target machine."""
    from llvmlite import binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    name, features = describe_processor()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=name, features=features, opt=2, reloc="pic", codemodel="small"
    )


@functools.cache
def compute_key() -> str:
    """All that object code hangs on beside its text: system, processor, features, and the versions
    of LLVM.
    """
    import llvmlite
    from llvmlite import binding as llvm

    return repr(
        (
            llvm.get_process_triple(),
            describe_processor(),
            llvm.llvm_version_info,
            llvmlite.__version__,
        )
    )
