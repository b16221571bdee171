"""How steady a load is before an event: its steady state is that after its last step, where it is
at rest.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tractexp.errors import UserError
from tractexp.record.change import (
    CHANGED,
    LARGEST_USUAL_CHANGE,
    Change,
    describe_change,
    fill_gaps,
    find_voltage_changes,
    load_changes,
    measure_smear,
)
from tractexp.record.record import Record

REVERSED = 0.25  # of its range: a load that turns back by more swings
REST = 0.5  # of its mean slope that a course has left at most where it has come to rest
PARTS = 2, 4, 8  # the last half, quarter or eighth of a course may be at rest
AT_THE_END = 0.1  # s before an event, to which the mean over its steady state is compared
# cycles before a dip within which a step of less than so much of the power is taken for its own
EARLY = 1.5, 0.5
HISTORY = 3.0  # s before an event in which steps are looked for


def keep_steady_part(record: Record, part: slice, least: int) -> tuple[slice, list[str]]:
    """The samples of `part` before an event that are steady, and notes on the others.

    From the last step of the load or of its voltage on. Raises `UserError` where fewer than `least`
    samples are left.
    """
    begin, cycle = (
        max(0, min(part.start, part.stop - round(HISTORY * record.rate))),
        measure_smear(record),
    )
    U, P, Q = (x[begin : part.stop] for x in (record.U, record.P, record.Q))
    notes: list[str] = []
    first = part.start
    steps = [
        c
        for c in load_changes(U, P, Q, cycle)
        if begin + c.stop > first and not _may_step_be_dip(c, len(U), cycle)
    ]
    if last := steps[-1:]:
        first, what = begin + last[0].stop, describe_change(record, begin, last[0])
        lasts = (part.stop - first) * record.step
        if part.stop - first < least:
            raise UserError(
                f"{record.where}: {what}, {1000 * lasts:.0f} ms before the dip at t ="
                f" {record.t[part.stop - 1]:g} s: no steady state of"
                f" {1000 * least * record.step:.0f} ms comes before it; choose another event"
            )
        notes.append(
            f"{what}: the steady state before the dip is that of the {lasts:.2g} s after it"
        )
    for change in find_voltage_changes(U, cycle):
        if begin + change.stop > first and part.stop - begin - change.stop >= least:
            first, middle = begin + change.stop, begin + (change.first + change.stop) // 2
            notes.append(
                f"the voltage changes by {100 * (change.ratio - 1):+.2g} % at t ="
                f" {record.t[middle]:g} s, before the dip: the steady state is that of the"
                f" {(part.stop - first) * record.step:.2g} s after it"
            )
    return _find_part_at_rest(record, slice(first, part.stop), least, notes)


def is_at_rest(record: Record, part: slice) -> bool:
    """Whether a load moves no more in samples before an event than noise does."""
    return _follow_course(record, part) is None


def _may_step_be_dip(change: Change, dip: int, cycle: float) -> bool:
    """Whether a small step right before a dip may be the dip itself, where P and Q are stamped
    earlier than U.
    """
    return dip - change.stop < EARLY[0] * cycle and abs(change.ratio - 1) < EARLY[1]


def _find_part_at_rest(
    record: Record, part: slice, least: int, notes: list[str]
) -> tuple[slice, list[str]]:
    """The part in which a load that came to rest rests; what is said of one that does not."""
    whole, course = part, _follow_course(record, part)
    while course is not None and not course.swings:
        rest = next(
            (late for late in _list_last_parts(part, least) if _does_rest(record, late, course)),
            None,
        )
        if rest is None:
            break
        part, course = rest, _follow_course(record, rest)
    lasts = (part.stop - part.start) * record.step
    if part != whole:
        notes = [
            *notes,
            "the load comes to rest before the dip: its steady state is that of the last"
            f" {lasts:.2g} s",
        ]
    if course is None:
        return part, notes
    late = slice(max(part.start, part.stop - max(1, round(AT_THE_END * record.rate))), part.stop)
    (P, Q), (P_late, Q_late) = (
        [float(np.nanmean(x[at])) for x in (record.P, record.Q)] for at in (part, late)
    )
    S = max(float(np.hypot(P, Q)), 1e-300)
    said = (
        f"the load is not steady before the dip: {course}; P0 and Q0 are means over {lasts:.2g} s,"
        f" and right before the dip P is {100 * (P_late - P) / S:+.2g} %, Q"
        f" {100 * (Q_late - Q) / S:+.2g} % of the apparent power away"
    )
    return part, [*notes, said]


def _list_last_parts(part: slice, least: int) -> Iterator[slice]:
    """The last parts of the samples that are long enough."""
    for share in PARTS:
        late = slice(part.stop - (part.stop - part.start) // share, part.stop)
        if late.stop - late.start >= least:
            yield late


def _does_rest(record: Record, late: slice, course: "UnsteadyCourse") -> bool:
    """Whether a load moves so much less in a late part of its course that it has come to rest
    there.
    """
    rest = _follow_course(record, late, at_all=True)
    return rest is not None and rest.span / rest.samples < REST * course.span / course.samples


def _follow_course(record: Record, part: slice, at_all: bool = False) -> "UnsteadyCourse | None":
    """How the load moves in samples before a dip, without those that may show the dip early."""
    cycle = measure_smear(record)
    part = slice(part.start, max(part.start, part.stop - round(EARLY[0] * cycle)))
    return find_course(record.P[part], record.Q[part], cycle, at_all)


@dataclass(frozen=True)
class UnsteadyCourse:
    """How a load moves that is not steady."""

    name: str  # P or Q, whichever moves more
    change: str  # rises, falls or swings
    span: float
    size: float  # apparent power
    samples: int  # within which it moves so far

    @property
    def swings(self) -> bool:
        """Whether the quantity swings, in place of drifting or stepping."""
        return self.change == "swings"

    def __str__(self) -> str:
        """ "P drifts by 3 % of the apparent power"."""
        return (
            f"{self.name} {self.change} by {100 * self.span / self.size:.2g} % of the apparent"
            " power"
        )


def find_course(
    P: np.ndarray, Q: np.ndarray, cycle: float, at_all: bool = False
) -> UnsteadyCourse | None:
    """How a load moves whose P and Q (N,), without steps, leave their mean by more than noise does;
    None at rest.

    `cycle` is in samples. With `at_all` however little it moves.
    """
    S, n = fill_gaps(P) + 1j * fill_gaps(Q), max(1, round(2 * cycle))
    if len(S) < 2 * n:
        return None
    smooth = np.convolve(S, np.full(n, 1 / n), "valid")
    size = max(float(np.abs(S.mean())), 1e-300)
    noise = float(np.hypot(*(np.median(np.abs(np.diff(x))) for x in (S.real, S.imag)))) / np.sqrt(n)
    name, course = max(
        (("P", smooth.real), ("Q", smooth.imag)), key=lambda each: float(np.ptp(each[1]))
    )
    span = float(np.ptp(course))
    if not at_all and span <= max(CHANGED * size, LARGEST_USUAL_CHANGE * noise):
        return None
    change = (
        "swings"
        if _does_turn(course, REVERSED * span)
        else "rises"
        if course[-1] > course[0]
        else "falls"
    )
    return UnsteadyCourse(name, change, span, size, len(course))


def _does_turn(x: np.ndarray, least: float) -> bool:
    """Whether x (N,) turns back by so much on its way from its first to its last value."""
    way = np.sign(x[-1] - x[0]) or 1.0
    return bool((np.maximum.accumulate(way * x) - way * x).max() > least)
