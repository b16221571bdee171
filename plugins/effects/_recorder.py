"""What a recorder does to P and Q, compiled: every candidate passes through it, as often as it is simulated."""

import math
import threading

import numpy as np

from tractexp.extend import Stencil

_space = threading.local()  # memory used again: the system takes longer to give it anew than the loops take


def earlier(y, lag, out):
    """Write y (C, n, N) as it was `lag` (n,) samples earlier to `out`.

    Between samples y is the cubic of Catmull and Rom (1974); beyond its ends it goes on by one step of its slope, and
    stays there.
    """
    _changed(_earlier, y, lag, out)


def _earlier(y, lag, out):
    whole = np.floor(lag).astype(int)
    beyond = np.abs(whole).max(initial=0) + 2
    wide = _padded(y, beyond)
    wide[..., :beyond] = 2 * y[..., :1] - y[..., 1:2]
    wide[..., -beyond:] = 2 * y[..., -1:] - y[..., -2:-1]
    _written(CUBIC, out, {"y": beyond - whole}, {"y": wide}, {"r": lag - whole})


def _cubic(y, r):
    far, near = r * r * (r - 1) / 2, r * (1 + r * (4 - 3 * r)) / 2
    here, ahead = 1 + r * r * (3 * r - 5) / 2, -r * (1 - r) * (1 - r) / 2
    return far * y(-2) + near * y(-1) + here * y(0) + ahead * y(1)


def moved(y, U, slope, lag, quiet, out):
    """Write power y (C, n, N) as the voltage U (N,), `lag` (n,) samples earlier, draws it to `out`.

    Between samples U is the cubic of its slopes (N,) per sample, as the equations have it, and the current y/U follows
    it: by so much as both changed over the interval where that is more than `quiet`, by a straight line else. What
    bends besides is a parabola of the weaker of the two bends beside the interval, so that no corner is smoothed. What
    lies beyond the first and last sample is as there.
    """
    rise = np.diff(U)
    follow, inside = rise / (rise**2 + quiet * quiet), np.ones(len(rise))
    beyond = int(np.abs(np.floor(lag)).max(initial=0)) + 2
    shared = {name: _padded(array, beyond, edge=True) for name, array in (("U", U), ("each", 1 / U))}
    shared |= {"slope": _padded(slope, beyond)}
    shared |= {name: _padded(np.append(array, 0.0), beyond) for name, array in (("follow", follow), ("inside", inside))}

    def change(y, lag, out):
        whole = np.floor(lag).astype(int)
        arrays, numbers = {"y": _padded(y, beyond, edge=True)}, {"r": 1 - (lag - whole)}
        _written(CURRENT, out, {"y": beyond - whole}, arrays, numbers, **shared)

    _changed(change, y, lag, out)


def _current(y, U, each, slope, follow, inside, r):
    """Power by the fraction r from the sample before last to the last of three, and one after; U is moved as well."""
    from sympy import Abs, Piecewise

    y0, y1, y2, y3 = (y(k) * each(k) for k in (-2, -1, 0, 1))
    answer = (y2 - y1) * follow(-1)
    p, s = y1 - answer * U(-1), y2 - answer * U(0)
    before, after = y0 - answer * U(-2) - 2 * p + s, y3 - answer * U(1) - 2 * s + p
    weaker = Piecewise((0, before * after <= 0), (before, Abs(before) < Abs(after)), (after, True))
    rise = U(0) - U(-1)
    bend = inside(-1) * r * (1 - r) * ((1 - r) * (slope(-1) - rise) - r * (slope(0) - rise))
    u = U(-1) + r * rise + bend
    return u * (p + r * (s - p) - r * (1 - r) / 2 * weaker + answer * u)


def averaged(y, window, out):
    """Write the mean of y (2, n, N) over `window` (n,) samples around each to `out`.

    y is linear between samples and keeps its first and last value beyond them. A window of 0 leaves it as it is.
    """
    _changed(_averaged, y, window, out)


def _averaged(y, window, out):
    whole = np.floor(window / 2).astype(int)
    beyond = whole.max(initial=0) + 1
    wide = _padded(y, beyond, edge=True)
    ahead, behind = beyond + whole, beyond - whole
    sums = _room("sums", wide.shape)  # from the first sample on, so that no row's depend on the others' windows
    np.cumsum(y, -1, out=sums[..., beyond:-beyond])
    steps = np.arange(1.0, beyond + 1)
    sums[..., :beyond] = -y[..., :1] * (beyond - steps)
    sums[..., -beyond:] = sums[..., -beyond - 1, None] + y[..., -1:] * steps
    arrays = dict.fromkeys(("ahead", "behind"), wide) | dict.fromkeys(("to_ahead", "to_behind"), sums)
    shifts = {"ahead": ahead, "behind": behind, "to_ahead": ahead, "to_behind": behind}
    _written(MEAN, out, shifts, arrays, {"r": window / 2 - whole, "each": 1 / window})


def _mean(ahead, behind, to_ahead, to_behind, r, each):
    """Trapezia between whole samples, of sums up to each, and a part of one more at each end."""
    whole = to_ahead(0) - to_behind(0) + (behind(0) - ahead(0)) / 2
    ends = r * (ahead(0) + behind(0)) + r * r / 2 * (ahead(1) - ahead(0) + behind(-1) - behind(0))
    return (whole + ends) * each


def _changed(change, y, amount, out):
    """`change(y, amount, out)` of the candidates with an amount; the others' y (C, n, N) is copied."""
    some = amount != 0
    if some.all():
        change(y, amount, out)
        return
    out[...] = y
    if some.any():
        change(y[:, some], amount[some], changed := np.empty_like(y[:, some]))
        out[:, some] = changed


CUBIC = Stencil(_cubic, rows=("y",), numbers=("r",))
CURRENT = Stencil(_current, rows=("y",), shared=("U", "each", "slope", "follow", "inside"), numbers=("r",))
MEAN = Stencil(_mean, rows=("ahead", "behind", "to_ahead", "to_behind"), numbers=("r", "each"))


def _padded(y, beyond, edge=False):
    """y (..., N) with so many samples more at both ends: its first and last, or 0. Rows of candidates share a room."""
    shape = (*y.shape[:-1], y.shape[-1] + 2 * beyond)
    wide = _room("wide", shape) if y.ndim > 1 else np.empty(shape)
    wide[..., beyond:-beyond] = y
    wide[..., :beyond], wide[..., -beyond:] = (y[..., :1], y[..., -1:]) if edge else (0.0, 0.0)
    return wide


def _room(name, shape):
    """An array of this thread's, whose content lasts until it is asked for again."""
    size = math.prod(shape)
    if getattr(_space, name, np.empty(0)).size < size:
        setattr(_space, name, np.empty(size))
    return getattr(_space, name)[:size].reshape(shape)


def _written(stencil, out, shifts, arrays, numbers, **shared):
    """Write a stencil of arrays (C, n, M), each of the n shifted by itself, to out (C, n, N)."""
    channels, n = out.shape[:2]
    rows = _room("rows", (channels * n, out.shape[-1]))
    given = {name: array.reshape(len(rows), -1) for name, array in arrays.items()}
    given |= {name: np.tile(number, channels) for name, number in numbers.items()}
    stencil(rows, {name: np.tile(shift, channels) for name, shift in shifts.items()}, **given, **shared)
    out[...] = rows.reshape(out.shape)
