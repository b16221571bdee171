"""How wide the vectors of kernels are: measured once on a machine with AVX-512 and remembered beside the kernels.

Compilers avoid vectors of 512 bits because some processors lower their clock for them; whether that costs more than it
gains depends on the processor. A kernel is the same to the bit with either, so only time is at stake.
"""

import contextlib
import functools
import hashlib
import math
import time
from collections.abc import Callable
from pathlib import Path

from tractexp import files
from tractexp.errors import UserError
from tractexp.model.template import FAST, GROUP, LANES

WIDTHS: tuple[int, ...] = (256, 512)  # bits
SAMPLES, ROUNDS = 200, 300  # of the race between them: some 50 ms
ROWS = 8
P0, P1, P2, P3, P4, P5, P6, P7, P8, P9 = (1.0 / math.factorial(k) for k in range(10, 0, -1))


@functools.cache
def width(folder: Path) -> int:
    """Bits of the vectors that kernels in this cache folder are made for; 0 where there is nothing to choose.

    The first process that has measured decides for all others.
    """
    import llvmlite
    import numba

    from tractexp.doors.numba_vector_width import compiled_for

    machine = compiled_for()
    if "+avx512f" not in machine[-1].split(","):
        return 0
    key = hashlib.sha256(f"{machine} {numba.__version__} {llvmlite.__version__}".encode()).hexdigest()[:20]
    path = folder / f"vectors_{key}.txt"
    chosen = _read(path)
    if chosen is None:
        measured = faster()
        with contextlib.suppress(UserError):  # a full disk: the bits are the same with either
            files.offer(path, f"{measured}\n")
        chosen = _read(path) or measured
    return chosen


def _read(path: Path) -> int | None:
    """What is remembered; a damaged file is removed, so that it is measured again."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return None
    chosen = next((bits for bits in WIDTHS if content == f"{bits}\n".encode()), None)
    if chosen is None:
        path.unlink(missing_ok=True)
    return chosen


def faster() -> int:
    """The width with which a loop like a kernel's takes less time here: the fastest of many rounds of each, in turn."""
    import numpy as np

    U, W = 1.0 - 0.3 * np.sin(np.arange(SAMPLES) / 20), np.empty(ROWS * LANES + 8)
    W = W[(64 - W.ctypes.data % 64) // 8 :]
    races, best = {bits: _race(bits) for bits in WIDTHS}, {bits: np.inf for bits in WIDTHS}
    for _ in range(ROUNDS):
        for bits, race in races.items():
            W.fill(0.5)
            started = time.perf_counter()
            race(W, U, LANES // GROUP)
            best[bits] = min(best[bits], time.perf_counter() - started)
    return min(best, key=best.__getitem__)


def _race(bits: int) -> Callable:
    """A loop like a kernel's: steps of three states by Runge-Kutta, and an exponential's polynomial for the sum."""
    from numba import njit

    from tractexp.doors.numba_vector_width import prefer_vectors

    @njit(fastmath=set(FAST), error_model="numpy", nogil=True)
    def race(W, U, groups):
        prefer_vectors(bits)
        for i in range(len(U) - 1):
            u, v = U[i], U[i + 1]
            m = 0.5 * (u + v)
            for k in range(GROUP * groups):
                x, y, z, total = W[k], W[LANES + k], W[2 * LANES + k], W[3 * LANES + k]
                a, b, c, d = W[4 * LANES + k], W[5 * LANES + k], W[6 * LANES + k], W[7 * LANES + k]
                r = a * u
                p = (((((r * P0 + P1) * r + P2) * r + P3) * r + P4) * r + P5) * r
                p = ((((p + P6) * r + P7) * r + P8) * r + P9) * r + 1.0 - u * y * b
                x1, y1, z1 = y * z - x * a + b * u, -y * a - x * z, c - y * u * d
                s, t, w = x + 5e-4 * x1, y + 5e-4 * y1, z + 5e-4 * z1
                x2, y2, z2 = t * w - s * a + b * m, -t * a - s * w, c - t * m * d
                s, t, w = x + 5e-4 * x2, y + 5e-4 * y2, z + 5e-4 * z2
                x3, y3, z3 = t * w - s * a + b * m, -t * a - s * w, c - t * m * d
                s, t, w = x + 1e-3 * x3, y + 1e-3 * y3, z + 1e-3 * z3
                x4, y4, z4 = t * w - s * a + b * v, -t * a - s * w, c - t * v * d
                W[k] = x + 1e-3 / 6.0 * (x1 + 2.0 * (x2 + x3) + x4)
                W[LANES + k] = y + 1e-3 / 6.0 * (y1 + 2.0 * (y2 + y3) + y4)
                W[2 * LANES + k] = z + 1e-3 / 6.0 * (z1 + 2.0 * (z2 + z3) + z4)
                W[3 * LANES + k] = total + p * p

    return race
