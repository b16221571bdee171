"""The processor on which a stored row holds to the last bits: another rounds otherwise."""

import llvmlite
from llvmlite import binding as llvm

from tractexp.kernel import target

# of the widest vectors of processors with a feature; of others 128
BITS = {"avx512f": 512, "avx": 256}


def processor() -> str:
    """LLVM's name of it, the width of its kernels' vectors, and LLVM's version, which writes the
    machine code.
    """
    version = ".".join(map(str, llvm.llvm_version_info))
    name, features = target.describe_processor()
    bits = next(
        (wide for feature, wide in BITS.items() if f"+{feature}" in features.split(",")), 128
    )
    return f"{name}, vectors of {bits} bits, LLVM {version}, llvmlite {llvmlite.__version__}"
