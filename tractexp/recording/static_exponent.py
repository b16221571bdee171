"""How a load's powers go with a voltage that changes slowly, or stays where it went: the exponents
of its static part.

    ln P = a + n ln U + c t

over the half cycles about what happened; without the drift c of the load where the voltage itself
drifts, for then nothing tells them apart. The interval is that of the delete-a-block jackknife.
"""

from dataclasses import dataclass

import numpy as np

from tractexp.record.regression import fit_line
from tractexp.recording.trace import Trace

AROUND_CHANGE = 1.0  # s before what happened and after it, over which exponents are fitted
EDGE_CYCLES = 3.0  # about a step, which windows blur and motors answer
FEWEST_LEVELS = 20  # half cycles that are fitted at least
LEAST_VOLTAGE_CHANGE = 0.005  # of the voltage, from the least to the greatest
WIDEST_EXPONENT = 0.5  # half of an interval: a wider one tells nothing
TWO_SIDED = 1.96  # standard errors
SMALLEST_VARIANCE = 1e-30


@dataclass(frozen=True)
class StaticExponent:
    """The exponent of a power law by which P or Q follows the voltage.

    Attributes
    ----------
    channel : str
        P or Q.
    value, low, high : float
        The exponent, and its 95 % interval.
    explained : float
        The share of the channel's variance that this explains.
    """

    channel: str
    value: float
    low: float
    high: float
    explained: float

    def __str__(self) -> str:
        """ "P with U^1.50 (1.30 to 1.70)"."""
        return f"{self.channel} with U^{self.value:.2f} ({self.low:.2f} to {self.high:.2f})"


def find_exponents(
    trace: Trace, start: int, end: int, first: int, stop: int, *, lasting: bool
) -> tuple[StaticExponent, ...]:
    """The exponents of P and Q about an event.

    Parameters
    ----------
    trace : Trace
        Voltage and powers.
    start, end : int
        Samples between which the voltage changed.
    first, stop : int
        Samples between which nothing else happened.
    lasting : bool
        Whether the voltage stays where it went: then the edge is left out and the load may drift.

    Returns
    -------
    tuple of StaticExponent
        Of those channels that show one.
    """
    reach = round(AROUND_CHANGE / trace.step)
    at = np.arange(max(first, start - reach), min(stop, end + reach))
    if lasting:
        edge = round(EDGE_CYCLES * trace.cycle / trace.step)
        at = at[(at < start - edge) | (at > start + edge)]
    found = (_fit_exponent(trace, channel, at, drift=lasting) for channel in "PQ")
    return tuple(one for one in found if one is not None)


def _fit_exponent(
    trace: Trace, channel: str, at: np.ndarray, *, drift: bool
) -> StaticExponent | None:
    """The exponent of one channel over samples `at`; None where the voltage hardly changes, the
    power changes its sign, or the interval is too wide.
    """
    U = trace.U[at]
    power = getattr(trace, channel)[at]
    seen = np.isfinite(power) & np.isfinite(U) & (U > 0)
    U = U[seen]
    power = power[seen]
    if len(U) < FEWEST_LEVELS or np.ptp(U) < LEAST_VOLTAGE_CHANGE * U.max():
        return None
    if (power == 0).any() or np.ptp(np.sign(power)) > 0:
        return None
    columns = [np.log(U), np.ones(len(U))]
    if drift:
        t = trace.t[at][seen]
        columns.append(t - t.mean())
    X = np.stack(columns, axis=1)
    y = np.log(np.abs(power))
    fit, errors = fit_line(X, y)
    half = TWO_SIDED * float(errors[0])
    if not half < WIDEST_EXPONENT:
        return None
    left = float(np.var(y - X @ fit))
    whole = float(np.var(y))
    explained = 1 - left / max(whole, SMALLEST_VARIANCE)
    value = float(fit[0])
    low, high = value - half, value + half
    return StaticExponent(
        channel,
        value,
        low,
        high,
        explained,
    )
