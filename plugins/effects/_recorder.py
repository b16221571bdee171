"""What a recorder does to P and Q, compiled: every candidate passes through it, as often as it is
simulated.
"""

import numpy as np

from tractexp.extend import EVENT, INPUTS, Stencil

STEP = EVENT.index("step")


def earlier(power, drive, delay):
    """Replace power by what it was some time earlier.

    Between samples it is the cubic of Catmull and Rom (1974); beyond the ends of an event it goes
    on by one step of its slope, and stays there.

    Parameters
    ----------
    power : (C, n, N) [pu]
        Of n candidates, changed in place.
    drive : Drive
        E events of N samples in all.
    delay : (E, n) [s]
        How much earlier.
    """
    whole, part = _steps(delay / drive.event[:, [STEP]])
    _change(CUBIC, power, drive, {"shift": -whole}, {"r": part})


def _cubic(y, r):
    far, near = r * r * (r - 1) / 2, r * (1 + r * (4 - 3 * r)) / 2
    here, ahead = 1 + r * r * (3 * r - 5) / 2, -r * (1 - r) * (1 - r) / 2
    return far * y(-2) + near * y(-1) + here * y(0) + ahead * y(1)


def delay_response(power, drive, delay, quiet):
    """Replace power by what the voltage of some time earlier draws.

    Between samples the voltage U is the cubic of its slopes, as the equations have it, and the
    current y/U follows it: by so much as both changed over the interval where that is more than
    `quiet`, by a straight line else. What bends besides is a parabola of the weaker of the two
    bends beside the interval, so that no corner is smoothed. Beyond the first and last sample of an
    event all is as there.

    Parameters
    ----------
    power : (C, n, N) [pu]
        Of n candidates, changed in place.
    drive : Drive
        E events of N samples in all.
    delay : (E, n) [s]
        How much earlier.
    quiet : float
        A change of the voltage, over that before, that is too small to be followed.
    """
    whole, part = _steps(delay / drive.event[:, [STEP]])
    of_sample = np.repeat(np.arange(drive.events), np.diff(drive.first))  # its event
    U, step = drive.inputs[INPUTS.index("U")], drive.event[of_sample, STEP]
    rise = np.diff(U, prepend=U[0])
    follow = rise / (rise**2 + (quiet * drive.event[of_sample, EVENT.index("U0")]) ** 2)
    shared = {
        "U": U,
        "each": 1 / U,
        "slope": drive.inputs[INPUTS.index("U_rate")] * step,
        "follow": follow,
    }
    shared["place"] = np.arange(len(U), dtype=float)
    _change(CURRENT, power, drive, {"shift": -whole}, {"r": 1 - part}, **shared)


def _current(y, U, each, slope, follow, place, r):
    """Power by the fraction r from the sample before last to the last of three, and one after; U is
    moved as well.

    `follow` is of the interval that ends at a sample. The place of a sample rises by 1 within an
    event only.
    """
    from sympy import Abs, Piecewise

    y0, y1, y2, y3 = (y(k) * each(k) for k in (-2, -1, 0, 1))
    answer = (y2 - y1) * follow(0)
    p, s = y1 - answer * U(-1), y2 - answer * U(0)
    before, after = y0 - answer * U(-2) - 2 * p + s, y3 - answer * U(1) - 2 * s + p
    weaker = Piecewise((0, before * after <= 0), (before, Abs(before) < Abs(after)), (after, True))
    rise, inside = U(0) - U(-1), place(0) - place(-1)
    bend = inside * r * (1 - r) * ((1 - r) * (slope(-1) - rise) - r * (slope(0) - rise))
    u = U(-1) + r * rise + bend
    return u * (p + r * (s - p) - r * (1 - r) / 2 * weaker + answer * u)


def add_drift(power, drive, rate):
    """Let power drift from the first sample of each event.

    Parameters
    ----------
    power : (C, n, N) [pu]
        Of n candidates, changed in place.
    drive : Drive
        E events of N samples in all.
    rate : (E, C, n) [1/s]
        By which share it changes in a second.
    """
    at_once = np.zeros(rate.shape, dtype=int)
    _change(
        GROWN, power, drive, {"shift": at_once}, {"rate": rate}, t=drive.inputs[INPUTS.index("t")]
    )


def _apply_drift(y, t, rate):
    return y(0) * (1 + rate * t(0))


def average_power(power, drive, window):
    """Replace power by its mean over a window around each sample.

    It is linear between samples and keeps its first and last value beyond them.

    Parameters
    ----------
    power : (2, n, N) [pu]
        Of n candidates, changed in place.
    drive : Drive
        E events of N samples in all.
    window : (E, n) [s]
        Length of the window; 0 leaves the power as it is.
    """
    length = window / drive.event[:, [STEP]]
    whole, part = _steps(length / 2)
    each = np.divide(1, length, out=np.zeros_like(length), where=length > 0)
    _change(MEAN, power, drive, {"ahead": whole, "behind": -whole}, {"r": part, "each": each})


def _mean(y, total, r, each):
    """Trapezia between whole samples, of sums up to each, and a part of one more at each end;
    `each` is 0 for none.
    """
    from sympy import Piecewise

    ahead, behind = y(0, "ahead"), y(0, "behind")
    whole = total(0, "ahead") - total(0, "behind") + (behind - ahead) / 2
    ends = r * (ahead + behind) + r * r / 2 * (y(1, "ahead") - ahead + y(-1, "behind") - behind)
    return Piecewise((ahead, each <= 0), ((whole + ends) * each, True))


GROWN = Stencil(_apply_drift, rows=("y",), shared=("t",), numbers=("rate",))
CUBIC = Stencil(_cubic, rows=("y",), numbers=("r",), onward=True)
CURRENT = Stencil(
    _current, rows=("y",), shared=("U", "each", "slope", "follow", "place"), numbers=("r",)
)
MEAN = Stencil(
    _mean, rows=("y",), sums={"total": "y"}, shifts=("ahead", "behind"), numbers=("r", "each")
)


def _steps(lag):
    """Whole samples, and what is left of one."""
    whole = np.floor(lag).astype(int)
    return whole, lag - whole


def _change(stencil, power, drive, shifts, numbers, **shared):
    """Write a stencil in place of power (C, n, N); shifts and numbers are (E, n), or (E, C, n)."""

    def channels(given):
        return {k: each if each.ndim == 3 else each[:, None] for k, each in given.items()}

    parts = [drive.part(e) for e in range(drive.events)]
    stencil(power, parts, channels(shifts), y=power, **channels(numbers), **shared)
