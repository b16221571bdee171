"""What happened to a voltage and its load: the events of a trace, in order of time."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.record.change import SMALL_LOAD_SHARE, Change, find_voltage_changes, load_changes
from tractexp.record.fall import STEADY
from tractexp.record.record import Record
from tractexp.recording.event_kind import (
    LARGEST_SWITCHING_STEP,
    build_current_span,
    divide_by_kind,
    find_inrushes,
    find_open_poles,
    has_no_system,
)
from tractexp.recording.event_worth import NO_SYSTEM, judge_worth, measure_phases
from tractexp.recording.excursion import (
    LONGEST_ABRUPT_CYCLES,
    SLID,
    Excursion,
    find_excursions,
)
from tractexp.recording.pole_slip import find_pole_slips, is_swing_of_slip
from tractexp.recording.static_exponent import StaticExponent, find_exponents
from tractexp.recording.trace import Trace, trace_record

OF_STATICS = ("step", "ramp", "pole slip")  # kinds that tell of the static part alone
LEAST_LISTED_STEP = 0.2  # of the apparent power: a smaller step of a load is no event
FEWEST_HALF_CYCLES = 4  # of a trace that shows what happened


@dataclass(frozen=True)
class Happening:
    """One event of a feeder. Voltages relative to that before it, powers in MW and Mvar."""

    kind: str  # dip, or one of `NO_FIT`
    start: float  # s
    end: float  # s
    depth: float  # 1 - residual voltage over that before: negative for a swell
    jump: float  # degrees, of the positive-sequence voltage at its start
    U2: float  # greatest negative-sequence voltage during it, over V1 before
    before: tuple[float, float]  # P, Q
    after: tuple[float, float]
    worth: bool  # fitting
    why: str  # what makes it (not) worth fitting, one sentence
    # voltage of each phase, farthest from that before, over that; () where phases are not recorded
    phases: tuple[float, ...] = ()
    # of what determines the static part of the load alone
    exponents: tuple[StaticExponent, ...] = ()


def find_happenings_of_record(record: Record) -> list[Happening]:
    """The events in a record of t, U, P, Q and, where they are there, f and U2."""
    return find_happenings(trace_record(record))


def _is_within(trace: Trace, e: Excursion, slips: Sequence[Excursion]) -> bool:
    """Whether an excursion is a part of a pole slip."""
    return any(is_swing_of_slip(trace, e, slip) for slip in slips)


def _name_load_change(change: Change) -> str:
    """The kind of a load's own change."""
    return "load loss" if change.ratio < SMALL_LOAD_SHARE else "load step"


def find_happenings(trace: Trace, trigger: float | None = None) -> list[Happening]:
    """The events in a trace, in order of time; `trigger` [s] is that of the recorder."""
    if len(trace.t) < FEWEST_HALF_CYCLES:
        return []
    if has_no_system(trace):
        whole = Excursion(
            0, len(trace.t), -1.0, False, False, False, max(float(np.median(trace.U)), 1e-12), True
        )
        return [replace(_describe(trace, "dead line", whole, []), why=NO_SYSTEM)]
    slips = find_pole_slips(trace)
    outside = [e for e in find_excursions(trace, trigger) if not _is_within(trace, e, slips)]
    lasting = _extend_lasting_falls(trace, outside)
    spans = [(kind, part) for e in lasting for kind, part in divide_by_kind(trace, e)]
    spans += [("pole slip", slip) for slip in slips]
    spans += find_open_poles(trace, spans)
    spans += [(kind, e) for kind, e in find_inrushes(trace) if not _is_within(trace, e, slips)]
    changes = _find_own_changes(trace, [e for _, e in spans])
    spans += [("step", tap) for tap in _find_taps(trace, [e for _, e in spans], changes)]
    listed = [c for c in changes if abs(c.ratio - 1) > LEAST_LISTED_STEP]
    spans += [
        (_name_load_change(c), build_current_span(trace, c.first + 1, c.stop)) for c in listed
    ]
    spans.sort(key=lambda each: (each[1].start, each[1].end))
    bounds = [(e.start, _find_steady_end(kind, e, spans)) for kind, e in spans]
    bounds += [(c.first + 1, c.stop) for c in changes]
    return [_describe(trace, kind, e, bounds) for kind, e in _merge_ramps(spans)]


def _find_steady_end(kind: str, e: Excursion, spans: list[tuple[str, Excursion]]) -> int:
    """The sample from which on a state is steady enough to be that before the next event: the end
    of an event, but the start of a slide out of which that event comes.
    """
    goes_over = kind == "ramp" and any(0 <= other.start - e.end <= SLID for _, other in spans)
    return e.start if goes_over else e.end


def _extend_lasting_falls(trace: Trace, outside: Sequence[Excursion]) -> list[Excursion]:
    """The excursions, with falls that do not return extended up to what happens next, or to the
    end: they last so long, and not only until they are level.
    """
    ends = [*(e.start for e in outside), len(trace.t)][1:]
    return [
        replace(e, end=max(e.end, end))
        if e.new_level and not e.returned and e.worst < -LARGEST_SWITCHING_STEP
        else e
        for e, end in zip(outside, ends, strict=True)
    ]


def _merge_ramps(spans: list[tuple[str, Excursion]]) -> list[tuple[str, Excursion]]:
    """The spans in order of time, with ramps between which nothing else happens as one."""
    merged: list[tuple[str, Excursion]] = []
    for kind, e in spans:
        if kind == "ramp" and merged and merged[-1][0] == "ramp":
            first = merged.pop()[1]
            since = (1 + e.worst) * e.reference / first.reference - 1
            worst = since if e.new_level else max(first.worst, since, key=abs)
            e = replace(e, start=first.start, worst=worst, reference=first.reference)
        merged.append((kind, e))
    return merged


def _find_own_changes(trace: Trace, outside: list[Excursion]) -> list[Change]:
    """The steps of the load beside what happens to the voltage."""
    changes, near = (
        load_changes(trace.U, trace.P, trace.Q, trace.cycle / trace.step),
        round(trace.cycle / trace.step),
    )
    return [
        c
        for c in changes
        if not any(e.start - near < c.stop and e.end + near > c.first for e in outside)
    ]


def _find_taps(
    trace: Trace, outside: Sequence[Excursion], changes: Sequence[Change]
) -> list[Excursion]:
    """The steps of the voltage that are too small for an excursion, as those of a tap changer:
    beside what happens to the voltage, and none that the load made.
    """
    cycle = trace.cycle / trace.step
    busy = [(e.start, e.end) for e in outside] + [(c.first, c.stop) for c in changes]
    taps = []
    for cycles in (1.0, LONGEST_ABRUPT_CYCLES):
        near = round((1 + cycles) * cycle)  # what levels are measured over, and a window
        for tap in find_voltage_changes(trace.U, cycles * cycle):
            if any(start - near < tap.stop and end + near > tap.first for start, end in busy):
                continue
            busy.append((tap.first, tap.stop))
            level = max(abs(tap.before), 1e-12)
            taps.append(Excursion(tap.first + 1, tap.stop, tap.ratio - 1, False, True, True, level))
    return taps


def _measure_unbalance(trace: Trace, e: Excursion) -> float:
    """The greatest negative-sequence voltage in an event, of the voltage before it; nan where none
    is measured.
    """
    U2 = trace.U2[e.start : max(e.end, e.start + 1)]
    # at its ends a window holds two states, whose difference looks unbalanced
    edge = round(trace.cycle / trace.step)
    U2 = U2[edge : -edge or None] if e.end - e.start > 3 * edge else U2
    return float(np.nanmax(U2) / e.reference) if np.isfinite(U2).any() else float("nan")


def _describe(trace: Trace, kind: str, e: Excursion, bounds: list[tuple[int, int]]) -> Happening:
    """An event; `bounds` are the first and the last sample of all that changes voltage or load."""
    first = max((b for _, b in bounds if b <= e.start), default=0)
    stop = min((a for a, _ in bounds if a >= e.end), default=len(trace.t))
    count = max(2, round(STEADY / trace.step))
    # of what follows another event at once, the state before is that before both
    onset = min((a for a, b in bounds if b == e.start and a < e.start), default=e.start)
    begin = max((b for _, b in bounds if b <= onset), default=0)
    before = _average_power(trace, max(begin, onset - count - 1), max(onset - 1, begin))
    after = _average_power(trace, min(e.end + 1, stop), min(e.end + 1 + count // 2, stop))
    inside = slice(e.start, max(e.end, e.start + 1))
    extreme = np.max if e.worst > 0 else np.min
    depth = -e.worst if e.new_level or e.dead else 1 - float(extreme(trace.U[inside])) / e.reference
    last = min(e.end, len(trace.t) - 1)
    worth, why = judge_worth(trace, kind, e, depth, first, (before, after))
    exponents: tuple[StaticExponent, ...] = ()
    if kind in OF_STATICS or (kind == "dip" and not e.sudden):
        lasting = kind == "step"
        exponents = find_exponents(trace, e.start, e.end, first, stop, lasting=lasting)
        told = ", ".join(map(str, exponents))
        why += f"; worth fitting for the static part: {told}, motors included" if told else ""
    return Happening(
        kind,
        float(trace.t[e.start]),
        float(trace.t[last]),
        float(depth),
        trace.jump(e.start),
        _measure_unbalance(trace, e),
        before,
        after,
        worth,
        why,
        measure_phases(trace, e, begin, onset),
        exponents,
    )


def _average_power(trace: Trace, first: int, stop: int) -> tuple[float, float]:
    """Mean P and Q; nan without samples."""
    P, Q = trace.P[first:stop], trace.Q[first:stop]
    valid = np.isfinite(P) & np.isfinite(Q)
    return (
        (float(P[valid].mean()), float(Q[valid].mean()))
        if valid.any()
        else (float("nan"), float("nan"))
    )
