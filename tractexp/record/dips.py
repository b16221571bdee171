"""Several dips of one file, numbered in order of time, each cut out as a record to be fitted or
held out.
"""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.cache.provenance import hash_record
from tractexp.errors import DATA, UserError
from tractexp.record.direction import OUTWARD, explain_negative_power
from tractexp.record.event import Event, detect, find_steady_part
from tractexp.record.fall import find_dips
from tractexp.record.reader import Events
from tractexp.record.record import GREATEST_CURRENT, SIZES, Record

LONGEST_REACH = 60.0  # s of a record that are used before its dip and after
# of a dip's depth: an earlier one that is shallower leaves no machines that still accelerate
LEAST_EARLIER_DEPTH = 0.5


@dataclass(frozen=True)
class FileDip:
    """One dip of a file: its time, and the record cut out about it, or the error that says why it
    cannot be used.
    """

    number: int  # from 1
    start: float  # s
    end: float  # s
    result: Record | UserError


def cut_dips(
    wholes: Sequence[Record], where: str, pre: float, post: float, triggers: Sequence[float] = ()
) -> list[FileDip]:
    """The dips of records that follow each other, with at most `pre` and `post` [s] about the start
    of each.

    `triggers` [s] are those of the recorder, one a record at most. A record never reaches into the
    dip before it, nor into that after it, unless the load is not at rest in between: it does not
    start anew there, and both are one record. It is checked for an event, and not yet for its
    units.
    """
    file_dips: list[FileDip] = []
    for whole in wholes:
        t = whole.t
        trigger = next((moment for moment in triggers if t[0] <= moment <= t[-1]), None)
        dips = find_dips(t, whole.U, trigger)
        firsts = [0, *(end for _, end in dips)]
        stops = [*(start for start, _ in dips[1:]), whole.samples]
        head = None  # the dip before, whose record may go on
        for first, (start, end), stop in zip(firsts, dips, stops, strict=False):
            early, late = np.searchsorted(t, [t[start] - pre, t[start] + post]).tolist()
            window = slice(max(first, early), min(stop, late))
            one = _Cut(whole, window, where, len(file_dips) + 1)
            joined = head.join(one) if head is not None and first > early else None
            if head is not None and joined is not None:
                before = file_dips[head.number - 1]
                file_dips[head.number - 1] = replace(before, result=joined.result)
                result: Record | UserError = head.refuse_next(one)
                head = joined
            else:
                result = one.result
                head = one if isinstance(result, Record) else None
            end_time = float(t[min(end, len(t) - 1)])
            file_dips.append(FileDip(one.number, float(t[start]), end_time, result))
    return file_dips


@dataclass(frozen=True)
class _Cut:
    """A dip of a record, by its number and the samples about it."""

    whole: Record
    window: slice
    where: str
    number: int

    @functools.cached_property
    def result(self) -> Record | UserError:
        """The samples as a record, or the error that says why it cannot be used."""
        return self._event if isinstance(self._event, UserError) else self._record

    @property
    def _record(self) -> Record:
        name = f"{self.whole.name}_dip{self.number}"
        source = f"{self.where} dip {self.number}"
        return replace(self.whole.part(self.window), name=name, source=source)

    @functools.cached_property
    def _event(self) -> Event | UserError:
        try:
            return detect(self._record)
        except UserError as error:
            return error

    def join(self, following: "_Cut") -> "_Cut | None":
        """Both dips as one; None where the load is at rest between them or moves for another reason
        than the first, a shallow one, and where either cannot be used.
        """
        own, event = self._event, following._event
        if isinstance(own, UserError) or isinstance(event, UserError):
            return None
        shallow = own.depth < LEAST_EARLIER_DEPTH * event.depth
        if event.at_rest or shallow:
            return None
        both = replace(self, window=slice(self.window.start, following.window.stop))
        return both if isinstance(both.result, Record) else None

    def refuse_next(self, following: "_Cut") -> UserError:
        """That the dip that follows is fitted as a part of this one."""
        return UserError(
            f"{self.where} dip {following.number}: the load is not at rest before it: it is fitted"
            f" as a part of dip {self.number}, which goes on through it"
        )


def leave_out_bridged(record: Record, times: Sequence[float], reach: float) -> Record:
    """The record with P and Q nan wherever, within a dip, a sample nearer than `reach` [s] was
    bridged; outside of dips a bridged sample is as good as a recorded one.

    `times` (K,) [s] are those of bridged samples, ascending.
    """
    if not len(times):
        return record
    t = record.t
    inside = np.zeros(record.samples, dtype=bool)
    for start, end in find_dips(t, record.U):
        inside[start:end] = True
    first, stop = (np.searchsorted(times, t + side) for side in (-reach, reach))
    at = stop > first
    P, Q = (np.where(inside & at, np.nan, x) for x in (record.P, record.Q))
    return replace(record, P=P, Q=Q)


def view_dip(event: Event) -> Event:
    """The event in the part of its record about its dip; itself where the record is hardly longer.

    Every simulation goes through all of it, and a load has answered long before an hour is over.
    """
    record = event.record
    t = event.record.t
    end = t[min(event.end, record.samples - 1)]
    first, stop = np.searchsorted(t, [event.t_start - LONGEST_REACH, end + LONGEST_REACH]).tolist()
    if record.waves is not None or stop - first == record.samples:
        return event
    note = (
        f"of {t[-1] - t[0]:.0f} s those from {t[first]:.0f} to {t[stop - 1]:.0f} s are used, about"
        " the first dip"
    )
    part = record.part(slice(first, stop))
    return detect(replace(part, digest=hash_record(record), notes=(*record.notes, note)))


def level(record: Record) -> tuple[float, float]:
    """Voltage and apparent power, in the record's units, before its first dip; of all of it where
    there is none.
    """
    before = find_steady_part(record)
    P, Q = (values[before][np.isfinite(values[before])] for values in (record.P, record.Q))
    S = float(np.hypot(P.mean(), Q.mean())) if len(P) and len(Q) else 0.0
    return float(record.U[before].mean()), S


def check_load(where: str, U: float, S: float = 0.0) -> None:
    """Raise `UserError` for a load of U [kV] and S [MVA] that no network feeds: another unit was
    meant.
    """
    low, high = SIZES["voltage"]
    if not low <= U <= high:
        raise UserError(
            f"{where}: the voltage before the first dip is {U:.4g} kV, and a network's is at most"
            f" {high:g} kV; if the numbers are in V, say so: {DATA.units}={{U: V}}"
        )
    if np.sqrt(3) * U * GREATEST_CURRENT < S:
        raise UserError(
            f"{where}: {S:.4g} MVA at {U:.4g} kV before the first dip is a current of"
            f" {S / np.sqrt(3) / U:.4g} kA, and no load draws as much; say the units of voltage and"
            f" of current or power, such as {DATA.units}={{U: kV, I: A}} or {DATA.units}={{U: kV,"
            f" P: kW, Q: kvar}}"
        )


def signs(record: Record) -> list[str]:
    """A sentence on each odd sign of P and Q in a table before its first dip.

    Raises `UserError` for a load that is counted out of itself for certain.
    """
    calm = np.zeros(record.samples, bool)
    calm[find_steady_part(record)] = True
    P, Q = (
        float(np.nanmedian(x[calm])) if np.isfinite(x[calm]).any() else 0.0
        for x in (record.P, record.Q)
    )
    reason = explain_negative_power(record.U, record.P, record.Q, calm=calm)
    if OUTWARD in reason:
        raise UserError(
            f"{record.where}: P is {record.base.power * P:.4g} before the first dip: {reason}"
        )
    said = [f"P is {record.base.power * P:.4g} before the first dip: {reason}"] if reason else []
    if abs(Q) > abs(P):
        said.append(
            f"Q ({record.base.power * Q:.4g}) is greater than P ({record.base.power * P:.4g})"
            " before the first dip: "
            "the two columns may be exchanged (data.columns={P: ..., Q: ...} says which is which)"
        )
    return said


def chosen(
    where: str,
    dips: Sequence[FileDip],
    train: Sequence[int] | None,
    validate: Sequence[int] | None,
    notes: Sequence[str] = (),
) -> Events:
    """The records of the chosen dips; by default the first usable one is fitted and all others
    validate.

    `notes` concern the whole file and go to the first record. Raises `UserError`, naming the usable
    dips, for one that cannot be used.
    """
    results = {dip.number: dip.result for dip in dips}
    usable = _select_usable(results)
    fitted = list(train or [*usable][:1] or [1])
    first, *rest = [_pick_dip(where, number, results) for number in fitted]
    notes = [*first.notes, *notes]
    if validate is not None:
        held = [_pick_dip(where, number, results) for number in validate]
    else:
        held = [record for number, record in usable.items() if number not in fitted]
        unusable = sorted(results.keys() - usable.keys())
        notes += [f"not used for validation: {results[number]}" for number in unusable]
    return Events([replace(first, notes=tuple(notes)), *rest], held)


def check_numbers(train: Sequence[int] | None, validate: Sequence[int] | None) -> None:
    """Raise `UserError` for no dip to fit, and for one that is named twice."""
    if train is not None and not train:
        raise UserError(
            f"{DATA.train} is empty: name at least one dip by its number, e.g. {DATA.train}=[1]"
        )
    numbers = [*(train or []), *(validate or [])]
    for number in numbers:
        if numbers.count(number) > 1:
            raise UserError(
                f"{DATA.train} and {DATA.validate} name dip {number} twice; a dip may serve only"
                " once"
            )


def _pick_dip(where: str, number: int, results: Mapping[int, Record | UserError]) -> Record:
    """The record of a dip by its number from 1. Raises `UserError` with the dips that can be
    used.
    """
    result = results.get(
        number, UserError(f"{where}: there is no dip {number}; the file has {len(results)}")
    )
    if isinstance(result, Record):
        return result
    usable = ", ".join(
        f"{n} at {r.t[0]:.3f} to {r.t[-1]:.3f} s" for n, r in _select_usable(results).items()
    )
    raise UserError(f"{result}; dips that can be used: {usable or 'none'}")


def _select_usable(results: Mapping[int, Record | UserError]) -> dict[int, Record]:
    """{number: record} of the dips that can be used."""
    return {number: one for number, one in results.items() if isinstance(one, Record)}
