"""Steps of a load, or of its voltage: changes for another reason than the voltage, over within a
cycle.

The mean of one cycle is compared with that of the cycle after the next: a step is over within a
cycle, and so is what the window of a phasor makes of it. A load's own answer to a dip decays, so
that each cycle changes less than the one before it; a step does not follow from what came before
it.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tractexp.record.record import DEAD_VOLTAGE_SHARE, Record

CHANGED = 0.05  # of the apparent power: what a load that is steady does not leave
CHANGED_U = 0.01  # of the voltage: a step of a tap changer
ANSWERED = 4.0  # times the relative change of voltage: what a load answers to it at most
ABRUPT_CHANGE_RATIO = 3.0  # times the changes right before and after: what does not go on
# times the lower quartile of all such changes of P and Q, six standard deviations of noise: more is
# none
LARGEST_USUAL_CHANGE = 8.0
# the same of the voltage: the lower quartile of one quantity is smaller than that of two
USUAL_U = 19.0
# of the greatest apparent power: steps of a smaller load count as those of this one
SMALL_LOAD_SHARE = 0.2
STAYS = 5, 0.5  # cycles over which a step is still seen, and how much of it


@dataclass(frozen=True)
class Change:
    """A step of a load, or of its voltage.

    Attributes
    ----------
    first, stop : int
        Samples before `first` and from `stop` on are those of steady levels.
    before, after : complex
        P + jQ, in the unit of the record; of a step of the voltage that, real.
    """

    first: int
    stop: int
    before: complex  # P + jQ, in the unit of the record
    after: complex

    @property
    def ratio(self) -> float:
        """Apparent power after over that before."""
        return abs(self.after) / max(abs(self.before), 1e-300)


def load_changes(U: np.ndarray, P: np.ndarray, Q: np.ndarray, cycle: float) -> list[Change]:
    """The steps of a load that its voltage does not explain.

    Parameters
    ----------
    U, P, Q : (N,)
        Voltage and powers of a record, in any unit; P and Q may have gaps.
    cycle : float
        Samples in a cycle of the network.

    Returns
    -------
    list of Change
        Of more than 5 % of the apparent power.
    """
    S, n = fill_gaps(P) + 1j * fill_gaps(Q), max(1, round(cycle))
    (before, after), (low, high) = _average_sides(S, n), _average_sides(U.astype(complex), n)
    if not len(before):
        return []
    size = np.maximum(
        np.maximum(np.abs(before), np.abs(after)), SMALL_LOAD_SHARE * _find_greatest(S)
    )
    answer = (
        ANSWERED
        * np.abs(high - low)
        / np.maximum(np.abs(low), DEAD_VOLTAGE_SHARE * _find_greatest(high))
    )
    return list(_find_steps(before, after, size, answer, (CHANGED, LARGEST_USUAL_CHANGE), n))


def find_voltage_changes(U: np.ndarray, cycle: float) -> list[Change]:
    """The steps of a voltage (N,) of more than 1 %, where `cycle` samples are a cycle."""
    n = max(1, round(cycle))
    low, high = _average_sides(U.astype(complex), n)
    return list(
        _find_steps(
            low, high, np.maximum(np.abs(low), 1e-300), np.zeros(len(low)), (CHANGED_U, USUAL_U), n
        )
    )


def _average_sides(x: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """The means of the n samples before each, and of the n that begin n samples later.

    Both are empty for too few samples.
    """
    if len(x) < 3 * n + 1:
        return np.empty(0, complex), np.empty(0, complex)
    total = np.concatenate([[0.0], np.cumsum(x)])
    means = (total[n:] - total[:-n]) / n
    return means[: -2 * n], means[2 * n :]


def _find_steps(
    before: np.ndarray,
    after: np.ndarray,
    size: np.ndarray,
    answer: np.ndarray,
    least: tuple[float, float],
    n: int,
) -> Iterator[Change]:
    """The changes that stand out; entry k compares the samples up to k + n with those from k + 2 n
    on.

    `least` is what a change exceeds, as a share of `size` and in lower quartiles of all changes.
    """
    if not len(before):
        return
    change = np.abs(after - before) / size
    apart = np.pad(change, 2 * n)
    beside = np.maximum(apart[: -4 * n], apart[4 * n :])
    enough = max(least[0], least[1] * float(np.percentile(change, 25)))
    steps = (change - answer > enough) & (change > ABRUPT_CHANGE_RATIO * beside)
    for run in find_runs(steps):
        k = run.start + int(np.argmax(np.abs(after - before)[run]))
        earlier, later = (
            before[max(k - (STAYS[0] - 1) * n, 0) : k + 1 : n],
            after[k : k + (STAYS[0] - 1) * n + 1 : n],
        )
        if abs(later.mean() - earlier.mean()) > STAYS[1] * abs(after[k] - before[k]):
            yield Change(k + n, k + 2 * n, complex(before[k]), complex(after[k]))


def find_runs(mask: np.ndarray, least: int = 1) -> list[slice]:
    """The unbroken stretches in which a mask is true.

    Parameters
    ----------
    mask : (N,) bools
        By sample.
    least : int
        Shorter stretches are left out.

    Returns
    -------
    list of slice

    Examples
    --------
    >>> find_runs(np.array([True, True, False, True]), least=2)
    [slice(0, 2, None)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(int))).tolist()
    return [slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= least]


def fill_gaps(x: np.ndarray) -> np.ndarray:
    """Values (N,) with gaps (nan) filled in linearly; all zero where there is no value.

    Examples
    --------
    >>> fill_gaps(np.array([1.0, np.nan, 2.0])).tolist()
    [1.0, 1.5, 2.0]
    """
    valid = np.isfinite(x)
    if valid.all():
        return x
    return (
        np.interp(np.arange(len(x)), np.flatnonzero(valid), x[valid])
        if valid.any()
        else np.zeros(len(x))
    )


def _find_greatest(S: np.ndarray) -> float:
    """The apparent power that 95 % of the samples stay below, never 0."""
    return max(float(np.percentile(np.abs(S), 95)), 1e-300)


def measure_smear(record: Record) -> float:
    """The number of samples that a step is smeared over: a cycle, or the window of the phasors
    where that is longer.
    """
    length = record.window.length if record.window else 0.0
    return max(1 / record.base.frequency, length) * record.rate


def describe_change(record: Record, begin: int, change: Change) -> str:
    """A clause on a step of the load, whose samples count from sample `begin` of the record."""
    name = "is switched off" if change.ratio < SMALL_LOAD_SHARE else "changes"
    when = record.t[begin + (change.first + change.stop) // 2]
    powers = describe_power_change(record, change.before, change.after)
    return f"the load {name} at t = {when:g} s ({powers}) while the voltage stays"


def describe_power_change(record: Record, before: complex, after: complex) -> str:
    """A change of power P + jQ in words, "P 1 to 0.5, ...", in MW and Mvar where the base of the
    record says so.
    """
    base = record.base
    size, units = (base.power, (" MW", " Mvar")) if base.in_mva else (1.0, ("", ""))
    parts = zip("PQ", units, (before.real, before.imag), (after.real, after.imag), strict=True)
    return ", ".join(f"{name} {size * a:.4g} to {size * b:.4g}{unit}" for name, unit, a, b in parts)
