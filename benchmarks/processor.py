"""The processor on which a stored row holds to the last bits: another rounds otherwise."""

import llvmlite
from llvmlite import binding as llvm

from tractexp.kernel import target


def processor() -> str:
    """LLVM's name of it, the width of its kernels' vectors, and LLVM's version, which writes the machine code."""
    version = ".".join(map(str, llvm.llvm_version_info))
    bits = 64 * target.width()
    return f"{target.processor()[0]}, vectors of {bits} bits, LLVM {version}, llvmlite {llvmlite.__version__}"
