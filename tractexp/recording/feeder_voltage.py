"""Which voltages the currents of a load belong to, and what says so."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from tractexp.configuration.plugin import build_chosen
from tractexp.record.phasor import TURN, compute_sequences
from tractexp.recording.channel_group import list_names
from tractexp.recording.connection import choose_usual_connection
from tractexp.recording.feeder import Feeder
from tractexp.recording.label import Group, split_words
from tractexp.recording.recording import Recording
from tractexp.recording.snapshot import UNLOADED, Snapshots
from tractexp.recording.unit import is_unit_in_doubt

LEAST_SEQUENCE_SHARE = 0.75  # of the RMS: what three phases have of one sequence at some time
PICK_UP = 1e-3  # of the greatest voltage: what a dead line picks up is less
# of another bus's residual: by less the currents do not follow a bus better
LARGEST_RESIDUAL_SHARE = 0.5
SAME_BUS = 0.02  # voltages that never differ by more are those of one bus, or of two tied ones


def list_feeders(
    recording: Recording, phasors: Snapshots, load: Group, buses: Sequence[Group], level: float
) -> list[Feeder]:
    """The feeder of a group of currents; one for each bus where it cannot be told which they belong
    to.
    """
    feeders = []
    for bus, why in find_voltages(recording, phasors, load, buses, level):
        voltages, connection = _choose_connection(load, bus)
        said = [
            f"currents {list_names(recording, load.numbers)}: {load.evidence}",
            f"voltages {list_names(recording, bus.numbers)}: {why}",
        ]
        if bus.pairs:
            said.append("the voltages are line to line, as their names say")
        if len(load.numbers) == 2:
            said.append(
                "two currents are recorded: the third is minus their sum, as where no current"
                " returns to earth"
            )
        name = load.name or bus.name or "the feeder"
        feeders.append(Feeder(voltages, load.numbers, connection, name=name, why=tuple(said)))
    return add_question(recording, phasors, feeders)


def add_question(recording: Recording, phasors: Snapshots, feeders: list[Feeder]) -> list[Feeder]:
    """The feeders, and where they are several that exclude each other, the question which it is in
    each of them.
    """
    if len(feeders) == 1:
        return feeders
    which = " or ".join(
        f"{list_names(recording, f.voltages)} ({_describe_size(recording, phasors, f)})"
        for f in feeders
    )
    question = f"which voltages these currents belong to cannot be told: {which}"
    return [
        replace(
            f,
            name=f"{f.name} at {', '.join(map(str, f.voltages))}",
            why=(*f.why, question),
            question=question,
        )
        for f in feeders
    ]


def _describe_size(recording: Recording, phasors: Snapshots, feeder: Feeder) -> str:
    """Voltage and powers of a feeder while it is alive, in words."""
    if any(is_unit_in_doubt(recording.channels[i]) for i in (*feeder.voltages, *feeder.currents)):
        return "units in doubt"
    connection = build_chosen("connection", feeder.connection)
    V = connection.voltage() @ phasors.select_channels(feeder.voltages)
    I = connection.current() @ phasors.select_channels(feeder.currents)
    size = np.nan_to_num(np.linalg.norm(V, axis=0))
    alive = size >= np.percentile(size, 50)
    S = complex(np.nanmedian((V * I.conj()).sum(axis=0)[alive]))
    U = float(np.median(size[alive]))  # of three phases: line to line
    return f"{U:.4g} kV, P = {S.real:.4g} MW, Q = {S.imag:.4g} Mvar"


def _choose_connection(load: Group, bus: Group) -> tuple[tuple[int, ...], Any]:
    """(the voltages used, the connection that makes phase quantities of them)."""
    voltages = bus.numbers
    connection = choose_usual_connection(len(voltages), len(load.numbers), bus.pairs)
    if connection is None:  # three line-to-line voltages and two currents: two of them say the same
        voltages = voltages[:2]
        connection = choose_usual_connection(2, len(load.numbers), bus.pairs)
    settings: dict[str, Any] = {} if isinstance(connection, str) else {**connection}
    if load.missing not in (None, 1):
        settings["phases"] = "abc".replace("abc"[load.missing], "")
    if bus.missing not in (None, 2):
        settings["pairs"] = [["bc", "ca"], ["ab", "ca"]][bus.missing]
    if bus.backward:
        pairs = zip(settings.get("pairs", ["ab", "bc"]), voltages, strict=True)
        steps = [(pair, -1 if number in bus.backward else 1) for pair, number in pairs]
        settings["pairs"] = [pair[::step] for pair, step in steps]
    if isinstance(connection, str) and settings:
        return voltages, {"name": connection, **settings}
    return voltages, settings or connection


def find_voltages(
    recording: Recording, phasors: Snapshots, load: Group, buses: Sequence[Group], level: float
) -> list[tuple[Group, str]]:
    """The voltages that a group of currents belongs to, and what says so; several where that cannot
    be told.

    `level` [kA] is the greatest current in the file. What carries a load has no dead voltage,
    whatever its name.
    """
    if len(buses) == 1:
        return [(buses[0], "the only ones in the file")]
    loaded = phasors.size(load.numbers) > UNLOADED * level
    if loaded:
        buses = _select_alive(phasors, buses) or buses
    if len(buses) == 1:
        return [(buses[0], "the only ones alive")]
    ties, why = _find_named_alike(recording, phasors, load, buses)
    if len(ties) == 1:
        return [(ties[0], why)]
    apart = max(_measure_difference(phasors, a, b) for a, b in combinations(ties, 2))
    if apart < SAME_BUS:
        return [
            (
                ties[0],
                f"{len(ties)} groups of voltages differ by at most {100 * apart:.2g} %, the first"
                " is taken",
            )
        ]
    return _follow_voltages(phasors, load, buses, ties, loaded)


def _select_alive(phasors: Snapshots, buses: Sequence[Group]) -> list[Group]:
    """The voltages that are no dead line's, nor small beside the greatest."""
    greatest = max(phasors.size(bus.numbers) for bus in buses)
    alive = [bus for bus in buses if not are_dead(phasors, bus.numbers)]
    return [bus for bus in alive if phasors.size(bus.numbers) > PICK_UP * greatest]


def _follow_voltages(
    phasors: Snapshots, load: Group, buses: Sequence[Group], ties: Sequence[Group], loaded: bool
) -> list[tuple[Group, str]]:
    """The voltages that the currents of a load follow best, one of the `ties` of names where it
    follows as well; several where another of these does.
    """
    stray = {id(bus): _measure_stray_current(phasors, bus, load) for bus in buses}
    best = min(buses, key=lambda bus: stray[id(bus)])
    # one of those whose names say as much
    if LARGEST_RESIDUAL_SHARE * min(stray[id(bus)] for bus in ties) <= stray[id(best)]:
        best = min(ties, key=lambda bus: stray[id(bus)])
    others = [
        b
        for b in buses
        if LARGEST_RESIDUAL_SHARE * stray[id(b)] < stray[id(best)]
        and _measure_difference(phasors, best, b) >= SAME_BUS
    ]
    if not (loaded and any(b in ties for b in others)):
        return [(best, "the currents follow these voltages best")]
    return [(bus, "the currents may follow them") for bus in buses if bus is best or bus in others]


def _find_named_alike(
    recording: Recording, phasors: Snapshots, load: Group, buses: Sequence[Group]
) -> tuple[list[Group], str]:
    """(the voltages whose names share most with those of the currents, what they share where it is
    one group).
    """
    texts = [
        phasors.remember(("text", *g.numbers), lambda g=g: _list_shared_words(recording, g))
        for g in (load, *buses)
    ]
    own = sorted(texts[0])
    common = [sum(w in t for t in texts[1:]) for w in own]
    scores = [
        sum(1 / n for w, n in zip(own, common, strict=True) if n and w in text)
        for text in texts[1:]
    ]  # a word that names one bus only weighs most
    best = max(scores)
    ties = [bus for bus, score in zip(buses, scores, strict=True) if score >= best - 1e-9]
    shared = sorted(
        w for w in texts[0] & texts[1 + buses.index(ties[0])] if common[own.index(w)] < len(buses)
    )
    return ties, f"their names share '{' '.join(shared)}' with the currents'"


def _list_shared_words(recording: Recording, group: Group) -> set[str]:
    """The words that all channels of a group share, by which voltages and currents are matched."""
    channels = [recording.channels[i] for i in group.numbers]
    shared = set.intersection(*(split_words(f"{c.name} {c.circuit}") for c in channels)) - {
        "u",
        "v",
        "i",
    }
    if len(channels) == 1:  # a phase is a name of its own there: "Ia" goes with "Ua"
        shared |= {f"phase {word[1:]}" for word in shared if word[0] in "uvi" and 1 < len(word) < 4}
    return shared


def _compute_positive_sequence(X: np.ndarray, pairs: bool) -> np.ndarray:
    """Positive sequence (M,) of three phasors; of two line voltages that which they say, to a
    constant factor.
    """
    if len(X) == 3:
        return compute_sequences(X)[0]
    return (X[0] - TURN**2 * X[1]) / 3 if pairs else X[0]


def _measure_difference(phasors: Snapshots, a: Group, b: Group) -> float:
    """How far two groups of voltages differ at worst, as a share of the larger."""
    x, y = (_compute_positive_sequence(phasors.select_channels(g.numbers), g.pairs) for g in (a, b))
    return float(np.nanmax(np.abs(x - y)) / max(np.nanmax(np.abs(x)), 1e-12))


def _measure_stray_current(phasors: Snapshots, bus: Group, load: Group) -> float:
    """Norm of the currents' residual about a constant admittance at these voltages."""
    v, i = (
        _compute_positive_sequence(phasors.select_channels(bus.numbers), bus.pairs),
        _compute_positive_sequence(phasors.select_channels(load.numbers), False),
    )
    valid = np.isfinite(v) & np.isfinite(i)
    v, i = v[valid], i[valid]
    y = np.vdot(v, i) / max(float(np.vdot(v, v).real), 1e-12)
    return float(np.linalg.norm(i - y * v))


def are_dead(phasors: Snapshots, numbers: Sequence[int]) -> bool:
    """Whether three voltages never turn as three phases do, in either order."""
    return phasors.remember(("dead", *numbers), lambda: _do_never_turn(phasors, numbers))


def _do_never_turn(phasors: Snapshots, numbers: Sequence[int]) -> bool:
    """Whether no part of a record shows these channels as phasors of the grid's frequency."""
    if len(numbers) < 3:
        return not any(phasors.pure(i) for i in numbers)
    X = np.nan_to_num(phasors.select_channels(numbers))
    rest = np.nan_to_num(phasors.rest[[phasors.numbers.index(i) for i in numbers]])
    size = np.sqrt((np.abs(X) ** 2 + rest**2).mean(axis=0))
    return not (np.abs(compute_sequences(X)).max(axis=0) > LEAST_SEQUENCE_SHARE * size).any()
