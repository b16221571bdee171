"""The angle of the voltage: how it turns, and where it jumps.

A network's angle turns at the frequency and jumps where a fault begins and ends. The slope between
two samples is both at once, so that of the frequency alone a jump is a peak of one sample or two,
and by how much the angle jumped is known only as well as the peak was sampled.
"""

import numpy as np


def unwrap_angle(angle: np.ndarray, turn: float = 2 * np.pi) -> np.ndarray:
    """An angle without the whole turns by which it was wrapped.

    Parameters
    ----------
    angle : (N,)
        In any unit; nan in a gap, which stays one.
    turn : float
        A whole turn in that unit.

    Returns
    -------
    (N,) array

    Examples
    --------
    >>> unwrap_angle(np.array([350.0, 10.0, 30.0]), 360.0).tolist()
    [350.0, 370.0, 390.0]
    """
    there = np.isfinite(angle)
    unwrapped = np.full(len(angle), np.nan)
    unwrapped[there] = np.unwrap(angle[there], period=turn)
    return unwrapped


def measure_frequency(angle: np.ndarray, step: float, nominal: float) -> np.ndarray:
    """The frequency at which an angle turns, beside its jumps.

    At each sample it is the slope of the curve through the angle which leans on the side that bends
    less (Akima 1970): before a jump the slope before it, after a jump that after it.

    Parameters
    ----------
    angle : (N,) [rad]
        In a frame that turns at `nominal`.
    step : float [s]
        Between samples.
    nominal : float [Hz]
        Of the network.

    Returns
    -------
    (N,) array [Hz]
    """
    usual = np.diff(angle)
    m = np.concatenate([usual[:1], usual[:1], usual, usual[-1:], usual[-1:]])
    bends = np.abs(np.diff(m))
    left, right = bends[2:], bends[:-2]
    total = left + right
    both = (m[1:-2] + m[2:-1]) / 2
    leaning = (left * m[1:-2] + right * m[2:-1]) / np.where(total > 0, total, 1.0)
    turned = np.where(total > 0, leaning, both)
    return nominal + turned / (2 * np.pi * step)


def integrate(speed: np.ndarray, step: float) -> np.ndarray:
    """The angle that a speed turns.

    Parameters
    ----------
    speed : (N,) [rad/s]
        On straight lines between samples.
    step : float [s]
        Between samples.

    Returns
    -------
    (N,) array [rad]
        Zero at the first sample.

    Examples
    --------
    >>> integrate(np.array([0.0, 2.0, 2.0]), 0.5).tolist()
    [0.0, 0.5, 1.5]
    """
    return np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) * (step / 2))])
