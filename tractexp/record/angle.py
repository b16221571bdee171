"""The angle of the voltage: how it turns, and where it jumps.

A network's angle turns at the frequency and jumps where a fault begins and ends. The slope between
two samples is both at once, so that of the frequency alone a jump is a peak of one sample or two,
and by how much the angle jumped is known only as well as the peak was sampled.
"""

import numpy as np

from tractexp.record.curve import slopes


def unwrap_angle(angle: np.ndarray, turn: float = 2 * np.pi) -> np.ndarray:
    """An angle (N,) without the whole turns it was wrapped by; over a gap (nan) as from one side to
    the other. It stays a gap.
    """
    there = np.isfinite(angle)
    unwrapped = np.full(len(angle), np.nan)
    unwrapped[there] = np.unwrap(angle[there], period=turn)
    return unwrapped


def measure_frequency(angle: np.ndarray, step: float, nominal: float) -> np.ndarray:
    """Frequency (N,) [Hz] at which an angle (N,) [rad] turns beside its jumps, in a frame that
    turns at `nominal`.

    At each sample it is the slope of the curve through the angle which leans on the flatter side:
    before a jump the slope before it, after a jump that after it.
    """
    usual = float(np.median(np.diff(angle)))
    turned = slopes(angle - usual * np.arange(len(angle))) + usual
    return nominal + turned / (2 * np.pi * step)
