"""Several dips of one file, numbered in order of time: cut out, on one base, fitted and held out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tractexp.errors import UserError
from tractexp.record.event import detect, find_dips, steady
from tractexp.record.reader import Events
from tractexp.record.record import Record


@dataclass(frozen=True)
class Dip:
    """One dip of a file: when it was, and the record cut out about it, or why that cannot be used."""

    number: int  # from 1
    start: float  # s
    end: float  # s
    made: Record | UserError


def numbered(wholes: Sequence[Record], where: str, pre: float, post: float) -> list[Dip]:
    """The dips of records that follow each other, with at most `pre` and `post` [s] about the start of each.

    A record never reaches into the dip before or after it. It is checked for an event, and not yet for its units.
    """
    made: list[Dip] = []
    for whole in wholes:
        t, dips = whole.t, find_dips(whole.t, whole.U)
        firsts, stops = [0, *(end for _, end in dips)], [*(start for start, _ in dips[1:]), whole.samples]
        for first, (start, end), stop in zip(firsts, dips, stops, strict=False):
            early, late = np.searchsorted(t, [t[start] - pre, t[start] + post]).tolist()
            window, number = slice(max(first, early), min(stop, late)), len(made) + 1
            name, source = f"{whole.name}_dip{number}", f"{where} dip {number}"
            record = _refused(replace(whole, name=name, source=source, **_part(whole, window)))
            made.append(Dip(number, float(t[start]), float(t[min(end, len(t) - 1)]), record))
    return made


def _part(whole: Record, window: slice) -> dict[str, Any]:
    more = {name: values[window] for name, values in whole.more.items()}
    return {name: values[window] for name, values in whole.channels.items()} | {"more": more}


def _refused(record: Record) -> Record | UserError:
    try:
        detect(record)
    except UserError as error:
        return error
    return record


def level(record: Record) -> tuple[float, float]:
    """Voltage and apparent power, in the record's units, before its first dip; of all of it where there is none."""
    before = steady(record)
    P, Q = (values[before][np.isfinite(values[before])] for values in (record.P, record.Q))
    S = float(np.hypot(P.mean(), Q.mean())) if len(P) and len(Q) else 0.0
    return float(record.U[before].mean()), S


def chosen(where: str, dips: Sequence[Dip], train: Sequence[int] | None, validate: Sequence[int] | None,
           notes: Sequence[str] = ()) -> Events:  # fmt: skip
    """The records of the dips asked for; by default the first that can be used is fitted and all others validate.

    `notes` are of the whole file: said once, on the first record. Raises `UserError`, naming the dips that can be used,
    for one that cannot.
    """
    tried = {dip.number: dip.made for dip in dips}
    usable = [number for number, made in tried.items() if isinstance(made, Record)]
    fitted = list(train or usable[:1] or [1])
    first, *rest = [_picked(where, number, tried) for number in fitted]
    notes = (*first.notes, *notes)
    if validate is not None:
        held = [_picked(where, number, tried) for number in validate]
        return Events([replace(first, notes=notes), *rest], held)
    others = [made for number, made in tried.items() if number not in fitted]
    notes += tuple(f"not used for validation: {made}" for made in others if isinstance(made, UserError))
    return Events([replace(first, notes=notes), *rest], [made for made in others if isinstance(made, Record)])


def check_numbers(train: Sequence[int] | None, validate: Sequence[int] | None) -> None:
    """Raise `UserError` for no dip to fit, and for one that is named twice."""
    if train is not None and not train:
        raise UserError("data.train is empty: name at least one dip by its number, e.g. data.train=[1]")
    given = [*(train or []), *(validate or [])]
    for number in given:
        if given.count(number) > 1:
            raise UserError(f"data.train and data.validate name dip {number} twice; a dip may serve only once")


def _picked(where: str, number: int, tried: Mapping[int, Record | UserError]) -> Record:
    usable = ", ".join(f"{n} at {r.t[0]:.3f} to {r.t[-1]:.3f} s" for n, r in tried.items() if isinstance(r, Record))
    made = tried.get(number, UserError(f"{where}: there is no dip {number}; {len(tried)} are found"))
    if isinstance(made, UserError):
        raise UserError(f"{made}; dips that can be used: {usable or 'none'}")
    return made
