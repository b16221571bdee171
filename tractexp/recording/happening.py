"""What happened to a voltage: its kind, its size, and whether a load model can be fitted to it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.record.change import SMALL_LOAD_SHARE, Change, load_changes, runs
from tractexp.record.direction import direction
from tractexp.record.fall import FEWEST_BEFORE, REFERENCE, SHALLOWEST, STEADY
from tractexp.record.no_dip import OPEN_POLE, UNCLEARED
from tractexp.record.phasor import Phasors, WaveSource
from tractexp.record.record import Record
from tractexp.recording.excursion import (
    DEAD_VOLTAGE_SHARE,
    LEAVES_PHASE,
    SLID,
    Excursion,
    excursions,
)
from tractexp.recording.static_exponent import StaticExponent, find_exponents
from tractexp.recording.trace import Trace, of_record, of_waves

# of the voltage: a larger change that stays is no tap or switching step
LARGEST_SWITCHING_STEP = 0.15
# of the RMS: positive sequence that three phases have at some time; a zero sequence leaves none
LEAST_POSITIVE_SHARE = 0.75
SWING = 0.1  # of the voltage: how deep the swings of a pole slip are at least
SWINGS = 2  # so many at least
SWING_PERIOD = (0.15, 5.0)  # s
LARGEST_PERIOD_RATIO = 3.0  # the longest period of a pole slip over its shortest, at most
LARGEST_SWING_UNBALANCE = 0.05  # U2 over U1: swings are balanced, faults are not
OPEN_CURRENT = 0.05  # of the mean of the other two: a phase that carries less is open
OPEN_CYCLES = 3.0  # so long at least
# of the fundamental: second harmonic of an inrush (IEEE C37.91, usual restraint of differential
# relays)
SECOND = 0.15
INRUSH_CYCLES = 5.0  # so long at least: the offset of a fault current lasts less
CLEAN = 0.5  # of a current's energy is in its fundamental and second harmonic, or it is noise
OF_LOADS = ("load loss", "load step")  # kinds of which the voltage shows nothing
OF_STATICS = ("step", "ramp", "pole slip")  # kinds that tell of the static part alone
LEAST_LISTED_STEP = 0.2  # of the apparent power: a smaller step of a load is no event
LARGEST_CURRENT_CHANGE = 0.1  # of a current: within it the current stays while a voltage is lost
BLOWN = 0.1  # of a phase: less is left where a fuse has blown
# the same, longer than a fault lasts; how little the others change
LOST_VOLTAGE, UNTOUCHED = 0.7, 0.03
FUSE_CYCLES = 3.0  # so long at least
FUSE_SAMPLES = 50  # half cycles before it, whose median it is compared with
FEWEST_HALF_CYCLES = 4  # of a trace that shows what happened
FALLEN_SHARE = 0.5  # of the deepest fall of a phase: the others that fell as well fall farther
CARRIES = 0.05  # of the record's greatest current: what is less is no load


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


def happenings(
    waves: WaveSource,
    rate: float,
    start: float,
    nominal: float,
    phasors: Phasors,
    trigger: float | None = None,
) -> list[Happening]:
    """The events in waveforms (2 K, N) [kV, kA], voltages first, sampled at `rate` [Hz] from
    `start` [s] on.

    `phasors` are those measured from the same waveforms, which give sequence components, powers and
    frequency.
    """
    return happenings_in(of_waves(waves, rate, start, nominal, phasors), trigger)


def find_dead_phases(trace: Trace) -> list[int]:
    """Which of three phases have no voltage from first to last, while another has."""
    if len(trace.phases) != 3:
        return []
    most = np.percentile(trace.phases, 95, axis=1)
    return np.flatnonzero(most <= DEAD_VOLTAGE_SHARE * most.max()).tolist() if most.any() else []


def happenings_of(record: Record) -> list[Happening]:
    """The events in a record of t, U, P, Q and, where they are there, f and U2."""
    return happenings_in(of_record(record))


def _is_within(trace: Trace, e: Excursion, slips: Sequence[Excursion]) -> bool:
    """Whether an excursion is a part of a pole slip."""
    return any(_part(trace, e, slip) for slip in slips)


def _name_load_change(change: Change) -> str:
    """What a change of a load's own is called."""
    return "load loss" if change.ratio < SMALL_LOAD_SHARE else "load step"


def happenings_in(trace: Trace, trigger: float | None = None) -> list[Happening]:
    """The events in a trace, in order of time; `trigger` [s] is that of the recorder."""
    if len(trace.t) < FEWEST_HALF_CYCLES:
        return []
    if _no_system(trace):
        whole = Excursion(
            0, len(trace.t), -1.0, False, False, False, max(float(np.median(trace.U)), 1e-12), True
        )
        return [replace(_describe(trace, "dead line", whole, []), why=NO_SYSTEM)]
    slips = _pole_slips(trace)
    outside = [e for e in excursions(trace, trigger) if not _is_within(trace, e, slips)]
    lasting = _extend_lasting_falls(trace, outside)
    spans = [(kind, part) for e in lasting for kind, part in _kinds(trace, e)]
    spans += [("pole slip", slip) for slip in slips]
    spans += _open_alone(trace, spans)
    spans += [(kind, e) for kind, e in _inrush(trace) if not _is_within(trace, e, slips)]
    changes = _own_changes(trace, [e for _, e in spans])
    listed = [c for c in changes if abs(c.ratio - 1) > LEAST_LISTED_STEP]
    spans += [
        (_name_load_change(c), _build_current_span(trace, c.first + 1, c.stop)) for c in listed
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
    """The same with falls that do not return up to what happens next, or to the end: they last so
    long, and not only until they are level.
    """
    ends = [*(e.start for e in outside), len(trace.t)][1:]
    return [
        replace(e, end=max(e.end, end))
        if e.new_level and not e.returned and e.worst < -LARGEST_SWITCHING_STEP
        else e
        for e, end in zip(outside, ends, strict=True)
    ]


def _merge_ramps(spans: list[tuple[str, Excursion]]) -> list[tuple[str, Excursion]]:
    """The same in order of time, with ramps between which nothing else happens as one."""
    merged: list[tuple[str, Excursion]] = []
    for kind, e in spans:
        if kind == "ramp" and merged and merged[-1][0] == "ramp":
            first = merged.pop()[1]
            since = (1 + e.worst) * e.reference / first.reference - 1
            worst = since if e.new_level else max(first.worst, since, key=abs)
            e = replace(e, start=first.start, worst=worst, reference=first.reference)
        merged.append((kind, e))
    return merged


def _own_changes(trace: Trace, outside: list[Excursion]) -> list[Change]:
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


def _no_system(trace: Trace) -> bool:
    """Whether three voltages never turn as three phases do: pick-up on a dead line, or one quantity
    three times.
    """
    if len(trace.phases) < 3:
        return False
    return not (
        np.maximum(trace.U, trace.U2)
        > LEAST_POSITIVE_SHARE * np.sqrt((trace.phases**2).mean(axis=0))
    ).any()


def _part(trace: Trace, e: Excursion, slip: Excursion) -> bool:
    """Whether an excursion is a swing of a pole slip: in it, or a smaller one right beside it."""
    near = round(SWING_PERIOD[1] / 5 / trace.step) if abs(e.worst) < LARGEST_SWITCHING_STEP else 0
    return e.start < slip.end + near and e.end > slip.start - near


def _kinds(trace: Trace, e: Excursion) -> list[tuple[str, Excursion]]:
    """The kind of an excursion; two parts of a fault that leaves a pole open."""
    if (fuse := _fuse(trace, e)) is not None:
        return [("blown fuse", fuse)]
    # with the level that it leads to
    until = e.end + 2 * e.new_level * round(trace.cycle / trace.step)
    if e.dead or _dead(trace, e)[e.start : until].any():
        if e.returned and not e.dead:
            return [("interruption", e)]
        return [("dead line", _until_alive(trace, e))]
    opened = _open(trace, e)
    if opened is None:
        return [(_name_change(e), e)]
    fault = replace(e, end=opened.start, cleared=False)
    lasts = fault.end - fault.start >= 3
    return [("dip", fault), ("open pole", opened)] if lasts else [("open pole", opened)]


def _name_change(e: Excursion) -> str:
    """The kind of an excursion in which no pole opens and no line is dead."""
    if not e.sudden:
        return "ramp"
    stays = e.new_level and not e.returned
    if stays and (e.worst > 0 or abs(e.worst) <= LARGEST_SWITCHING_STEP):
        return "step"
    return "dip" if e.worst < 0 else "swell"


def _until_alive(trace: Trace, e: Excursion) -> Excursion:
    """The excursion up to where a phase is back for good, or to the end."""
    dead = _dead(trace, e)[e.end :]
    return (
        replace(e, end=e.end + int(np.flatnonzero(dead)[-1])) if dead.any() and e.new_level else e
    )


def _dead(trace: Trace, e: Excursion) -> np.ndarray:
    """When (M,) every phase is gone."""
    return (
        np.concatenate([trace.U[None], trace.phases]).max(axis=0) < DEAD_VOLTAGE_SHARE * e.reference
    )


def _fuse(trace: Trace, e: Excursion) -> Excursion | None:
    """The span in which voltages are lost while all currents stay: a fuse of the voltage
    transformers; else None.
    """
    if e.dead or not len(trace.I) or e.start < 4:
        return None
    edge = round(trace.cycle / trace.step)
    before = slice(max(e.start - FUSE_SAMPLES, 0), max(e.start - 1, 0))
    current, voltage = (
        np.maximum(np.median(x[:, before], axis=1), 1e-12) for x in (trace.I, trace.phases)
    )
    lost = (trace.phases / voltage[:, None])[:, e.start + edge :].min(axis=0) < LOST_VOLTAGE
    end = e.start + edge + int(np.argmin([*lost, False]))
    inside = slice(e.start + edge, end - edge * (end < len(trace.t)))
    flows = (
        current.min() > CARRIES * np.percentile(trace.I, 95)
        and np.median(_clean(trace)[:, before], axis=1).all()
    )
    if not flows or (inside.stop - inside.start) * trace.step < FUSE_CYCLES * trace.cycle:
        return None
    stays = (
        np.abs(trace.I[:, inside] - current[:, None]) < LARGEST_CURRENT_CHANGE * current[:, None]
    )
    left = np.median(trace.phases[:, inside], axis=1) / voltage
    lasts = (end - e.start) * trace.step > UNCLEARED
    blown = stays.mean() > 1 - CARRIES and _is_fuse_pattern(left, lasts)
    return replace(e, end=min(end, len(trace.t) - 1)) if blown else None


def _is_fuse_pattern(left: np.ndarray, lasts: bool) -> bool:
    """Whether shares (3,) left of the voltages are those of blown fuses: all gone, or some, and the
    others as they were unless it `lasts` longer than a fault.
    """
    if (left < DEAD_VOLTAGE_SHARE).all():
        return True
    gone, others = left < (LOST_VOLTAGE if lasts else BLOWN), np.abs(left - 1) < UNTOUCHED
    return bool(gone.any() and not gone.all() and (lasts or (gone | others).all()))


def _open(trace: Trace, e: Excursion) -> Excursion | None:
    """The part of an excursion in which one phase carries no current, or is unbalanced too long for
    a fault.
    """
    if len(trace.I) == 3:
        spans = [span for span in _open_runs(trace) if span[0] < e.end and span[1] > e.start]
        if not spans:
            return None
        first, stop = max(spans[0][0], e.start), min(max(span[1] for span in spans), e.end)
        return (
            replace(e, start=first, end=max(stop, first + 1))
            if stop - first > 0.5 * (e.end - first)
            else None
        )
    unbalanced = trace.U2[e.start : e.end] > OPEN_POLE * trace.U[e.start : e.end]
    if np.count_nonzero(unbalanced) * trace.step > UNCLEARED:
        return e
    return None


def _open_runs(trace: Trace) -> list[tuple[int, int]]:
    """Spans in which exactly one of three currents is gone while the other two carry load as it did
    before.
    """
    carries = CARRIES * np.percentile(trace.I, 95)
    spans = []
    for k in range(3):
        others = np.delete(trace.I, k, axis=0)
        gone = (trace.I[k] < OPEN_CURRENT * others.mean(axis=0)) & (others.min(axis=0) > carries)
        spans += [
            (run.start, run.stop)
            for run in runs(gone, max(3, round(OPEN_CYCLES * trace.cycle / trace.step)))
            if run.start >= 4 and (trace.I[k, : run.start] > carries).any()
        ]
    return sorted(spans)


def _open_alone(trace: Trace, spans: list[tuple[str, Excursion]]) -> list[tuple[str, Excursion]]:
    """Open poles that the voltage does not show."""
    if len(trace.I) != 3:
        return []
    return [
        ("open pole", _build_current_span(trace, a, b))
        for a, b in _open_runs(trace)
        if not any(s.start < b and s.end > a for _, s in spans)
    ]


def _inrush(trace: Trace) -> list[tuple[str, Excursion]]:
    """Spans in which the second harmonic of a current is that of a saturated transformer."""
    if not len(trace.I):
        return []
    carries = CARRIES * np.percentile(trace.I, 99)
    rich = ((trace.second > SECOND * trace.I) & (carries < trace.I) & _clean(trace)).any(axis=0)
    least = max(3, round(INRUSH_CYCLES * trace.cycle / trace.step))
    return [
        ("inrush", _build_current_span(trace, run.start, run.stop)) for run in runs(rich, least)
    ]


def _clean(trace: Trace) -> np.ndarray:
    """Where (K, M) a current is more than noise: fundamental and second harmonic hold most of its
    energy.
    """
    return trace.I**2 + trace.second**2 > CLEAN * trace.content**2


def _build_current_span(trace: Trace, a: int, b: int) -> Excursion:
    """A span that the currents mark, not the voltage."""
    return Excursion(a, b, 0.0, True, False, True, max(float(np.median(trace.U)), 1e-12))


def _find_even_end(trace: Trace, lows: Sequence[int], first: int) -> int:
    """The number of the low after the last that follows the `first` at even distances."""
    last = first + 1
    while last < len(lows) and _even(trace.t[lows[first : last + 1]]):
        last += 1
    return last


def _pole_slips(trace: Trace) -> list[Excursion]:
    """Spans of two or more smooth balanced swings of the voltage, of about one period each."""
    width = max(1, round(2 * trace.cycle / trace.step)) | 1
    U = np.convolve(np.pad(trace.U, width // 2, "edge"), np.full(width, 1 / width), "valid")
    level = float(np.percentile(U, 90))
    if level <= 0:
        return []
    lows = [k for k in _swings(U / level) if _smooth(U / level, k, trace)]
    lows = [k for k in lows if not trace.U2[k] > LARGEST_SWING_UNBALANCE * max(trace.U[k], level)]
    slips, first = [], 0
    while first < len(lows):
        last = _find_even_end(trace, lows, first)
        if last - first >= SWINGS:
            half = int(np.diff(lows[first:last]).max()) // 2
            a, b = max(lows[first] - half, 0), min(lows[last - 1] + half + 1, len(U))
            if slips and a - slips[-1].end < 2 * half:
                a = slips.pop().start
            slips.append(
                Excursion(a, b, float(U[a:b].min() / level - 1), True, False, False, level)
            )
        first = last
    return slips


def _swings(u: np.ndarray) -> list[int]:
    """Minima of u that lie lower by `SWING` than the maxima on either side."""
    lows, low, high, falling = [], 0, 0, False
    for k in range(1, len(u)):
        if falling:
            low = k if u[k] < u[low] else low
            if u[k] > u[low] + SWING:
                lows.append(low)
                falling, high = False, k
        else:
            high = k if u[k] > u[high] else high
            if u[k] < u[high] - SWING:
                falling, low = True, k
    return lows


def _smooth(u: np.ndarray, k: int, trace: Trace) -> bool:
    """Whether the fall to a minimum and the rise from it both take their time: no fault begins or
    ends so.
    """
    within = max(2, round(2 * trace.cycle / trace.step))
    reach = round(SWING_PERIOD[1] / 2 / trace.step)
    for part in (u[max(k - reach, 0) : k + 1][::-1], u[k : k + reach + 1]):
        top = int(np.argmax(part >= part[0] + SWING)) + within
        part = part[: top + 1]
        if len(part) > within and np.abs(part[within:] - part[:-within]).max() > 0.7 * np.ptp(part):
            return False
    return True


def _even(t: np.ndarray) -> bool:
    """Whether times (n,) [s] follow one another as those of a swing do."""
    steps = np.diff(t)
    low, high = SWING_PERIOD
    return bool(
        steps.min() >= low
        and steps.max() <= high
        and steps.max() <= LARGEST_PERIOD_RATIO * steps.min()
    )


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
    before = _power(trace, max(begin, onset - count - 1), max(onset - 1, begin))
    after = _power(trace, min(e.end + 1, stop), min(e.end + 1 + count // 2, stop))
    inside = slice(e.start, max(e.end, e.start + 1))
    extreme = np.max if e.worst > 0 else np.min
    depth = -e.worst if e.new_level or e.dead else 1 - float(extreme(trace.U[inside])) / e.reference
    last = min(e.end, len(trace.t) - 1)
    worth, why = _worth(trace, kind, e, depth, first, (before, after))
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
        _measure_phases(trace, e, begin, onset),
        exponents,
    )


def _measure_phases(trace: Trace, e: Excursion, first: int, stop: int) -> tuple[float, ...]:
    """The voltage of each of three phases during an event over its median from sample `first` up to
    `stop`; () where not known.
    """
    if len(trace.phases) != 3:
        return ()
    inside, around = (
        trace.phases[:, e.start : max(e.end, e.start + 1)],
        trace.phases[:, first:stop],
    )
    if not around.shape[1]:  # it begins with the record: then by what follows
        around = trace.phases[:, e.end :] if e.end < len(trace.t) else inside
    usual = np.median(around, axis=1)
    farthest = inside.max(axis=1) if e.worst > 0 else inside.min(axis=1)
    alive = usual > DEAD_VOLTAGE_SHARE * usual.max()
    return tuple(np.divide(farthest, usual, out=np.ones(3), where=alive).tolist())


def name_fallen_phases(phases: Sequence[float]) -> str:
    """Which of the phases a, b, c fell, where not all did alike: "phase a to 5 %"; "" else."""
    falls = 1 - np.asarray(phases)
    if len(falls) < 3 or falls.max() < LEAVES_PHASE:
        return ""
    fallen = np.flatnonzero(falls > FALLEN_SHARE * falls.max())
    if len(fallen) == 3:
        return ""
    names = " and ".join("abc"[k] for k in fallen)
    word = "phases" if len(fallen) > 1 else "phase"
    return f"{word} {names} to {100 * (1 - falls.max()):.3g} %"


def _power(trace: Trace, first: int, stop: int) -> tuple[float, float]:
    """Mean P and Q; nan without samples."""
    P, Q = trace.P[first:stop], trace.Q[first:stop]
    valid = np.isfinite(P) & np.isfinite(Q)
    return (
        (float(P[valid].mean()), float(Q[valid].mean()))
        if valid.any()
        else (float("nan"), float("nan"))
    )


def _describe_depth(trace: Trace, e: Excursion, depth: float, first: int) -> str:
    """By how much the voltage falls, and which phases do."""
    if len(trace.phases) != 3:
        return f"the voltage falls by {100 * depth:.3g} %"
    phases = _measure_phases(trace, e, first, e.start)
    fallen = name_fallen_phases(phases)
    return (
        f"the positive sequence falls by {100 * depth:.3g} %, the lowest phase to"
        f" {100 * min(phases):.3g} %{f' ({fallen})' if fallen else ''}"
    )


def _find_lack_of_load(
    trace: Trace,
    e: Excursion,
    first: int,
    before: tuple[float, float],
    after: tuple[float, float],
) -> str:
    """Why a dip tells nothing of the motors of a load, by P and Q before and after it; "" where it
    does.
    """
    if not np.isfinite(trace.P).any():
        return "no current is recorded with it, and without one no load"
    noise = len(trace.I) and not np.median(_clean(trace)[:, first : e.start], axis=1).any()
    if not np.isfinite(before[0]) or np.hypot(*before) == 0 or noise:
        return "no load current flows before it"
    if np.hypot(*after) < CARRIES * np.hypot(*before):
        return "the load is switched off in it: nothing is left of it after"
    if not e.sudden:
        return "slowly: it determines only the static part of the load"
    return f"{NEGATIVE}{_explain_negative_power(trace)}" if before[0] < 0 else ""


def _worth(
    trace: Trace,
    kind: str,
    e: Excursion,
    depth: float,
    first: int,
    powers: tuple[tuple[float, float], ...],
) -> tuple[bool, str]:
    """Whether a load model can be fitted to it, and why (not); `powers` are P and Q before and
    after.
    """
    if kind != "dip":
        return False, NO_FIT[kind]
    lead = (e.start - first) * trace.step
    size = _describe_depth(trace, e, depth, first)
    if lead < FEWEST_BEFORE * 1e-3 or e.start - first < 2:
        return False, f"{size}, but only {1000 * lead:.0f} ms of steady state come before it"
    if not e.cleared:
        return False, f"{size}, but it ends in an open pole, not in the voltage before it"
    if not e.returned:
        return False, f"{size}, but the record ends before the voltage is back"
    if depth < SHALLOWEST:
        return False, f"{size}: too little to separate a load's answer from its noise"
    if lack := _find_lack_of_load(trace, e, first, *powers):
        return False, f"{size}, but {lack}"
    short = (
        f"; only the {1000 * lead:.0f} ms before it tell voltage and power before"
        if lead < REFERENCE
        else ""
    )
    return True, f"{size}, {lead:.2g} s before it and the recovery are recorded{short}"


def _explain_negative_power(trace: Trace) -> str:
    """Why power is negative before a dip, as its answer to the voltage shows it."""
    usual = (
        "power is fed back, or the current is counted out of the load (then"
        " data.reverse_current=true makes it one)"
    )
    return direction(trace.U, trace.P, trace.Q) or usual


NEGATIVE = "P is negative before it: "  # then its cause
NO_SYSTEM = (
    "the voltages are no three phases of this frequency: the line is dead, or other channels were"
    " meant"
)
NO_FIT = {
    "swell": "a swell: loads answer it, but the models here are fitted to dips",
    "interruption": "an interruption: without voltage there is no load to model, and what follows"
    " is a start-up",
    "step": "the voltage stays at its new level, which determines only the static part of the load",
    "ramp": "the voltage changes slowly, which determines only the static part of the load",
    "open pole": "one phase is open: the unbalance is not that of a fault, and single-phase power"
    " decides",
    "dead line": "the line is dead: there is no voltage to draw a load from",
    "pole slip": "the voltage swings with machines that have lost synchronism: frequency and angle"
    " swing with it",
    "blown fuse": "voltage is lost while the currents stay: a fuse of the voltage transformers, not"
    " the network",
    "load loss": "the load is switched off while the voltage stays: it is no answer to the voltage",
    "load step": "the load changes while the voltage stays: it is no answer to the voltage",
    "inrush": "the currents are rich in the second harmonic: a transformer's inrush, not the load",
}
