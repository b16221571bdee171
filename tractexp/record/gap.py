"""Short gaps: which samples are missing, and what is put in their place.

One sample between two measured ones is bridged: a voltage moves little within it, but at the very
edge of a dip. So are a few in a row of a wave, by its shape, and of RMS values, where the voltage
is the same on either side; between others nobody knows what happened.
"""

from collections.abc import Sequence

import numpy as np

from tractexp.text.wording import count_noun

# of all samples: where more are missing, they were not lost but recorded in another way
MOST_BRIDGED_SHARE = 0.05
MOST_ROWS = 3  # in a row that a table of RMS values may lack
SAME_VOLTAGE = 0.01  # of the voltage, by which it differs on either side of several missing rows
LONGEST_WAVE_GAP = 0.1  # of a cycle, between the samples on either side
NAMED_TIMES = 3  # of bridged samples that are told


def limit_wave_gap(rate: float, frequency: float) -> int:
    """The number of samples in a row, one at least, that are bridged of a wave.

    Parameters
    ----------
    rate, frequency : float [Hz]
        Of the samples, and of the network.

    Returns
    -------
    int
        A tenth of a cycle less one.

    Examples
    --------
    >>> limit_wave_gap(4000, 50)
    7
    """
    return max(1, int(LONGEST_WAVE_GAP * rate / frequency) - 1)


def find_short_gaps(missing: np.ndarray, most: int = 1) -> np.ndarray:
    """The missing samples that stand in short gaps, between two that are there.

    Parameters
    ----------
    missing : (N,) bools
        Which samples are missing.
    most : int
        The longest gap that is short, in samples.

    Returns
    -------
    (K,) ints
        None where more than 5 % of all samples are missing.

    Examples
    --------
    >>> missing = np.zeros(100, dtype=bool)
    >>> missing[[10, 50, 51]] = True
    >>> find_short_gaps(missing).tolist()
    [10]
    """
    if not missing.any() or missing.mean() > MOST_BRIDGED_SHARE:
        return np.empty(0, dtype=int)
    edges = np.flatnonzero(np.diff(missing.astype(np.int8), prepend=0, append=0))
    firsts, stops = edges[::2], edges[1::2]
    short = (stops - firsts <= most) & (firsts > 0) & (stops < len(missing))
    return np.flatnonzero(missing & np.isin(_number_runs(missing), np.flatnonzero(short)))


def _number_runs(missing: np.ndarray) -> np.ndarray:
    """The number (N,) of the gap that each missing sample belongs to, from 0; -1 of the others."""
    begins = missing & ~np.concatenate([[False], missing[:-1]])
    return np.where(missing, np.cumsum(begins) - 1, -1)


def find_lost_rows(t: np.ndarray, most: int = 1) -> np.ndarray:
    """The rows before which rows of uniform times are missing.

    Parameters
    ----------
    t : (N,) [s]
        Times.
    most : int
        The largest number of rows in a row that may be missing.

    Returns
    -------
    (K,) ints
        Each as often as rows are missing before it. None where more are missing somewhere, or where
        the times are not uniform but for that.

    Examples
    --------
    >>> t = np.delete(np.arange(100) * 0.01, 40)
    >>> find_lost_rows(t).tolist()
    [40]
    """
    none = np.empty(0, dtype=int)
    if len(t) < 4 or not np.isfinite(t).all():
        return none
    steps = np.diff(t)
    if not (steps > 0).all():
        return none
    ratio = steps / np.median(steps)
    lacking = np.maximum(np.ceil(ratio - 0.5).astype(int) - 1, 0)
    lost = lacking > 0
    beside = (lost[1:] & lost[:-1]).any()
    if (ratio < 2 / 3).any() or lacking.max() > most or beside or lost.mean() > MOST_BRIDGED_SHARE:
        return none
    return np.repeat(np.arange(1, len(t)), lacking)


def insert_missing(x: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Values (N,) with one that is missing (nan) before each of the rows (K,).

    Examples
    --------
    >>> insert_missing(np.array([1.0, 2.0]), np.array([1])).tolist()
    [1.0, nan, 2.0]
    """
    return np.insert(np.asarray(x, dtype=float), rows, np.nan)


def insert_times(t: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Times (N,) with evenly spaced ones before each of the rows (K,).

    Examples
    --------
    >>> insert_times(np.array([0.0, 2.0]), np.array([1])).tolist()
    [0.0, 1.0, 2.0]
    """
    missing = insert_missing(t, rows)
    return bridge_values(missing, np.flatnonzero(np.isnan(missing)))


def bridge_values(x: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Values (N,) in which those at the samples `at` (K,) lie on straight lines between the others.

    Examples
    --------
    >>> bridge_values(np.array([1.0, np.nan, np.nan, 4.0]), np.array([1, 2])).tolist()
    [1.0, 2.0, 3.0, 4.0]
    """
    bridged = np.array(x, dtype=float)
    there = np.delete(np.arange(len(x)), at)
    bridged[at] = np.interp(at, there, bridged[there])
    return bridged


def estimate_wave_values(x: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The values of a wave at missing samples, by the cubic through two on either side of a gap.

    Of 20 samples a cycle it is right to 0.2 %, of 64 to 2e-5, where one is missing. Where one of
    the outer two is missing as well, the straight line through the inner two is taken.

    Parameters
    ----------
    x : (N,)
        The wave, nan where it is missing.
    at : (K,) ints
        The missing samples, none of them at an end.

    Returns
    -------
    (K,) array

    Examples
    --------
    >>> wave = np.arange(6.0) ** 3
    >>> wave[3] = np.nan
    >>> estimate_wave_values(wave, np.array([3])).round(9).tolist()
    [27.0]
    """
    there = np.flatnonzero(~np.isnan(x))
    after = there[np.searchsorted(there, at)]
    before = there[np.searchsorted(there, at) - 1]
    outer = np.pad(x, 1, constant_values=np.nan)
    # in samples from the one before the gap: the one that is asked for, and the one after
    s, g = at - before, after - before
    weights = (
        -s * (s - g) * (s - g - 1) / ((1 + g) * (2 + g)),
        (s + 1) * (s - g) * (s - g - 1) / (g * (g + 1)),
        (s + 1) * s * (g + 1 - s) / (g * (g + 1)),
        (s + 1) * s * (s - g) / ((g + 1) * (g + 2)),
    )
    values = outer[before], x[before], x[after], outer[after + 2]
    cubic = np.sum([w * v for w, v in zip(weights, values, strict=True)], axis=0)
    return np.where(np.isfinite(cubic), cubic, (x[before] * (g - s) + x[after] * s) / g)


def describe_bridged(times: Sequence[float]) -> str:
    """The beginning of a sentence on bridged samples: how many, and at which times [s].

    Examples
    --------
    >>> describe_bridged([0.1])
    '1 sample missing at t = 0.1 s'
    """
    when = ", ".join(f"{t:.6g}" for t in times[:NAMED_TIMES])
    more = f" and {len(times) - NAMED_TIMES} more" if len(times) > NAMED_TIMES else ""
    return f"{count_noun(len(times), 'sample')} missing at t = {when} s{more}"
