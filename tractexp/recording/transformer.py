"""Currents of both sides of a transformer beside the voltage of one: the same current twice, of
which one is a load's.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from tractexp.record.phasor import sequences
from tractexp.recording.kirchhoff import CLOSED_SUM
from tractexp.recording.nominal_voltage import off_nominal
from tractexp.recording.recording import Recording
from tractexp.recording.snapshot import UNLOADED, Snapshots

if TYPE_CHECKING:
    from tractexp.recording.feeder import Feeder

LEAST_RATIO = 1.5  # of the two currents: what is nearer has the same voltage
SAME_CURRENT = "no load here: the same current"
# of the larger current: what a magnetizing current and two recorders leave at most where names say
# the sides; where only the waves do, next to nothing may be left
LARGEST_REST = {True: 0.05, False: 0.003}
# degrees off a multiple of 30, as a vector group turns phases, by the same
LARGEST_TURN = {True: 5.0, False: 0.5}
# of the voltage of the other side, as a logarithm: what is farther is none
LARGEST_OFF_NOMINAL = 0.06
LARGEST_DISTRIBUTION = 60.0  # kV: where sizes do not decide, up to it the low side is recorded
HIGH = r"hv|high|hs|os|prim|primary|ht|at|вн|高压|高侧"
LOW = r"lv|low|us|sec|secondary|bt|mv|нн|сн|低压|低侧|中压"
SIDE = re.compile(rf"(?<![^\W\d_])(?:({HIGH})|({LOW}))(?![^\W\d_])|(高压|高侧)|(低压|低侧|中压)")
KILOVOLTS = re.compile(r"(\d+(?:[.,]\d+)?) ?[kк][vв]")


def mark_other_sides(
    recording: Recording, phasors: Snapshots, feeders: "Sequence[Feeder]"
) -> "list[Feeder]":
    """The feeders; of two that are one current at two voltages the one without its voltage is no
    load, and both say so.
    """
    marked = list(feeders)
    for a, b in combinations(range(len(marked)), 2):
        pair = marked[a], marked[b]
        if not all(f.loaded and len(f.currents) == 3 == len(f.voltages) for f in pair):
            continue
        if pair[0].voltages != pair[1].voltages or any(CLOSED_SUM in " ".join(f.why) for f in pair):
            continue
        high, low = (a, b) if _size(phasors, pair[0]) < _size(phasors, pair[1]) else (b, a)
        if not _is_same_current(recording, phasors, marked[high], marked[low]):
            continue
        kept, other = (
            (high, low)
            if _has_high_voltage(recording, phasors, marked[high], marked[low])
            else (low, high)
        )
        ratio = _size(phasors, marked[low]) / _size(phasors, marked[high])
        share = ratio if other == low else 1 / ratio
        said = (
            f"{SAME_CURRENT} as that of {marked[kept].name} times {share:.3g}, on the other side of"
            " a transformer, whose voltage is not recorded"
        )
        marked[other] = replace(marked[other], why=(*marked[other].why, said), loaded=False)
        said = (
            f"{marked[other].name} is the same current on the other side of a transformer, and no"
            " load beside it: these voltages are of this side"
        )
        marked[kept] = replace(marked[kept], why=(*marked[kept].why, said))
    return marked


def _size(phasors: Snapshots, feeder: "Feeder") -> float:
    return phasors.size(feeder.currents)


def _is_same_current(
    recording: Recording, phasors: Snapshots, high: "Feeder", low: "Feeder"
) -> bool:
    """Whether the currents are one at all times, but for a ratio and the turn of a vector group.

    Where no name says the sides, only a turn of 30 degrees tells them from two feeders of like
    loads.
    """
    small, large = _size(phasors, high), _size(phasors, low)
    if not UNLOADED * large < small < large / LEAST_RATIO:
        return False
    X, Y = (phasors.of(f.currents) for f in (high, low))
    there = np.isfinite(X).all(axis=0) & np.isfinite(Y).all(axis=0)
    x, y = (sequences(each[:, there])[0] for each in (X, Y))
    named = _find_sides(recording, high, low) is not None
    by = np.vdot(x, y) / max(float(np.vdot(x, x).real), 1e-300)
    rest = float(np.linalg.norm(y - by * x) / max(np.linalg.norm(y), 1e-300))
    turned = float(np.degrees(np.angle(by)))
    if rest > LARGEST_REST[named] or abs(turned - 30 * round(turned / 30)) > LARGEST_TURN[named]:
        return False
    return named or round(turned / 30) % 2 == 1


def _find_sides(recording: Recording, high: "Feeder", low: "Feeder") -> tuple[float, float] | None:
    """What the names say of the sides: kV where they do, else 1 of a high side and 0 of a low one;
    None for nothing.
    """
    sides = [_read_side(recording, each.currents) for each in (high, low)]
    known = [side for side in sides if side is not None]
    return (known[0], known[1]) if len(known) == 2 and known[0] > known[1] else None


def _read_side(recording: Recording, numbers: Sequence[int]) -> float | None:
    """The side that the names of channels say: kV, else 1 of a high side and 0 of a low one."""
    texts = [f"{recording.channels[i].name} {recording.channels[i].circuit}" for i in numbers]
    text = texts[0].lower()
    if kilovolts := KILOVOLTS.search(text):
        return float(kilovolts[1].replace(",", "."))
    side = SIDE.search(text)
    return None if side is None else float(bool(side[1] or side[3]))


def _has_high_voltage(
    recording: Recording, phasors: Snapshots, high: "Feeder", low: "Feeder"
) -> bool:
    """Whether the voltages are those of the high side: by names, else by which voltage the other
    side has then.
    """
    U, ratio = _measure_voltage(phasors, high), _size(phasors, low) / _size(phasors, high)
    sides, own = _find_sides(recording, high, low), _read_side(recording, high.voltages)
    if sides is not None and sides[1] > 0:  # kV
        return abs(np.log(sides[0] / U)) < abs(np.log(sides[1] / U))
    if sides is not None and own in sides:
        return own == sides[0]
    below, above = off_nominal(U / ratio), off_nominal(U * ratio)
    if max(below, above) > LARGEST_OFF_NOMINAL:
        return below < above
    return U > LARGEST_DISTRIBUTION


def _measure_voltage(phasors: Snapshots, feeder: "Feeder") -> float:
    """Line voltage [kV] of three voltages, to ground unless they are between phases."""
    V1, V2 = (np.abs(np.nan_to_num(v)) for v in sequences(phasors.of(feeder.voltages)))
    size = float(np.median(np.maximum(V1, V2)))
    lines = str(feeder.connection).startswith("line")
    return size if lines else float(np.sqrt(3)) * size
