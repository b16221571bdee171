"""Which dip of a record an event is, and what the reader that cuts it out notes."""

from collections.abc import Iterator, Sequence

import numpy as np

from tractexp.errors import UserError
from tractexp.record import Event, Record, detect
from tractexp.record.dips import FileDip
from tractexp.recording.happening import Happening
from tractexp.recording.sight import LoadEvent

LATEST_START = 0.06  # s: three cycles, within which what happened and the dip that is fitted begin


def number_events(
    changes: Sequence[Happening], dips: Sequence[FileDip], source: str, refused: str = ""
) -> Iterator[LoadEvent]:
    """The events, each with the dip that the reader cuts out of it."""
    results = {dip.number: dip.result for dip in dips}
    for what, number in zip(changes, _number_dips(changes, dips), strict=True):
        event, why = _detect_event(results.get(number) if number else None, refused)
        if event is not None and abs(event.t_start - what.start) > LATEST_START:
            why, event = _explain_start(event.t_start, what.start), None
        yield LoadEvent(
            what,
            number,
            event,
            _explain_worth(what, event, why.removeprefix(f"{source} dip {number}: ")),
        )


def _explain_start(start: float, fall: float) -> str:
    """Why the dip that a reader cuts out [s] begins at another moment than the fall, one clause."""
    when = "after" if start > fall else "before"
    return (
        f"what would be fitted begins {abs(start - fall):.2g} s {when} it: the voltage is not"
        " steady before the dip, from which P0, Q0 and the depth are counted; choose another event"
    )


def _detect_event(result: Record | UserError | None, refused: str) -> tuple[Event | None, str]:
    """The event of a record with what the detection noted of it, or why there is none."""
    if not isinstance(result, Record):
        return None, str(result or refused or "it is no dip")
    try:
        event = detect(result)
        return event, "; ".join(note for note in event.record.notes if note not in result.notes)
    except UserError as error:
        return None, str(error)


def _number_dips(changes: Sequence[Happening], dips: Sequence[FileDip]) -> list[int | None]:
    """For each happening the dip, counted from 1, that shares more of its time with it than with
    any other.
    """
    numbers: list[int | None] = [None] * len(changes)
    for dip in dips:
        # a cycle more on either side, for windows blur both
        shared = [min(what.end, dip.end) - max(what.start, dip.start) + 0.02 for what in changes]
        if shared and max(shared) > 0 and numbers[int(np.argmax(shared))] is None:
            numbers[int(np.argmax(shared))] = dip.number
    return numbers


def _explain_worth(what: Happening, event: Event | None, refused: str) -> str:
    """The reason why an event is (not) worth fitting: itself, or that it gives no record; and what
    the detection noted.
    """
    if not what.worth:
        return what.why
    return (
        f"{what.why}; {refused}".removesuffix("; ")
        if event is not None
        else f"it gives no record: {refused}"
    )
