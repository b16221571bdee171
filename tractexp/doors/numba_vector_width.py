"""How wide the vectors are that LLVM makes of one Numba function, and what Numba compiles for.

What: LLVM reads the width from the function attribute `prefer-vector-width`. An intrinsic (public) is given the
function that is being compiled, but its `attributes` (of `llvmlite.ir`) refuse every name they do not know: they are a
set, and `set.add` puts the attribute past that check. Second, `magic_tuple` of Numba's code generator, the very key by
which Numba keeps compiled code apart, tells the processor and its features.
Why: on many processors with AVX-512, LLVM prefers vectors of 256 bits, with which a kernel may take twice as long.
`NUMBA_CPU_FEATURES` changes that too, but for everything Numba compiles in the process, the user's own code included,
and only where it is set before Numba is first used.
Since: LLVM 6 and llvmlite 0.12; looked at in llvmlite 0.50 and Numba 0.68.
Upstream: numba/llvmlite#1348 (attributes that `llvmlite.ir.Function` lacks), open.
When mended: add the attribute with `attributes.add`, and take the features from `llvmlite.binding`.
"""

from typing import Any

from numba import types
from numba.core.registry import cpu_target
from numba.extending import intrinsic


def _prefer_vectors(typing, bits):
    """In a compiled function: ask for vectors of this constant number of bits in it; 0 leaves it to LLVM."""
    if not isinstance(bits, types.IntegerLiteral):
        return None
    wanted = bits.literal_value

    def codegen(context, builder, signature, arguments):
        if wanted:
            set.add(builder.function.attributes, f'"prefer-vector-width"="{wanted}"')
        return context.get_dummy_value()

    return types.void(bits), codegen


prefer_vectors: Any = intrinsic(prefer_literal=True)(_prefer_vectors)


def compiled_for() -> tuple[str, str, str]:
    """What Numba compiles for: the system, the processor, and its features as `+avx512f,-sse4a,...`."""
    context: Any = cpu_target.target_context
    return context.codegen().magic_tuple()
