"""The kinds of what happened to a voltage, and what the currents alone show."""

from dataclasses import replace

import numpy as np

from tractexp.record.change import find_runs
from tractexp.record.no_dip import OPEN_POLE, UNCLEARED
from tractexp.recording.excursion import DEAD_VOLTAGE_SHARE, Excursion
from tractexp.recording.trace import Trace

# of the voltage: a larger change that stays is no tap or switching step
LARGEST_SWITCHING_STEP = 0.15
# of the RMS: positive sequence that three phases have at some time; a zero sequence leaves none
LEAST_POSITIVE_SHARE = 0.75
OPEN_CURRENT = 0.05  # of the mean of the other two: a phase that carries less is open
OPEN_CYCLES = 3.0  # so long at least
# of the fundamental: second harmonic of an inrush (IEEE C37.91, usual restraint of differential
# relays)
SECOND = 0.15
INRUSH_CYCLES = 5.0  # so long at least: the offset of a fault current lasts less
CLEAN = 0.5  # of a current's energy is in its fundamental and second harmonic, or it is noise
OF_LOADS = ("load loss", "load step")  # kinds of which the voltage shows nothing
LARGEST_CURRENT_CHANGE = 0.1  # of a current: within it the current stays while a voltage is lost
BLOWN = 0.1  # of a phase: less is left where a fuse has blown
# the same, longer than a fault lasts; how little the others change
LOST_VOLTAGE, UNTOUCHED = 0.7, 0.03
FUSE_CYCLES = 3.0  # so long at least
FUSE_SAMPLES = 50  # half cycles before it, whose median it is compared with
CARRIES = 0.05  # of the record's greatest current: what is less is no load


def find_dead_phases(trace: Trace) -> list[int]:
    """Which of three phases have no voltage from first to last, while another has."""
    if len(trace.phases) != 3:
        return []
    most = np.percentile(trace.phases, 95, axis=1)
    return np.flatnonzero(most <= DEAD_VOLTAGE_SHARE * most.max()).tolist() if most.any() else []


def has_no_system(trace: Trace) -> bool:
    """Whether three voltages never turn as three phases do: pick-up on a dead line, or one quantity
    three times.
    """
    if len(trace.phases) < 3:
        return False
    return not (
        np.maximum(trace.U, trace.U2)
        > LEAST_POSITIVE_SHARE * np.sqrt((trace.phases**2).mean(axis=0))
    ).any()


def divide_by_kind(trace: Trace, e: Excursion) -> list[tuple[str, Excursion]]:
    """The kind of an excursion; two parts of a fault that leaves a pole open."""
    if (fuse := _find_blown_fuse(trace, e)) is not None:
        return [("blown fuse", fuse)]
    # with the level that it leads to
    until = e.end + 2 * e.new_level * round(trace.cycle / trace.step)
    if e.dead or _find_dead_samples(trace, e)[e.start : until].any():
        if e.returned and not e.dead:
            return [("interruption", e)]
        return [("dead line", _cut_where_phase_returns(trace, e))]
    opened = _find_open_phase(trace, e)
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


def _cut_where_phase_returns(trace: Trace, e: Excursion) -> Excursion:
    """The excursion up to where a phase is back for good, or to the end."""
    dead = _find_dead_samples(trace, e)[e.end :]
    return (
        replace(e, end=e.end + int(np.flatnonzero(dead)[-1])) if dead.any() and e.new_level else e
    )


def _find_dead_samples(trace: Trace, e: Excursion) -> np.ndarray:
    """When (M,) every phase is gone."""
    return (
        np.concatenate([trace.U[None], trace.phases]).max(axis=0) < DEAD_VOLTAGE_SHARE * e.reference
    )


def _find_blown_fuse(trace: Trace, e: Excursion) -> Excursion | None:
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
        and np.median(find_clean_currents(trace)[:, before], axis=1).all()
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


def _find_open_phase(trace: Trace, e: Excursion) -> Excursion | None:
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
            for run in find_runs(gone, max(3, round(OPEN_CYCLES * trace.cycle / trace.step)))
            if run.start >= 4 and (trace.I[k, : run.start] > carries).any()
        ]
    return sorted(spans)


def find_open_poles(
    trace: Trace, spans: list[tuple[str, Excursion]]
) -> list[tuple[str, Excursion]]:
    """Open poles that the voltage does not show, beside the `spans` that it shows."""
    if len(trace.I) != 3:
        return []
    return [
        ("open pole", build_current_span(trace, a, b))
        for a, b in _open_runs(trace)
        if not any(s.start < b and s.end > a for _, s in spans)
    ]


def find_inrushes(trace: Trace) -> list[tuple[str, Excursion]]:
    """Spans in which the second harmonic of a current is that of a saturated transformer."""
    if not len(trace.I):
        return []
    carries = CARRIES * np.percentile(trace.I, 99)
    flows = (carries < trace.I) & find_clean_currents(trace)
    rich = (flows & (trace.second > SECOND * trace.I)).any(axis=0)
    least = max(3, round(INRUSH_CYCLES * trace.cycle / trace.step))
    return [
        ("inrush", build_current_span(trace, run.start, run.stop)) for run in find_runs(rich, least)
    ]


def find_clean_currents(trace: Trace) -> np.ndarray:
    """Where (K, M) a current is more than noise: fundamental and second harmonic hold most of its
    energy.
    """
    return trace.I**2 + trace.second**2 > CLEAN * trace.content**2


def build_current_span(trace: Trace, a: int, b: int) -> Excursion:
    """A span that the currents mark, not the voltage."""
    return Excursion(a, b, 0.0, True, False, True, max(float(np.median(trace.U)), 1e-12))
