"""The angle of the voltage: how it turns, and where it jumps.

A network's angle turns at the frequency and jumps where a fault begins and ends. The slope between
two samples is both at once, so that of the frequency alone a jump is a peak of one sample or two,
and by how much it jumped is known only as well as the peak was sampled. Where the size of the
voltage jumps within one step its angle does so, too: that tells to which step a peak belongs.
"""

import numpy as np

# pu: of which the voltage changes within a step where it jumps, and the share of that which it
# changes in the steps beside it
LEAST_VOLTAGE_JUMP, MOST_BESIDE = 0.02, 0.3
LEAST_TURN = 0.002  # rad: a jump of less turns no load visibly


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


def place_jumps(
    f: np.ndarray, U: np.ndarray, step: float, nominal: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """The angle that a frequency turns, jumping in the steps in which the voltage does.

    The slope of an angle over two samples smears a jump over three steps, so that the angle would
    turn before the voltage falls.

    Parameters
    ----------
    f : (N,) [Hz]
        As recorded, with peaks at jumps.
    U : (N,) [pu]
        Size of the voltage.
    step : float [s]
        Between samples.
    nominal : float [Hz]
        Of the network.

    Returns
    -------
    two (N,) arrays or None
        The angle [rad] in a frame that turns at `nominal`, and the frequency [Hz] between its
        jumps. None where the angle does not jump within a step.
    """
    turned = 2 * np.pi * step * (f - nominal)
    steps, between = (turned[1:] + turned[:-1]) / 2, turned.copy()
    is_jumping = False
    for k in _find_voltage_jumps(U):
        before, after = turned[k - 1], turned[k + 2]
        usual = np.array([before, (before + after) / 2, after])
        jump = float(np.sum(steps[k - 1 : k + 2] - usual))
        if abs(jump) > LEAST_TURN:
            is_jumping = True
            steps[k - 1 : k + 2] = usual
            steps[k] += jump
            between[k : k + 2] = before, after
    if not is_jumping:
        return None
    angle = np.concatenate([[0.0], np.cumsum(steps)])
    return angle, nominal + between / (2 * np.pi * step)


def _find_voltage_jumps(U: np.ndarray) -> list[int]:
    """The last samples before the voltage (N,) [pu] jumps within a step, two from either end at
    least.
    """
    change = np.abs(np.diff(U))
    beside = np.maximum(change[:-2], change[2:])
    middle = change[1:-1]
    jumps = (middle > LEAST_VOLTAGE_JUMP) & (beside < MOST_BESIDE * middle)
    return [k for k in (np.flatnonzero(jumps) + 1).tolist() if k + 2 < len(U)]
