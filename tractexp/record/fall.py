"""Where a voltage falls and rises: the dips and the swells in its samples."""

import numpy as np

from tractexp.record.record import DEAD_VOLTAGE_SHARE

SHALLOWEST = 0.03  # of the voltage before: anything less is no dip
NOISE_FACTOR = 6.0  # standard deviations of noise that a dip must exceed
# of the depth: the dip ends when no more than this is missing, or the threshold if that is more
RECOVERED = 0.2
FEWEST_BEFORE = 10  # samples before a dip, for the steady state and the noise
MERGED = 0.02  # s: dips closer than one cycle are one
STEADY = 1.0  # s: the steady state is the mean over at most so long before the dip
REFERENCE = 0.1  # s at the start, or after a change, whose median is the reference
NO_STEP = 0.13  # of the voltage: no tap changer and no switched line raises it by more
SUDDEN = 0.06  # s: three cycles, within which a dip begins; a voltage that slid before is its level
NOT_YET_BEGUN = 0.9  # of a sudden change: as long as so much of it is to come it has not begun
# s: what lasts so long at the start was before the event, and not a window that holds a part of it
CERTAIN = 0.02
NEAR_TRIGGER = 60.0  # s: a trigger that comes later says nothing of the record's first voltage


def find_starting_level(
    t: np.ndarray, levels: np.ndarray, limits: np.ndarray, most: int, trigger: float | None = None
) -> np.ndarray:
    """The levels (K,) of voltages (K, N) at times t (N,) [s] from which the first event leaves, by
    more than `limits`.

    That right before the recorder's trigger where it is steady; else that of the first samples, at
    most so many, or of what precedes the first change where fewer do. Where less than a cycle does,
    what follows counts if it is higher; and so it does where a record begins inside a dip, lower by
    more than a step, and most of it is at the later level.
    """
    at_trigger = _measure_level_before_trigger(t, levels, limits, trigger)
    if at_trigger is not None:
        return at_trigger
    first = levels[:, :most]
    middle = np.maximum(measure_growing_medians(first), 1e-12)
    stays = np.all(np.abs(first / middle - 1) <= limits[:, None] / 2, axis=0)
    # a dead channel leaves nothing
    count = len(stays) if stays.all() else max(1, int(np.argmin(stays)))
    level = np.median(first[:, :count], axis=1)
    last = levels[:, t >= t[-1] - max(REFERENCE, (t[-1] - t[0]) / 5)]
    after = np.median(last, axis=1)
    usual = np.median(levels, axis=1)
    if len(t) < FEWEST_BEFORE or (np.ptp(last, axis=1) > limits * after).any():
        return level
    if count < first.shape[1] and t[count - 1] - t[0] < CERTAIN / 2:
        return np.maximum(level, after)
    begun = (np.abs(usual - after) <= limits * after).all() and (
        level > DEAD_VOLTAGE_SHARE * after
    ).all()
    return after if begun and level[0] < (1 - NO_STEP) * after[0] else level


def _measure_level_before_trigger(
    t: np.ndarray, levels: np.ndarray, limits: np.ndarray, trigger: float | None
) -> np.ndarray | None:
    """The levels (K,) of voltages (K, N) right before the recorder's trigger [s]; None without one,
    where it comes at once or late, or where they are not steady there.
    """
    if trigger is None or not CERTAIN < trigger - t[0] < NEAR_TRIGGER:
        return None
    before = levels[:, (t < trigger - CERTAIN) & (t > trigger - CERTAIN - STEADY)]
    last = before[:, -max(2, round(REFERENCE * (len(t) - 1) / (t[-1] - t[0]))) :]
    if last.shape[1] < 2:
        return None
    middle = np.maximum(np.median(last, axis=1), 1e-12)
    return middle if (np.ptp(last, axis=1) <= limits * middle).all() else None


def find_dips(t: np.ndarray, U: np.ndarray, trigger: float | None = None) -> list[tuple[int, int]]:
    """All dips of a voltage, in order of time.

    A dip falls by more than 3 % (or six standard deviations of the sample noise) below a reference.
    That starts at the level of the first samples, follows slow changes, and starts anew after each
    dip and where a voltage that slid begins to fall. Rises are not dips, and a swell leaves the
    reference where it was.

    Parameters
    ----------
    t : (N,) [s]
        Times.
    U : (N,)
        Voltage, in any unit.
    trigger : float or None [s]
        When the recorder was triggered.

    Returns
    -------
    list of (int, int)
        First sample, and the first one after the dip: N where it never recovers.
    """
    return find_falls(t, U, trigger)[0]


def find_falls(
    t: np.ndarray, U: np.ndarray, trigger: float | None = None
) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """(dips, swells) of a voltage (N,), both as (start, end) sample numbers."""
    margin = choose_margin(U)
    block = max(FEWEST_BEFORE, round(0.1 * (len(t) - 1) / float(t[-1] - t[0])))
    reference = float(
        find_starting_level(t, U[None], np.array([margin]), FEWEST_BEFORE, trigger)[0]
    )
    within = max(1, round(SUDDEN * (len(t) - 1) / float(t[-1] - t[0])))
    dips: list[tuple[int, int]] = []
    swells: list[tuple[int, int]] = []
    k = slid = 0
    while k < len(U):
        part = U[k : k + block]
        below = part < (1 - margin) * reference
        if not below.any():
            level = measure_median(part)
            if level > (1 + margin) * reference and (
                swell := _find_swell(t, U, k, reference, margin)
            ):
                swells.append(swell)
                k = swell[1]
                continue
            reference += 0.1 * (level - reference)
            k += len(part)
            continue
        crossing = k + int(np.argmax(below))
        start = _find_onset(U, dips[-1][1] if dips else 0, crossing, reference, margin)
        end = _find_recovery(U, crossing, reference, margin)
        if crossing - start > block:
            sudden = find_sudden_change(U[start:end], within, margin * reference)
            if sudden is not None and start + sudden > slid:
                slid = k = start + sudden
                reference = _follow_slide(U[start : slid + 1], within)
                continue
            # it slides on, and noise alone lifts it back over the threshold
            deepest = (1 - 2 * margin) * reference
            if sudden is None and U[start:end].min() > deepest:
                late = max(end - within, start)
                reference = measure_median(U[late : end + 1])
                k = end
                continue
        if dips and t[start] - t[dips[-1][1]] < MERGED:
            start = dips.pop()[0]
        dips.append((start, end))
        # the higher: the short one where another dip follows soon, the long one while U still rises
        if end < len(U):
            reference = max(measure_median(U[end : end + n]) for n in (FEWEST_BEFORE, block))
        k = end
    return dips, swells


def _follow_slide(U: np.ndarray, within: int) -> float:
    """The level to which a voltage (N,) slid by its last sample, however little of a dip that takes
    longer than `within` samples to begin it holds: by the course of what comes before.
    """
    if len(U) <= 2 * within:
        return measure_median(U[-within - 1 :])
    stop = len(U) - within + 1
    late = measure_median(U[max(stop - within - 1, 0) : stop])
    stop -= within
    early = measure_median(U[max(stop - within - 1, 0) : stop])
    fall = min(late - early, 0.0)
    return late + 1.5 * fall


def find_sudden_change(x: np.ndarray, within: int, least: float) -> int | None:
    """The sample right before a trace first changes suddenly.

    Parameters
    ----------
    x : (N,)
        The trace.
    within : int
        Samples within which a change is sudden.
    least : float
        What it exceeds.

    Returns
    -------
    int or None
        None where the trace only slides.
    """
    changes = x[within:] - x[:-within]
    sudden = np.abs(changes) > least
    if not sudden.any():
        return None
    first = int(np.argmax(sudden))
    same = np.sign(changes[first]) * changes[first:]
    over = same <= least
    same = same[: int(np.argmax(over))] if over.any() else same
    return first + int(np.flatnonzero(same >= NOT_YET_BEGUN * same.max())[-1])


def measure_median(x: np.ndarray) -> float:
    """The median of finite values (N,), N at least 1; of few it is much faster than NumPy's.

    Examples
    --------
    >>> measure_median(np.array([3.0, 1.0, 2.0, 10.0]))
    2.5
    """
    low = (len(x) - 1) // 2
    high = len(x) // 2
    ordered = np.partition(x, (low, high))
    return float(ordered[low] + ordered[high]) / 2


def measure_growing_medians(x: np.ndarray) -> np.ndarray:
    """The medians (K, N) of the first 1, 2, ... N of finite values (K, N).

    Examples
    --------
    >>> measure_growing_medians(np.array([[3.0, 1.0, 2.0]])).tolist()
    [[3.0, 2.0, 2.0]]
    """
    at = np.arange(x.shape[1])
    ordered = np.sort(np.where(at <= at[:, None], x[:, None], np.inf), axis=2)
    return (ordered[:, at, at // 2] + ordered[:, at, (at + 1) // 2]) / 2


def choose_margin(U: np.ndarray) -> float:
    """The share of the reference by which a voltage (N,) must fall to be in a dip.

    A voltage that is gone has no noise to exceed.
    """
    alive = U[DEAD_VOLTAGE_SHARE * U.max() < U]
    if len(alive) < FEWEST_BEFORE:
        return SHALLOWEST
    return max(SHALLOWEST, NOISE_FACTOR * float(sample_noise(alive) / np.median(alive)))


def sample_noise(x: np.ndarray) -> np.ndarray:
    """The standard deviation (...) of the noise of x (..., N) from sample to sample.

    It is robust, and blind to slow changes: the median of the differences counts.

    Examples
    --------
    >>> noise = np.random.default_rng(1).standard_normal(20000)
    >>> round(float(sample_noise(0.01 * noise + np.linspace(0, 1, 20000))), 4)
    0.01
    """
    return np.median(np.abs(np.diff(x)), axis=-1) / 0.6745 / np.sqrt(2)


def _find_swell(
    t: np.ndarray, U: np.ndarray, k: int, reference: float, margin: float
) -> tuple[int, int] | None:
    """The swell in the block from k on; None where the voltage stays at its new level, or falls
    from it after long.
    """
    first = k + int(np.argmax(U[k:] > (1 + margin) * reference))
    back = U[first:] <= (1 + margin) * reference
    if not back.any():
        return None
    end = first + int(np.argmax(back))
    near = np.flatnonzero(U[:first] <= (1 + margin / 10) * reference)
    first = int(near[-1]) + 1 if len(near) else first
    landed = float(np.median(U[end : end + FEWEST_BEFORE])) >= (1 - margin) * reference
    return (first, end) if landed or t[end] - t[first] <= STEADY else None


def _find_onset(U: np.ndarray, first: int, crossing: int, reference: float, margin: float) -> int:
    """The sample after the last one, not before `first`, that was still within a tenth of the
    margin.
    """
    high = np.flatnonzero(U[first:crossing] >= (1 - margin / 10) * reference)
    return first + int(high[-1]) + 1 if len(high) else crossing


def _find_recovery(U: np.ndarray, crossing: int, reference: float, margin: float) -> int:
    """The first sample that has recovered from the lowest voltage so far, or len(U)."""
    after = U[crossing:]
    missing = reference - np.minimum.accumulate(after)
    recovered = after >= reference - np.maximum(margin * reference, RECOVERED * missing)
    return crossing + int(np.argmax(recovered)) if recovered.any() else len(U)
