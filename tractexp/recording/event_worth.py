"""Whether a load model can be fitted to an event, and why: its size, the states around it."""

from collections.abc import Sequence

import numpy as np

from tractexp.record.direction import explain_negative_power
from tractexp.record.fall import FEWEST_BEFORE, REFERENCE, SHALLOWEST
from tractexp.record.no_dip import UNFINISHED
from tractexp.recording.event_kind import CARRIES, find_clean_currents
from tractexp.recording.excursion import DEAD_VOLTAGE_SHARE, LEAVES_PHASE, Excursion
from tractexp.recording.trace import Trace

FALLEN_SHARE = 0.5  # of the deepest fall of a phase: the others that fell as well fall farther


def measure_phases(trace: Trace, e: Excursion, first: int, stop: int) -> tuple[float, ...]:
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


def _describe_depth(trace: Trace, e: Excursion, depth: float, first: int) -> str:
    """By how much the voltage falls, and which phases do."""
    if len(trace.phases) != 3:
        return f"the voltage falls by {100 * depth:.3g} %"
    phases = measure_phases(trace, e, first, e.start)
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
    clean = find_clean_currents(trace)[:, first : e.start]
    noise = len(clean) and not np.median(clean, axis=1).any()
    if not np.isfinite(before[0]) or np.hypot(*before) == 0 or noise:
        return "no load current flows before it"
    if np.hypot(*after) < CARRIES * np.hypot(*before):
        return "the load is switched off in it: nothing is left of it after"
    if not e.sudden:
        return "slowly: it determines only the static part of the load"
    return f"{NEGATIVE}{_explain_negative_power(trace)}" if before[0] < 0 else ""


def judge_worth(
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
    stop = min(e.end, len(trace.t))
    lasts = (stop - e.start) * trace.step
    unfinished = stop == len(trace.t) and lasts >= UNFINISHED
    if not (e.returned or unfinished):
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
    if not e.returned:
        until = f"{lead:.2g} s before it and {lasts:.2g} s of it are recorded, and no recovery"
        return True, f"{size}, {until}: what its end would tell stays open{short}"
    return True, f"{size}, {lead:.2g} s before it and the recovery are recorded{short}"


def _explain_negative_power(trace: Trace) -> str:
    """Why power is negative before a dip, as its answer to the voltage shows it."""
    usual = (
        "power is fed back, or the current is counted out of the load (then"
        " data.reverse_current=true makes it one)"
    )
    return explain_negative_power(trace.U, trace.P, trace.Q) or usual


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
