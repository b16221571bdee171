"""Feeders whose currents add up to nothing belong to one bus, as they are or with one counted the other way."""

from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from tractexp.recording.snapshot import UNLOADED, Snapshots

if TYPE_CHECKING:
    from tractexp.recording.feeder import Feeder

CLOSES = 0.03  # of the sum of magnitudes: currents that add up to less belong to one bus


def closed_sums(phasors: Snapshots, feeders: "list[Feeder]") -> "list[Feeder]":
    """The feeders, with a note where the sum of their currents is zero, as they are or with one reversed.

    The whole station first, then the feeders of each bus.
    """
    three = [k for k, f in enumerate(feeders) if len(f.currents) == 3]
    level = max((phasors.size(feeders[k].currents) for k in three), default=0.0)
    loaded = [k for k in three if phasors.size(feeders[k].currents) > UNLOADED * level]
    if closed := _closed(phasors, feeders, loaded):
        return _said(feeders, loaded, *closed)
    for bus in sorted({feeders[k].voltages for k in loaded}):
        own = [k for k in loaded if feeders[k].voltages == bus]
        if closed := _closed(phasors, feeders, own):
            feeders = _said(feeders, own, *closed)
    return feeders


def _closed(phasors: Snapshots, feeders: "list[Feeder]", loaded: list[int]) -> tuple[np.ndarray, float] | None:
    """(signs, residual) of the simplest sum of three or more currents that closes; None where none does."""
    if len(loaded) < 3:
        return None
    X = np.array([phasors.of(feeders[k].currents) for k in loaded])  # (F, 3, M)
    X = X[:, :, np.isfinite(X).all(axis=(0, 1))]
    if not X.size:
        return None
    plain, each = np.ones(len(loaded)), np.arange(len(loaded))
    tried = [plain, *(np.where(each == k, s, plain) for k in each for s in (0, -1))]
    if len(loaded) > 4:
        tried += [np.where(np.isin(each, pair), 0, plain) for pair in combinations(each, 2)]
    tried = [signs for signs in tried if np.count_nonzero(signs) >= 3]
    closes = [_closure(X, signs) for signs in tried]
    if min(closes) >= CLOSES:
        return None
    simple = next(k for k in range(len(tried)) if closes[k] < max(CLOSES / 3, 2 * min(closes)))
    return tried[simple], closes[simple]


def _closure(X: np.ndarray, signs: np.ndarray) -> float:
    """Sum of the currents over the sum of their magnitudes, root mean square over phases and time."""
    total = np.tensordot(signs, X, axes=1)
    return float(np.linalg.norm(total) / np.linalg.norm(np.tensordot(np.abs(signs), np.abs(X), axes=1)))


def _said(feeders: "list[Feeder]", loaded: list[int], signs: np.ndarray, closes: float) -> "list[Feeder]":
    marked = list(feeders)
    out = [feeders[k].name for k, s in zip(loaded, signs, strict=True) if s == 0]
    for k, sign in zip(loaded, signs, strict=True):
        said = f"the currents of {np.count_nonzero(signs)} feeders add up to {100 * closes:.2g} % of their magnitudes"
        if out:
            said += f", without {' and '.join(out)}" + (": a bus tie, or one of another bus" if sign == 0 else "")
        if sign < 0:
            said += " once this one's polarity is reversed"
        marked[k] = replace(marked[k], reverse_current=bool(sign < 0), why=(*marked[k].why, said))
    return marked
