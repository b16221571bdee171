"""What a load does after a dip for another reason than the voltage: a record ends there."""

from dataclasses import replace

import numpy as np

from tractexp.cache.provenance import hash_record
from tractexp.record.change import (
    CHANGED,
    describe_change,
    describe_power_change,
    fill_gaps,
    load_changes,
    measure_smear,
)
from tractexp.record.record import Record

LOST = 0.5  # of the apparent power before: what has less left after a dip has lost load in it
FEWEST_AFTER, AFTER = 5, 0.1  # samples, s: what changes sooner after a dip is not cut off
BACK = 0.9  # of the voltage before a dip: at less a load may go with it
SETTLED = 0.1, 0.5  # s after a dip between which a loss is judged


def cut_at_change(record: Record, start: int, end: int, S: complex) -> Record:
    """The record up to where its load changes after a dip for another reason, with a note; else the
    record itself.

    `S` is P + jQ before the dip. A step back towards it, as of what tripped and returns, is the
    load's answer to the dip. What changes right after the dip is noted only, and power that is fed
    back may change as it likes.
    """
    if S.real <= 0:
        return record
    cycle, least = measure_smear(record), max(FEWEST_AFTER, round(AFTER * record.rate))
    for change in load_changes(record.U[start:], record.P[start:], record.Q[start:], cycle):
        if start + change.first < end + cycle or abs(change.after - S) <= abs(change.before - S):
            continue
        what, at = describe_change(record, start, change), start + change.first
        if at - end >= least:
            return _cut_aftermath(record, at, what)
        said = (
            f"{what}, {1000 * (at - end) * record.step:.0f} ms after the dip: it is fitted as part"
            " of the answer"
        )
        return _add_note(record, said)
    return _cut_where_load_goes(record, end + least, S, BACK * float(np.median(record.U[:start])))


def _cut_where_load_goes(record: Record, first: int, S: complex, U: float) -> Record:
    """The record up to where its load begins to go though it was there at sample `first` and the
    voltage exceeds U.
    """
    size = np.abs(fill_gaps(record.P) + 1j * fill_gaps(record.Q))[first:]
    gone = (size < LOST * abs(S)) & (record.U[first:] > U)
    n = max(1, round(measure_smear(record)))
    if len(size) < 2 * n or gone[:n].any() or not gone[-n:].all():
        return record
    stop = int(np.argmax(gone))
    there = np.flatnonzero(size[:stop] >= (1 - CHANGED) * np.median(size[: max(stop // 2, n)]))
    at = first + (int(there[-1]) if len(there) else 0)
    what = (
        f"the load goes after t = {record.t[at]:g} s, to {100 * size[-n:].mean() / abs(S):.0f} % of"
        " that before the dip"
    )
    return _cut_aftermath(record, at, what)


def _cut_aftermath(record: Record, at: int, why: str) -> Record:
    """The record up to the sample `at`, with a note that says why."""
    return _add_note(
        replace(record.part(slice(0, at)), digest=hash_record(record)),
        f"{why}: the record is cut there",
    )


def describe_loss(record: Record, end: int, S: complex) -> list[str]:
    """A sentence on a load that has less than half of its power `S`, P + jQ, left after a dip; []
    of any other.
    """
    first, stop = np.searchsorted(record.t, record.t[end] + np.array(SETTLED)).tolist()
    P, Q = record.P[first:stop], record.Q[first:stop]
    if not (np.isfinite(P) & np.isfinite(Q)).any():
        return []
    left = complex(np.nanmedian(P), np.nanmedian(Q))
    if abs(left) >= LOST * abs(S):
        return []
    return [
        f"the load loses {100 * (1 - abs(left) / abs(S)):.0f} % of its power in the dip"
        f" ({describe_power_change(record, S, left)}): it trips, which a model without the effect"
        " undervoltage_trip cannot follow"
    ]


def _add_note(record: Record, note: str) -> Record:
    """The record with a note, once."""
    return record if note in record.notes else replace(record, notes=(*record.notes, note))
