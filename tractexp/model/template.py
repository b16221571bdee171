"""What every generated kernel has in common: its text, with gaps that the code generator fills."""

LANES = 56  # candidates advanced together at most: enough to fill the waits of one step; rows 448 bytes apart do not
# fall on one another in the cache as those a power of two apart do
GROUP = 8  # they are rounded up to a multiple of it: whole vectors of up to 512 bits, since a remainder is slow
FAST = ("contract", "reassoc", "arcp", "nsz")
VECTORS = "VECTORS = 0"  # the line of a kernel that says how wide its vectors are [bits]; 0: as the compiler likes

HEADER = '''"""Generated from the equations of {title}. Do not edit: the file's name is the hash of its content."""

import math

import numpy as np
from numba import njit

from tractexp.doors.numba_vector_width import prefer_vectors

{vectors}
FAST = set({fast})  # nan and inf keep their meaning: they mark diverged candidates
compiled = njit(cache=True, fastmath=FAST, error_model="numpy", nogil=True)
# A call would stop the vectoriser, and may reach another copy of the function, with other bits, when it was just
# compiled than when it was loaded from the cache.
inlined = njit(cache=True, fastmath=FAST, error_model="numpy", nogil=True, forceinline=True)
ordered = njit(cache=True, fastmath=FAST - {{"reassoc"}}, error_model="numpy", nogil=True, forceinline=True)


@ordered
def _exp(x):
    """Branch-free exp, relative error below 4e-13 for |x| < 700: a libm call would stop the vectoriser."""
    x = min(max(x, -700.0), 700.0)
    t = x * 1.4426950408889634 + 6755399441055744.0  # 1.5 * 2**52: rounds, and leaves the integer in the lowest bits
    r = x - (t - 6755399441055744.0) * 0.6931471805599453
    p = r * 2.7557319223985893e-07 + 2.7557319223985893e-06
    p = p * r + 2.48015873015873e-05
    p = p * r + 0.0001984126984126984
    p = p * r + 0.001388888888888889
    p = p * r + 0.008333333333333333
    p = p * r + 0.041666666666666664
    p = p * r + 0.16666666666666666
    p = p * r + 0.5
    p = p * r + 1.0
    p = p * r + 1.0
    return p * np.int64((np.float64(t).view(np.int64) << 52) + (1023 << 52)).view(np.float64)


@inlined
def _log(x):
    """Branch-free logarithm, error below 1e-14 of the larger of 1 and itself; -709 at 0, nan stays nan."""
    bits = np.float64(x).view(np.int64)
    k = (bits - 0x3FE6A09E667F3BCD) >> 52  # so that what is left lies between sqrt(1/2) and sqrt(2)
    m = np.int64(bits - (k << 52)).view(np.float64)
    s = (m - 1.0) / (m + 1.0)
    t = s * s
    p = t * 0.05882352941176471 + 0.06666666666666667
    p = p * t + 0.07692307692307693
    p = p * t + 0.09090909090909091
    p = p * t + 0.1111111111111111
    p = p * t + 0.14285714285714285
    p = p * t + 0.2
    p = p * t + 0.3333333333333333
    p = p * t + 1.0
    return k * 0.6931471805599453 + 2.0 * s * p + (x - x)


@inlined
def _cubic(a, b, da, db, x):
    """Value at x in [0, 1] of the cubic with these end values and slopes."""
    rise = b - a
    return a + x * (da + x * (3.0 * rise - 2.0 * da - db + x * (da + db - 2.0 * rise)))


@inlined
def _slope(a, b, da, db, x):
    """Slope of that cubic."""
    rise = b - a
    return da + x * (2.0 * (3.0 * rise - 2.0 * da - db) + 3.0 * x * (da + db - 2.0 * rise))
'''

RUN = '''

@compiled
def run(candidates, event, first, inputs, measured, weights, substeps, sums, miss, outputs):
    """Simulate candidates over events and sum their weighted squared errors.

    candidates (events, rows, n): {rows};
    event (events, {n_event}): {event}; first (events + 1,): where each event starts in the samples;
    inputs (rows as in INPUTS, N), of which are used: {inputs};
    measured, weights ({C}, N): {outputs}; substeps (events,); sums (events, {C}, n) and miss (events, n) are written;
    outputs ({C}, n, N) or empty.
    """
    prefer_vectors(VECTORS)
    n = candidates.shape[2]
    store = outputs.shape[0] > 0
    space = np.empty({rows_W} * {L} + 8)
    W = space[(64 - space.ctypes.data % 64) // 8 :]  # a vector across two cache lines would take twice the time
    signals = np.empty(({n_signal}, inputs.shape[1]))
    for e in range(candidates.shape[0]):
{unpack_event}
        h = step / substeps[e]
{fill_signals}
        for begin in range(0, n, {L}):
            some = min(n - begin, {L})
            lanes = {G} * ((some + {G} - 1) // {G})
            reachable = False
            for l in range(lanes):
                k = min(begin + l, n - 1)
{start}
                reachable = reachable or m <= 0.0
{no_sums}
                W[{row_miss} + l] = m
            if reachable:
                for i in range(first[e], first[e + 1]):
{sample}
                    if store:
                        for l in range(some):
{store}
                    if i + 1 < first[e + 1]:
{advance}
            for l in range(some):
{sums}
                miss[e, begin + l] = W[{row_miss} + l]
'''

SETTLE = """

@inlined
def _settle({arguments}):
    \"\"\"Solve for the steady state before the event by Newton's method; last, how far it misses.\"\"\"
    x, f, g, J = np.array([{states}]), np.empty({n}), np.empty({n}), np.empty(({n}, {n}))
    for _ in range(40):
        {f} = _rest({known}, {x})
        for k in range({n}):
            keep, d = x[k], 1e-7 * (1.0 + abs(x[k]))
            x[k] = keep + d
            {g} = _rest({known}, {x})
            x[k] = keep
            for r in range({n}):
                J[r, k] = (g[r] - f[r]) / d
        moved = 0.0
        for k in range({n}):  # Gaussian elimination with partial pivoting; f becomes the step
            p = k
            for r in range(k + 1, {n}):
                if abs(J[r, k]) > abs(J[p, k]):
                    p = r
            for c in range({n}):
                J[k, c], J[p, c] = J[p, c], J[k, c]
            f[k], f[p] = f[p], f[k]
            for r in range(k + 1, {n}):
                factor = J[r, k] / J[k, k]
                for c in range(k, {n}):
                    J[r, c] -= factor * J[k, c]
                f[r] -= factor * f[k]
        for k in range({n} - 1, -1, -1):
            for c in range(k + 1, {n}):
                f[k] -= J[k, c] * f[c]
            f[k] /= J[k, k]
            moved = max(moved, abs(f[k]) / (1.0 + abs(x[k])))
        shorter = 1.0 if moved < 0.5 else 0.5 / moved
        for k in range({n}):
            x[k] -= shorter * f[k]
        if not moved > 1e-12:
            break
    {f} = _rest({known}, {x})
    off = 0.0
    for k in range({n}):
        off = max(off, abs(f[k]))
    settled = moved <= 1e-9 and off < 1e-6
    return {x}, 0.0 if settled else (min(1.0 + off, 1e6) if off >= 0.0 else 1e6)
"""
