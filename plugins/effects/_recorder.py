"""What a recorder does to P and Q, compiled: every candidate passes through it, as often as it is simulated."""

import math

from numba import njit

from tractexp.extend import kept


@njit(nogil=True, error_model="numpy")
def _going_on(y, i):
    """y (N,) at i, also before its first sample and after its last."""
    last = len(y) - 1
    if i < 0:
        return 2 * y[0] - y[1]
    return y[i] if i <= last else 2 * y[last] - y[last - 1]


@kept
@njit(nogil=True, error_model="numpy")
def earlier(y, lag, out):
    """Write y (C, n, N) as it was `lag` (n,) samples earlier to `out`.

    Between samples y is the cubic of Catmull and Rom (1974); beyond its ends it goes on by one step of its slope, and
    stays there.
    """
    last = y.shape[2] - 1
    for k in range(y.shape[1]):
        whole = math.floor(lag[k])
        r = lag[k] - whole
        far, near = r * r * (r - 1) / 2, r * (1 + r * (4 - 3 * r)) / 2
        here, ahead = 1 + r * r * (3 * r - 5) / 2, -r * (1 - r) * (1 - r) / 2
        for c in range(y.shape[0]):
            for i in range(last + 1):
                at = i - whole
                a, b = _going_on(y[c, k], at - 2), _going_on(y[c, k], at - 1)
                d, e = _going_on(y[c, k], at), _going_on(y[c, k], at + 1)
                out[c, k, i] = far * a + near * b + here * d + ahead * e


@kept
@njit(nogil=True, error_model="numpy")
def averaged(y, window, out):
    """Write the mean of y (2, n, N) over `window` (n,) samples around each to `out`.

    y is linear between samples and keeps its first and last value beyond them. A window of 0 leaves it as it is.
    """
    last = y.shape[2] - 1
    sums = [0.0] * (last + 1)  # integral from the first sample to each
    for k in range(y.shape[1]):
        half = window[k] / 2
        whole = math.floor(half)
        r = half - whole
        for c in range(2):
            for i in range(last):
                sums[i + 1] = sums[i] + (y[c, k, i] + y[c, k, i + 1]) / 2
            for i in range(last + 1):
                if half == 0.0:
                    out[c, k, i] = y[c, k, i]
                    continue
                at = min(i + whole, last)
                here, there = y[c, k, at], y[c, k, min(at + 1, last)]
                area = sums[at] - sums[i] + max(i + whole - last, 0) * y[c, k, last]
                area += r * here + r * r / 2 * (there - here)
                at = max(i - whole, 0)
                here, there = y[c, k, at], y[c, k, max(at - 1, 0)]
                area += sums[i] - sums[at] + max(whole - i, 0) * y[c, k, 0]
                area += r * here + r * r / 2 * (there - here)
                out[c, k, i] = area / window[k]
