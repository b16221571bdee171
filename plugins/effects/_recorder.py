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
def moved(y, U, slope, lag, quiet, out):
    """Write power y (C, n, N) as the voltage U (N,), `lag` (n,) samples earlier, draws it to `out`.

    Between samples U is the cubic of its slopes (N,) per sample, as the equations have it, and the current y/U follows
    it: by so much as both changed over the interval where that is more than `quiet`, by a straight line else. What
    bends besides is a parabola of the weaker of the two bends beside the interval, so that no corner is smoothed. What
    lies beyond the first and last sample is as there.
    """
    last = y.shape[2] - 1
    for k in range(y.shape[1]):
        whole = math.floor(lag[k])
        r = 1 - (lag[k] - whole)  # how far into the interval from a to b
        for i in range(last + 1):
            b = min(max(i - whole, 0), last)
            if r == 1.0:
                for c in range(y.shape[0]):
                    out[c, k, i] = y[c, k, b]
                continue
            a = max(b - 1, 0) if i - whole <= last else last
            o, e = max(a - 1, 0), min(b + 1, last)
            rise = U[b] - U[a]
            bend = r * (1 - r) * ((1 - r) * (slope[a] - rise) - r * (slope[b] - rise)) if b > a else 0.0
            u = U[a] + r * rise + bend
            for c in range(y.shape[0]):
                at_a, at_b = y[c, k, a] / U[a], y[c, k, b] / U[b]
                answer = (at_b - at_a) * rise / (rise * rise + quiet * quiet)
                p, s = at_a - answer * U[a], at_b - answer * U[b]
                before = y[c, k, o] / U[o] - answer * U[o] - 2 * p + s
                after = y[c, k, e] / U[e] - answer * U[e] - 2 * s + p
                weaker = before if abs(before) < abs(after) else after
                if before * after <= 0.0:
                    weaker = 0.0
                out[c, k, i] = u * (p + r * (s - p) - r * (1 - r) / 2 * weaker + answer * u)


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
