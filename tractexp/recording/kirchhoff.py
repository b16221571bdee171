"""Feeders whose currents add up to nothing belong to one bus, as they are or with one counted the
other way.
"""

from dataclasses import replace

import numpy as np

from tractexp.recording.feeder import Feeder
from tractexp.recording.snapshot import UNLOADED, Snapshots

CLOSED_SUM = "add up to"  # in the note of a sum that closes
# the same where one is left out or turned round, of which some are near zero by accident
CLOSES_CHANGED = 0.02
LARGEST_TIE_DIFFERENCE = 0.1  # of a tie's current, by which it is off the sum of a bus
CLOSES = 0.03  # of the sum of magnitudes: currents that add up to less belong to one bus


BY_SIGN = {
    -1: " once this one's polarity is reversed",
    0: ": a bus tie, or one of another bus",
    1: "",
}  # of a feeder in a sum that closes, what is said of it


def _find_loaded(phasors: Snapshots, feeders: list[Feeder]) -> list[int]:
    """The numbers of the feeders of three currents that are not small beside the greatest."""
    sizes = {k: phasors.size(f.currents) for k, f in enumerate(feeders) if len(f.currents) == 3}
    level = max(sizes.values(), default=0.0)
    return [k for k, size in sizes.items() if size > UNLOADED * level]


def note_closed_sums(phasors: Snapshots, feeders: list[Feeder]) -> list[Feeder]:
    """The feeders, with a note where the sum of their currents is zero, as they are or with one
    reversed.

    The whole station first, then the feeders of each bus.
    """
    loaded = _find_loaded(phasors, feeders)
    if closed := _find_closed_sum(phasors, feeders, loaded):
        return _describe_closure(phasors, feeders, loaded, *closed)
    for bus in sorted({feeders[k].voltages for k in loaded}):
        own = [k for k in loaded if feeders[k].voltages == bus]
        if closed := _find_closed_sum(phasors, feeders, own):
            feeders = _describe_closure(phasors, feeders, own, *closed)
    return feeders


def _find_closed_sum(
    phasors: Snapshots, feeders: list[Feeder], loaded: list[int]
) -> tuple[np.ndarray, float] | None:
    """(signs, residual) of the simplest sum of three or more currents that closes; None where none
    does.
    """
    if len(loaded) < 3:
        return None
    X = np.array([phasors.select_channels(feeders[k].currents) for k in loaded])  # (F, 3, M)
    X = X[:, :, np.isfinite(X).all(axis=(0, 1))]
    if not X.size:
        return None
    tried = _list_signs(len(loaded))
    closes = _measure_closures(X.reshape(len(X), -1), tried)
    closed = closes < np.where((tried == 1).all(axis=1), CLOSES, CLOSES_CHANGED)
    if not closed.any():
        return None
    enough = max(CLOSES / 3, 2 * closes[closed].min())
    simple = int(np.argmax(closed & (closes < enough)))
    return tried[simple], float(closes[simple])


def _list_signs(count: int) -> np.ndarray:
    """Signs (T, count) that are tried: all as they are, one left out or turned round, and two left
    out of five.
    """
    plain = np.ones(count)
    each = np.eye(count)
    tried = [plain[None], *(plain - s * each[k : k + 1] for k in range(count) for s in (1, 2))]
    if count > 4:
        first, second = np.triu_indices(count, 1)
        tried.append(plain - each[first] - each[second])
    signs = np.concatenate(tried)
    return signs[np.count_nonzero(signs, axis=1) >= 3]


def _measure_closures(X: np.ndarray, signs: np.ndarray) -> np.ndarray:
    """Sums (T,) of currents (F, M) over the sums of their magnitudes, by signs (T, F), root mean
    square over time.
    """
    total = np.real(X.conj() @ X.T)
    magnitudes = np.abs(X) @ np.abs(X).T
    sums = np.maximum(((signs @ total) * signs).sum(axis=1), 0.0)
    most = ((np.abs(signs) @ magnitudes) * np.abs(signs)).sum(axis=1)
    return np.sqrt(sums / np.maximum(most, 1e-300))


def _ties_buses(
    phasors: Snapshots, feeders: list[Feeder], loaded: list[int], signs: np.ndarray, tie: int
) -> bool:
    """Whether feeder `tie`, without which the others of a station add up to nothing, is no load:
    they are of its own bus, or its current is the sum of those of another one.
    """
    buses = {feeders[k].voltages for k in loaded if k != tie}
    if len(buses) == 1:
        return buses == {feeders[tie].voltages}
    own = phasors.select_channels(feeders[tie].currents)
    for bus in buses:
        there = zip(loaded, signs, strict=True)
        parts = [
            s * phasors.select_channels(feeders[k].currents)
            for k, s in there
            if s and feeders[k].voltages == bus
        ]
        total = np.sum(parts, axis=0)
        apart = min(np.nanmean(np.abs(own - total)), np.nanmean(np.abs(own + total)))
        if apart < LARGEST_TIE_DIFFERENCE * np.nanmean(np.abs(own)):
            return True
    return False


def _describe_closure(
    phasors: Snapshots,
    feeders: list[Feeder],
    loaded: list[int],
    signs: np.ndarray,
    closes: float,
) -> list[Feeder]:
    """The feeders, each told that the currents of all close, and which of them are counted
    backward.
    """
    marked = list(feeders)
    out = [feeders[k].name for k, s in zip(loaded, signs, strict=True) if s == 0]
    for k, sign in zip(loaded, signs, strict=True):
        said = (
            f"the currents of {np.count_nonzero(signs)} feeders {CLOSED_SUM} {100 * closes:.2g} %"
            " of their magnitudes"
        )
        said += f", without {' and '.join(out)}" if out else ""
        said += BY_SIGN[int(sign)]
        alone = sign == 0 and len(out) == 1
        coupler = alone and _ties_buses(phasors, feeders, loaded, signs, k)
        said += ", and no load of this one" if coupler else ""
        marked[k] = replace(
            marked[k],
            reverse_current=bool(sign < 0),
            why=(*marked[k].why, said),
            loaded=marked[k].loaded and not coupler,
        )
    return marked
