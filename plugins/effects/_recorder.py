"""What a recorder does to P and Q, compiled: every candidate passes through it, as often as it is simulated."""

import math

import numpy as np
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


@njit(nogil=True, error_model="numpy")
def _between(y, U, follow, r, u):
    """Power by the fraction r from the second to the third of four samples, y = P/U and U of each, at the voltage u."""
    answer = (y[2] - y[1]) * follow
    p, s = y[1] - answer * U[1], y[2] - answer * U[2]
    before = y[0] - answer * U[0] - 2 * p + s
    after = y[3] - answer * U[3] - 2 * s + p
    weaker = before if abs(before) < abs(after) else after
    if before * after <= 0.0:
        weaker = 0.0
    return u * (p + r * (s - p) - r * (1 - r) / 2 * weaker + answer * u)


@njit(nogil=True, error_model="numpy")
def _inside(y, U, follow, u, r, out):
    """`_between` the samples i + 1 and i + 2 for each i; counting from 0 lets the compiler take several at once."""
    for i in range(len(out)):
        near = y[i], y[i + 1], y[i + 2], y[i + 3]
        out[i] = _between(near, (U[i], U[i + 1], U[i + 2], U[i + 3]), follow[i + 1], r, u[i])


@njit(nogil=True, error_model="numpy")
def _beside(y, U, follow, u, r, whole, samples, out):
    """`_between` for these samples, where what lies beyond the first and last sample is as there."""
    last = len(y) - 1
    for i in range(*samples):
        b = min(max(i - whole, 0), last)
        a = max(b - 1, 0) if i - whole <= last else last
        o, e = max(a - 1, 0), min(b + 1, last)
        rising = follow[a] if b > a else 0.0
        out[i] = _between((y[o], y[a], y[b], y[e]), (U[o], U[a], U[b], U[e]), rising, r, u[i])


@njit(nogil=True, error_model="numpy")
def _voltage(U, slope, whole, r, u):
    """Write U (N,) by the fraction r from one sample to the next, `whole` samples earlier, to u: a cubic of its
    slopes."""
    last = len(U) - 1
    first, end = min(max(whole + 1, 0), last + 1), max(min(last + whole + 1, last + 1), 0)
    u[:first], u[end:] = U[0], U[last]
    here, there, moved = U[first - whole - 1 :], U[first - whole :], u[first:end]
    bends, bend_there = slope[first - whole - 1 :], slope[first - whole :]
    for i in range(len(moved)):
        rise = there[i] - here[i]
        bend = r * (1 - r) * ((1 - r) * (bends[i] - rise) - r * (bend_there[i] - rise))
        moved[i] = here[i] + r * rise + bend


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
    each, follow = 1 / U, np.zeros(last + 1)  # what depends on the voltage alone is divided once
    for i in range(last):
        follow[i] = (U[i + 1] - U[i]) / ((U[i + 1] - U[i]) ** 2 + quiet * quiet)
    u, drawn = np.empty(last + 1), np.empty(last + 1)
    for k in range(y.shape[1]):
        whole = math.floor(lag[k])
        r = 1 - (lag[k] - whole)  # how far into the interval from a to b
        if r == 1.0:
            for c in range(y.shape[0]):
                for i in range(last + 1):
                    out[c, k, i] = y[c, k, min(max(i - whole, 0), last)]
            continue
        if k == 0 or lag[k] != lag[k - 1]:  # differences of a fit move one parameter at a time
            _voltage(U, slope, whole, r, u)
        first, end = min(max(whole + 2, 0), last + 1), max(min(last + whole, last + 1), 0)  # o and e are samples there
        end = max(first, end)
        for c in range(y.shape[0]):
            for i in range(last + 1):
                drawn[i] = y[c, k, i] * each[i]
            _beside(drawn, U, follow, u, r, whole, (0, first), out[c, k])
            _beside(drawn, U, follow, u, r, whole, (end, last + 1), out[c, k])
            if first < end:
                at = first - whole - 2
                _inside(drawn[at:], U[at:], follow[at:], u[first:end], r, out[c, k, first:end])


@njit(nogil=True, error_model="numpy")
def _mean(y, sums, whole, r, window, out):
    """`averaged` where no part of the window lies beyond the record, from the sample `whole` + 1 on."""
    before, left = y, y[1:]
    right, after = y[2 * whole + 1 :], y[2 * whole + 2 :]
    sums_left, sums_right = sums[1:], sums[2 * whole + 1 :]
    each, near, far = 1 / window, r - r * r / 2, r * r / 2
    for i in range(len(out)):
        ends = near * (left[i] + right[i]) + far * (before[i] + after[i])
        out[i] = (sums_right[i] - sums_left[i] + ends) * each


@njit(nogil=True, error_model="numpy")
def _mean_beside(y, sums, whole, r, window, samples, out):
    """`averaged` of these samples, where y keeps its first and last value beyond them."""
    last = len(y) - 1
    for i in range(*samples):
        at = min(i + whole, last)
        here, there = y[at], y[min(at + 1, last)]
        area = sums[at] - sums[i] + max(i + whole - last, 0) * y[last]
        area += r * here + r * r / 2 * (there - here)
        at = max(i - whole, 0)
        here, there = y[at], y[max(at - 1, 0)]
        area += sums[i] - sums[at] + max(whole - i, 0) * y[0]
        area += r * here + r * r / 2 * (there - here)
        out[i] = area / window


@kept
@njit(nogil=True, error_model="numpy")
def averaged(y, window, out):
    """Write the mean of y (2, n, N) over `window` (n,) samples around each to `out`.

    y is linear between samples and keeps its first and last value beyond them. A window of 0 leaves it as it is.
    """
    last = y.shape[2] - 1
    sums = np.zeros((2, last + 1))  # integral of each channel from the first sample to each
    for k in range(y.shape[1]):
        half = window[k] / 2
        whole = math.floor(half)
        r = half - whole
        if half == 0.0:
            out[:, k] = y[:, k]
            continue
        first = min(whole + 1, last + 1)  # from here to `end` the window lies within the record
        end = max(last - whole, first)
        for i in range(last):  # two at once: each sum waits for the one before it
            sums[0, i + 1] = sums[0, i] + (y[0, k, i] + y[0, k, i + 1]) / 2
            sums[1, i + 1] = sums[1, i] + (y[1, k, i] + y[1, k, i + 1]) / 2
        for c in range(2):
            _mean_beside(y[c, k], sums[c], whole, r, window[k], (0, first), out[c, k])
            _mean_beside(y[c, k], sums[c], whole, r, window[k], (end, last + 1), out[c, k])
            if first < end:
                _mean(y[c, k], sums[c], whole, r, window[k], out[c, k, first:end])


@kept
@njit(nogil=True, error_model="numpy")
def drifted(y, t, rate, out):
    """Write y (C, n, N) times 1 + rate t to `out`, of rates (C, n) and times t (N,)."""
    for c in range(y.shape[0]):
        for k in range(y.shape[1]):
            for i in range(y.shape[2]):
                out[c, k, i] = y[c, k, i] * (1 + rate[c, k] * t[i])
