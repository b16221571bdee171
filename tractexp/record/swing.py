"""A periodic swing of a load before an event: a line in the spectrum of P or Q that noise has not.

It is no noise, although it counts as such: what a model leaves of it is not told by the model's
error.
"""

from dataclasses import dataclass

import numpy as np

from tractexp.record.change import ANSWERED, fill_gaps
from tractexp.record.record import Record

SMALLEST_SWING = 0.01  # of the apparent power: a swing of a smaller amplitude is not told
# before the event: a slower one is not told from noise that wanders
FEWEST_PERIODS = 6.0
# of the nominal frequency: what is faster is ripple of the phasors of unbalanced or distorted waves
FASTEST_SHARE = 0.45
CHANCE = 1e-6  # that a line of noise stands out as much
FINER = 8  # lines of the spectrum for each that the samples tell apart
WIDTH_OF_LINE = 2.5  # such lines on either side that a swing itself reaches
NEAR = 2.0  # times the frequency, and over it: the noise there is what the line is compared with
LEAST_PASSED = 0.3  # of an oscillation that a recorder's window leaves: of less no size is told


@dataclass(frozen=True)
class Swing:
    """An oscillation of a load before an event.

    Attributes
    ----------
    quantity : str
        P or Q.
    frequency : float [Hz]
        Of the oscillation.
    amplitude : float
        As a share of the apparent power.
    """

    quantity: str
    frequency: float
    amplitude: float

    def __str__(self) -> str:
        """ "P swings at 1.2 Hz by ± 3 % of the apparent power"."""
        return (
            f"{self.quantity} swings at {self.frequency:.3g} Hz by ± {100 * self.amplitude:.2g} %"
            " of the apparent power"
        )


def find_swing(record: Record, part: slice) -> Swing | None:
    """The largest swing of a load before an event that its voltage does not explain.

    Parameters
    ----------
    record : Record
        Of the load.
    part : slice
        The samples before the event.

    Returns
    -------
    Swing or None
        None where there is none.
    """
    U, P, Q = (fill_gaps(x[part]) for x in (record.U, record.P, record.Q))
    rate, fastest = record.rate, FASTEST_SHARE * record.base.frequency
    size = max(float(np.hypot(P.mean(), Q.mean())), 1e-300)
    swings = []
    for name, x in (("P", P), ("Q", Q)):
        line = _find_line(x, rate, min(fastest, 0.4 * rate))
        if line is None:
            continue
        frequency, amplitude = line
        passed = _measure_passed(record, frequency)
        answered = ANSWERED * _measure_amplitude(U, rate, frequency) / float(U.mean())
        if passed > LEAST_PASSED and amplitude / size > max(SMALLEST_SWING, answered):
            swings.append(Swing(name, frequency, amplitude / size / passed))
    return max(swings, key=lambda swing: swing.amplitude, default=None)


def _find_line(x: np.ndarray, rate: float, fastest: float) -> tuple[float, float] | None:
    """(frequency [Hz], amplitude) of the highest line of x (N,) up to a frequency, where no noise
    is like it.
    """
    n = len(x)
    slowest = FEWEST_PERIODS * rate / n
    f = np.fft.rfftfreq(FINER * n, 1 / rate)
    inside = (f >= slowest) & (f <= fastest)
    if np.count_nonzero(inside) < 2 * WIDTH_OF_LINE * FINER:
        return None
    window = np.hanning(n)
    power = np.abs(np.fft.rfft(_subtract_line(x) * window, FINER * n)) ** 2
    best = int(np.argmax(np.where(inside, power, 0.0)))
    low, high = f[best] - WIDTH_OF_LINE * rate / n, f[best] + WIDTH_OF_LINE * rate / n
    sides = ((f > f[best] / NEAR) & (f < low)), ((f > high) & (f < NEAR * f[best]))
    around = power[best - 1 : best + 2]
    if not all(side.any() for side in sides) or around.max() > power[best]:
        return None
    # powers of noise are exponential
    noise = max(float(np.median(power[side])) for side in sides) / np.log(2)
    lines = max(np.count_nonzero(inside) / FINER, 1.0)
    if power[best] <= noise * np.log(lines / CHANCE):
        return None
    before, top, after = np.log(np.maximum(around, 1e-300))  # a parabola through them has its peak
    curved = before - 2 * top + after
    off = (before - after) / (2 * curved) if curved < 0 else 0.0
    return float(f[best] + off * f[1]), float(2 * np.sqrt(power[best]) / window.sum())


def _subtract_line(x: np.ndarray) -> np.ndarray:
    """x (N,) about its straight line."""
    at = np.arange(len(x)) - (len(x) - 1) / 2
    return x - x.mean() - at * (at @ x) / max(float(at @ at), 1e-300)


def _measure_amplitude(x: np.ndarray, rate: float, frequency: float) -> float:
    """Amplitude of x (N,) at a frequency [Hz]."""
    window = np.hanning(len(x))
    turn = np.exp(-2j * np.pi * frequency * np.arange(len(x)) / rate)
    return 2 * float(np.abs((_subtract_line(x) * window) @ turn) / window.sum())


def _measure_passed(record: Record, frequency: float) -> float:
    """The share of an oscillation [Hz] that the window of the record's phasors leaves."""
    if record.window is None:
        return 1.0
    turn = np.exp(-2j * np.pi * frequency * record.window.at)
    return float(np.abs(record.window.weights @ turn))
