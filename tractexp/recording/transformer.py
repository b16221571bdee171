"""Currents of both sides of a transformer beside the voltage of one: the same current twice, of
which one is a load's.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tractexp.record.phasor import compute_sequences
from tractexp.recording.feeder import Feeder
from tractexp.recording.kirchhoff import CLOSED_SUM
from tractexp.recording.nominal_voltage import measure_offset_from_nominal
from tractexp.recording.recording import Recording
from tractexp.recording.snapshot import UNLOADED, Snapshots

LEAST_RATIO = 1.5  # of the two currents: what is nearer has the same voltage
SAME_CURRENT = "no load here: the same current"
MAYBE_SAME = "at all times the same current"
OR_ALIKE = (
    ": a load just like it, or that load itself on the other side of a transformer, where its MW at"
    " these voltages are wrong"
)
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
WINDING = re.compile(r"(?<![^\W\d_])(?:w|wdg|winding|wicklung|side|seite)[ _-]?\d|обмотк|侧")
FEEDER = re.compile(
    r"(?<![^\W\d_])[fl]\d|feeder|line|lign|linie|línea|linea|abgang|load|last|线|фидер|отход|вл"
)
KILOVOLTS = re.compile(r"(\d+(?:[.,]\d+)?) ?[kк][vв]")


def mark_other_sides(
    recording: Recording, phasors: Snapshots, feeders: Sequence[Feeder]
) -> list[Feeder]:
    """The feeders; of two that are one current at two voltages the one without its voltage is no
    load, and both say so.
    """
    marked = list(feeders)
    for high, low, sure in _find_same_currents(recording, phasors, feeders):
        if not (marked[high].loaded and marked[low].loaded):
            continue
        kept, other = (
            (high, low)
            if _has_high_voltage(recording, phasors, marked[high], marked[low])
            else (low, high)
        )
        ratio = _measure_size(phasors, marked[low]) / _measure_size(phasors, marked[high])
        share = ratio if other == low else 1 / ratio
        if not sure:
            said = f"{MAYBE_SAME} as that of {marked[kept].name} times {share:.3g}{OR_ALIKE}"
            marked[other] = replace(marked[other], why=(*marked[other].why, said))
            continue
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


def _measure_size(phasors: Snapshots, feeder: Feeder) -> float:
    """How large the currents of a feeder are."""
    return phasors.size(feeder.currents)


class _Likeness(NamedTuple):
    """How alike the currents of two feeders are: what the ratio leaves, by how much they are turned
    [degrees], and whether the two are the only ones of their bus.
    """

    rest: float
    turned: float
    only: bool


def _judge_sides(
    recording: Recording, phasors: Snapshots, sides: tuple[Feeder, Feeder], likeness: _Likeness
) -> bool | None:
    """Whether feeders (high, low) are surely sides of one transformer; None where they are not."""
    small, large = (_measure_size(phasors, side) for side in sides)
    steps = round(likeness.turned / 30)
    named = _find_sides(recording, *sides) is not None
    alike = likeness.rest < LARGEST_REST[named]
    alike &= abs(likeness.turned - 30 * steps) < LARGEST_TURN[named]
    if not (alike and UNLOADED * large < small < large / LEAST_RATIO):
        return None
    texts = [recording.channels[side.currents[0]].name.lower() for side in sides]
    windings = all(WINDING.search(text) for text in texts)
    if named or steps % 2 or (windings and steps % 6 == 0):
        return True
    called = any(FEEDER.search(text) for text in texts)
    return False if likeness.only and not called else None


def _list_buses(feeders: Sequence[Feeder]) -> list[np.ndarray]:
    """The loaded feeders of each bus, of three phases whose currents do not close, where there are
    several.
    """
    buses: dict[tuple[int, ...], list[int]] = {}
    for k, f in enumerate(feeders):
        closes = CLOSED_SUM in " ".join(f.why)
        if f.loaded and len(f.currents) == 3 == len(f.voltages) and not closes:
            buses.setdefault(f.voltages, []).append(k)
    return [np.array(bus) for bus in buses.values() if len(bus) > 1]


def _find_same_currents(
    recording: Recording, phasors: Snapshots, feeders: Sequence[Feeder]
) -> list[tuple[int, int, bool]]:
    """Pairs (high, low side) of feeders at the same voltages whose currents are one at all times,
    but for a ratio and the turn of a vector group, and whether that is sure.

    Where no name says the sides, nor calls them windings, a turn of 30 degrees tells them from
    feeders of like loads. The only two of a bus that no name calls feeders may be either.
    """
    pairs = []
    for bus in _list_buses(feeders):
        rest, turned = _compare_currents(phasors, [feeders[k] for k in bus])
        for a, b in zip(*np.nonzero(rest < LARGEST_REST[True]), strict=True):
            high, low = int(bus[a]), int(bus[b])
            likeness = _Likeness(float(rest[a, b]), float(turned[a, b]), len(bus) == 2)
            sure = _judge_sides(recording, phasors, (feeders[high], feeders[low]), likeness)
            if sure is not None:
                pairs.append((high, low, sure))
    return pairs


def _compare_currents(
    phasors: Snapshots, feeders: Sequence[Feeder]
) -> tuple[np.ndarray, np.ndarray]:
    """(share of the current of feeder b that is no multiple of that of a, angle of the multiple
    [degrees]), (F, F) each; of a feeder and itself all of it.
    """
    X = np.array(
        [compute_sequences(phasors.select_channels(f.currents))[0] for f in feeders]
    )  # (F, M)
    X = X[:, np.isfinite(X).all(axis=0)]
    products = X.conj() @ X.T
    energy = np.maximum(np.real(np.diag(products)), 1e-300)
    left = 1 - np.abs(products) ** 2 / (energy[:, None] * energy)
    rest = np.sqrt(np.clip(left, 0.0, 1.0))
    np.fill_diagonal(rest, 1.0)
    return rest, np.degrees(np.angle(products))


def _find_sides(recording: Recording, high: Feeder, low: Feeder) -> tuple[float, float] | None:
    """The kV of both sides where names tell them, else 1 of a high side and 0 of a low one; None
    for neither.
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


def _has_high_voltage(recording: Recording, phasors: Snapshots, high: Feeder, low: Feeder) -> bool:
    """Whether the one recorded voltage is the high side's: by the channels' names, else by whether
    the voltage over the ratio or times the ratio is nearer a nominal one.
    """
    U, ratio = (
        _measure_voltage(phasors, high),
        _measure_size(phasors, low) / _measure_size(phasors, high),
    )
    sides, own = _find_sides(recording, high, low), _read_side(recording, high.voltages)
    if (
        sides is not None and sides[1] > 0
    ):  # both told in kV, not as 1 of the high and 0 of the low side
        return abs(np.log(sides[0] / U)) < abs(np.log(sides[1] / U))
    if sides is not None and own in sides:
        return own == sides[0]
    off_if_high, off_if_low = (
        measure_offset_from_nominal(U / ratio),
        measure_offset_from_nominal(U * ratio),
    )
    if max(off_if_high, off_if_low) > LARGEST_OFF_NOMINAL:
        return off_if_high < off_if_low
    return U > LARGEST_DISTRIBUTION


def _measure_voltage(phasors: Snapshots, feeder: Feeder) -> float:
    """Line voltage [kV] of three voltages, to ground unless they are between phases."""
    V1, V2 = (
        np.abs(np.nan_to_num(v))
        for v in compute_sequences(phasors.select_channels(feeder.voltages))
    )
    size = float(np.median(np.maximum(V1, V2)))
    lines = str(feeder.connection).startswith("line")
    return size if lines else float(np.sqrt(3)) * size
