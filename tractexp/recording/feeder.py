"""Which channels show one load, and how they are connected."""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from tractexp.configuration.plugin import chosen
from tractexp.errors import UserError
from tractexp.record.phasor import TURN, sequences
from tractexp.recording.connection import usual
from tractexp.recording.kirchhoff import closed_sums
from tractexp.recording.label import (
    Group,
    find_residuals,
    groups,
    kind,
    order,
    other_quantity,
    residual,
    shared_name,
    words,
)
from tractexp.recording.nominal_voltage import is_to_ground
from tractexp.recording.railway import (
    conductor_pairs,
    contact_first,
    direct_voltage,
    is_between_conductors,
    is_opposite,
    is_return,
    opposite_pairs,
    other_conductor,
)
from tractexp.recording.recording import Recording
from tractexp.recording.snapshot import UNLOADED, Snapshots, frequency, nearest_nominal, snapshots
from tractexp.recording.transformer import mark_other_sides
from tractexp.recording.unit import in_doubt, secondary_of

# three magnitudes this close, as a share of their mean, may be three phases
LARGEST_PHASE_DIFFERENCE = 0.1
SYMMETRIC = 15.0  # degrees off 120 that three phasors may be
STEPS_LOADED = 3.0  # quantisation steps that a current must exceed
LEAST_SEQUENCE_SHARE = 0.75  # of the RMS: what three phases have of one sequence at some time
PICK_UP = 1e-3  # of the greatest voltage: what a dead line picks up is less
# of another bus's residual: by less the currents do not follow a bus better
LARGEST_RESIDUAL_SHARE = 0.5
COUPLER = re.compile(
    r"coupl|bus[ _-]?(?:tie|sec)|sectionali[sz]|kuppl|traverse|tron[cç]on|母联|分段|шсв|секцион"
    r"|acopl|congiuntore|parallelo sbarre|(?<![^\W\d_])(?:tie|q?b/?c|св)(?![^\W\d_])"
)
ALONE = "no current is recorded: there is no load to fit"
ONE_PHASE = "one phase of a three-phase load, a part of its power"
HALF = "half of an autotransformer feeder"
MAYBE_HALF = f"may be {HALF}"
SAME_BUS = 0.02  # voltages that never differ by more are those of one bus, or of two tied ones


@dataclass(frozen=True)
class Feeder:
    """One load's channels, numbers from 0, in the order that their connection takes them."""

    voltages: tuple[int, ...]
    currents: tuple[int, ...]
    connection: Any  # the plugin that makes phase quantities of them: a name, or name and settings
    reverse_current: bool = False  # the recorder counts current out of the load as positive
    name: str = ""
    # the evidence for it, and what was changed in the order, one sentence each
    why: tuple[str, ...] = ()
    loaded: bool = True
    question: str = ""  # where other voltages may as well be its own: which there are, one sentence

    @property
    def channels(self) -> dict[str, tuple[int, ...]]:
        """Numbers of its channels by the letter of their quantity."""
        return {"U": self.voltages, "I": self.currents}

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of a reader that reads this load."""
        result: dict[str, Any] = {"voltages": list(self.voltages), "currents": list(self.currents)}
        counts = len(self.voltages), len(self.currents)
        if self.connection != usual(*counts, lines=counts[0] == 2):
            result["connection"] = self.connection
        return result | ({"reverse_current": True} if self.reverse_current else {})


def _find_options(
    recording: Recording, phasors: Snapshots, volts: Sequence[int], amps: Sequence[int]
) -> list[list[Feeder]]:
    """The feeders that currents may be, each with the voltages that may be its own, the likeliest
    first.
    """
    buses = _groups(recording, phasors, volts)
    # without them two currents are two feeders
    three = any(len(bus.numbers) == 3 or bus.pairs for bus in buses)
    loads = [g for g in _groups(recording, phasors, amps) if len(g.numbers) == 3 or three]
    level = max(phasors.size(each) for each in (*(g.numbers for g in loads), *((i,) for i in amps)))
    # with which two currents are enough
    two = any(len(bus.numbers) == 2 or not bus.pairs for bus in buses)
    fitting = [load for load in loads if buses and (two or len(load.numbers) == 3)]
    options = [_feeders(recording, phasors, load, buses, level) for load in fitting]
    options += _conductors(recording, phasors, volts, amps, [*buses, *loads], level)
    currents = [Group(f.channels["I"], False, "", False, "") for each in options for f in each]
    return options + _single(recording, phasors, volts, amps, [*buses, *loads, *currents], level)


def propose(recording: Recording) -> list[Feeder]:
    """The feeders that a recording of any number of channels shows; loaded ones first, [] where
    there are none.

    By what the names share, else by magnitudes and angles; each with the voltages its name or its
    behaviour says.
    """
    volts, amps = (_list_waves(recording, quantity) for quantity in ("voltage", "current"))
    f, strange = _frequency(recording, volts, amps)
    phasors = snapshots(recording, sorted([*volts, *amps]), f)
    if not volts or not amps or phasors is None or direct_voltage(recording):
        return []
    options = _find_options(recording, phasors, volts, amps)
    feeders = _with_others(closed_sums(phasors, [each[0] for each in options]), options)
    level = max((phasors.size(f.currents) for f in feeders), default=0.0)
    marked = [_mark_unloaded(recording, phasors, feeder, level, strange) for feeder in feeders]
    return sorted(mark_other_sides(recording, phasors, marked), key=lambda f: not f.loaded)


def _select_free(
    recording: Recording, phasors: Snapshots, numbers: Sequence[int], used: Collection[int]
) -> list[int]:
    """Those of channels that turn as a network does, are no residual and belong to no group."""
    return [
        i
        for i in numbers
        if i not in used and not residual(recording.channels[i]) and phasors.pure(i)
    ]


def _list_waves(recording: Recording, quantity: str) -> list[int]:
    """The numbers of the channels that are waveforms of a quantity."""
    return [
        i for i, c in enumerate(recording.channels) if c.form == "waveform" and kind(c) == quantity
    ]


def buses_alone(recording: Recording) -> list[Feeder]:
    """The buses of a recording that shows no load, by their voltages; [] where none turns as a
    network does.
    """
    volts = _list_waves(recording, "voltage")
    f, strange = _frequency(recording, volts, [])
    phasors = snapshots(recording, volts, f)
    if not volts or phasors is None or strange or direct_voltage(recording):
        return []
    pure = {i for i in volts if phasors.pure(i)}
    grouped = [g for g in _groups(recording, phasors, volts) if not pure.isdisjoint(g.numbers)]
    taken = {i for g in grouped for i in g.numbers}
    alone = _select_free(recording, phasors, volts, taken)
    feeders = [_bus_alone(recording, phasors, group) for group in grouped]
    why = (_why_alone(recording),)
    names = [recording.channels[i].name.strip() for i in alone]
    return feeders + [
        Feeder((i,), (), usual(1, 1), name=name, why=why, loaded=False)
        for i, name in zip(alone, names, strict=True)
    ]


def _why_alone(recording: Recording) -> str:
    """Why voltages are shown without currents."""
    amps = [i for i, c in enumerate(recording.channels) if kind(c) == "current"]
    if not amps:
        return ALONE
    return f"which voltages {_names(recording, amps)} belong to cannot be told: no load is shown"


def _bus_alone(recording: Recording, phasors: Snapshots, group: Group) -> Feeder:
    """A bus without currents, its voltages in the order in which they turn."""
    numbers, said = (
        group.numbers,
        [f"voltages {_names(recording, group.numbers)}: {group.evidence}", _why_alone(recording)],
    )
    if len(numbers) == 3:
        first, second = (
            float(np.nanmedian(np.abs(x))) for x in sequences(phasors.select_channels(numbers))
        )
        if second > first:
            numbers = (numbers[0], numbers[2], numbers[1])
            said.append("they turn in the order a, c, b")
    name = group.name or "the voltages"
    return Feeder(
        numbers, (), usual(len(numbers), 3, group.pairs), name=name, why=tuple(said), loaded=False
    )


def can_be_named(recording: Recording) -> bool:
    """Whether settings that name voltages and currents can help: there are waves that may be one
    and the other.
    """
    if direct_voltage(recording):
        return False
    try:
        recording.waveforms()
    except UserError:
        return False
    numbers = [
        i
        for i, c in enumerate(recording.channels)
        if c.form == "waveform" and not other_quantity(c)
    ]
    f = frequency(recording, numbers)
    phasors = snapshots(recording, numbers, f) if f and nearest_nominal(f) else None
    waves = [recording.channels[i] for i in numbers if phasors is not None and phasors.pure(i)]
    volts, amps = (
        sum(c.quantity in (quantity, "") for c in waves) for quantity in ("voltage", "current")
    )
    return volts > 0 and amps > 0 and len(waves) > 1


def explain_unrecognized(recording: Recording) -> str:
    """Why a recording shows no load by itself, one clause."""
    longest = max(recording.segments, key=lambda s: (s.stop - s.first) / s.rate)
    seconds = (longest.stop - longest.first) / longest.rate
    try:
        recording.waveforms()
    except UserError as error:
        return direct_voltage(recording) or str(error).removeprefix(f"{recording.source}: ")
    if 2 / recording.frequency >= seconds:
        return (
            f"it lasts {seconds:.3g} s at {longest.rate:g} Hz, less than two cycles of"
            f" {recording.frequency:g} Hz"
        )
    if direct := direct_voltage(recording):
        return direct
    quantities = ("voltage", "current")
    if lacking := next((each for each in quantities if not _list_waves(recording, each)), ""):
        units = ", ".join(sorted({f"'{c.unit.strip()}'" for c in recording.channels}))
        return f"no channel is a {lacking} by its unit, of which there are {units}, or by its name"
    return _explain_voltages(recording)


def _explain_voltages(recording: Recording) -> str:
    """The same where there are voltages and currents."""
    volts = [i for i, c in enumerate(recording.channels) if kind(c) == "voltage"]
    f = frequency(recording, volts)
    if f is not None and nearest_nominal(f) is None:
        return f"the strongest line of its voltages is at {f:.3g} Hz, which is no network's"
    phasors = snapshots(recording, volts)
    if phasors is None or not any(phasors.size([i]) > 0 for i in volts):
        return "its voltages are zero"
    return "no three voltages and currents have names or angles of phases"


def _with_others(feeders: Sequence[Feeder], options: Sequence[Sequence[Feeder]]) -> list[Feeder]:
    """The feeders, each followed by those that exclude it, of which the same is said."""
    result = []
    for feeder, (first, *others) in zip(feeders, options, strict=True):
        said, reverse = feeder.why[len(first.why) :], feeder.reverse_current
        result += [
            feeder,
            *(replace(f, reverse_current=reverse, why=(*f.why, *said)) for f in others),
        ]
    return result


def _frequency(
    recording: Recording, volts: Sequence[int], amps: Sequence[int]
) -> tuple[float, str]:
    """(Hz to look at the channels with, what is said of voltages that have no
    network's frequency).
    """
    f = frequency(recording, volts) or frequency(recording, amps)
    if f is None or nearest_nominal(f) is not None:
        return f or recording.frequency, ""
    phasors = snapshots(recording, volts, f)
    turns = phasors is not None and any(phasors.pure(i) for i in volts)
    return (
        recording.frequency,
        f"the voltages have {f:.3g} Hz, which is no network's" if turns else "",
    )


def _groups(recording: Recording, phasors: Snapshots, numbers: Sequence[int]) -> list[Group]:
    """Groups among the channels of one quantity: by label, and the rest by magnitude and angle."""
    result = [
        g
        for g in groups({i: recording.channels[i] for i in numbers})
        if len(g.numbers) == 3
        or g.pairs == (recording.channels[g.numbers[0]].quantity != "current")
    ]
    result = [g for g in result if g.certain or all(phasors.pure(i) for i in g.numbers)]
    taken = {i for g in result for i in g.numbers}
    residuals = find_residuals([recording.channels[i] for i in numbers])
    left_out = {*taken, *(numbers[k] for k in residuals)}
    free = [i for i in numbers if i not in left_out and phasors.pure(i)]
    result += _group_by_angles(phasors, free)
    return sorted(result, key=lambda g: g.numbers[0])


def _group_by_angles(phasors: Snapshots, numbers: Sequence[int]) -> list[Group]:
    """Threes of channels, one after the other, that are equal and 120 degrees apart."""
    found, k = [], 0
    while k + 3 <= len(numbers):
        ordered = _symmetric(phasors, numbers[k : k + 3])
        if ordered:
            name = f"channels {', '.join(map(str, ordered))}"
            found.append(Group(ordered, False, name, False, "equal, 120 degrees apart"))
        k += 3 if ordered else 1
    return found


def _symmetric(phasors: Snapshots, numbers: Sequence[int]) -> tuple[int, ...]:
    """The three channels in the order a, b, c where their phasors are equal and 120 degrees apart;
    else ().
    """
    X = phasors.select_channels(numbers)
    level = np.abs(X).mean(axis=0)
    if not np.isfinite(level).any() or np.nanmax(level) == 0:
        return ()
    X = np.nanmedian(
        X[:, level > 0.5 * np.nanmax(level)] / _unit(X[0, level > 0.5 * np.nanmax(level)]), axis=1
    )
    size = np.abs(X)
    if not size.min() > 0 or np.ptp(size) > LARGEST_PHASE_DIFFERENCE * size.mean():
        return ()
    off = np.abs(np.degrees(np.angle(X[1:] / X[0] * [[TURN, TURN**2], [TURN**2, TURN]])))
    for angles, turn in zip(off, ((0, 1, 2), (0, 2, 1)), strict=True):
        if angles.max() < SYMMETRIC:
            return tuple(numbers[i] for i in turn)
    return ()


def _unit(x: np.ndarray) -> np.ndarray:
    """Complex numbers of the same angles and of size 1; 1 where they are 0."""
    size = np.abs(x)
    return np.where(size > 0, x, 1) / np.where(size > 0, size, 1)


def _feeders(
    recording: Recording, phasors: Snapshots, load: Group, buses: Sequence[Group], level: float
) -> list[Feeder]:
    """The feeder of a group of currents; one for each bus where it cannot be told which they belong
    to.
    """
    feeders = []
    for bus, why in _buses(recording, phasors, load, buses, level):
        voltages, connection = _connection(load, bus)
        said = [
            f"currents {_names(recording, load.numbers)}: {load.evidence}",
            f"voltages {_names(recording, bus.numbers)}: {why}",
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
    return _add_question(recording, phasors, feeders)


def _add_question(recording: Recording, phasors: Snapshots, feeders: list[Feeder]) -> list[Feeder]:
    """The same, and where they are several that exclude each other, the question which it is in
    each of them.
    """
    if len(feeders) == 1:
        return feeders
    which = " or ".join(
        f"{_names(recording, f.voltages)} ({_size_of(recording, phasors, f)})" for f in feeders
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


def _size_of(recording: Recording, phasors: Snapshots, feeder: Feeder) -> str:
    """Voltage and powers of a feeder while it is alive, in words."""
    if any(in_doubt(recording.channels[i]) for i in (*feeder.voltages, *feeder.currents)):
        return "units in doubt"
    connection = chosen("connection", feeder.connection)
    V = connection.voltage() @ phasors.select_channels(feeder.voltages)
    I = connection.current() @ phasors.select_channels(feeder.currents)
    size = np.nan_to_num(np.linalg.norm(V, axis=0))
    alive = size >= np.percentile(size, 50)
    S = complex(np.nanmedian((V * I.conj()).sum(axis=0)[alive]))
    U = float(np.median(size[alive]))  # of three phases: line to line
    return f"{U:.4g} kV, P = {S.real:.4g} MW, Q = {S.imag:.4g} Mvar"


def _connection(load: Group, bus: Group) -> tuple[tuple[int, ...], Any]:
    """(the voltages used, the connection that makes phase quantities of them)."""
    voltages = bus.numbers
    connection = usual(len(voltages), len(load.numbers), bus.pairs)
    if connection is None:  # three line-to-line voltages and two currents: two of them say the same
        voltages = voltages[:2]
        connection = usual(2, len(load.numbers), bus.pairs)
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


def _names(recording: Recording, numbers: Sequence[int]) -> str:
    """ "4 'Ia', 5 'Ib'"."""
    return ", ".join(f"{i} '{recording.channels[i].name}'" for i in numbers)


def _buses(
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
    ties, why = _named_alike(recording, phasors, load, buses)
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
    alive = [bus for bus in buses if not _dead(phasors, bus.numbers)]
    return [bus for bus in alive if phasors.size(bus.numbers) > PICK_UP * greatest]


def _follow_voltages(
    phasors: Snapshots, load: Group, buses: Sequence[Group], ties: Sequence[Group], loaded: bool
) -> list[tuple[Group, str]]:
    """The voltages that the currents of a load follow best, one of the `ties` of names where it
    follows as well; several where another of these does.
    """
    stray = {id(bus): _stray(phasors, bus, load) for bus in buses}
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


def _named_alike(
    recording: Recording, phasors: Snapshots, load: Group, buses: Sequence[Group]
) -> tuple[list[Group], str]:
    """(the voltages whose names share most with those of the currents, what they share where it is
    one group).
    """
    texts = [
        phasors.remember(("text", *g.numbers), lambda g=g: _text(recording, g))
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


def _text(recording: Recording, group: Group) -> set[str]:
    """The words that all channels of a group share, by which voltages and currents are matched."""
    channels = [recording.channels[i] for i in group.numbers]
    shared = set.intersection(*(words(f"{c.name} {c.circuit}") for c in channels)) - {"u", "v", "i"}
    if len(channels) == 1:  # a phase is a name of its own there: "Ia" goes with "Ua"
        shared |= {f"phase {word[1:]}" for word in shared if word[0] in "uvi" and 1 < len(word) < 4}
    return shared


def _positive(X: np.ndarray, pairs: bool) -> np.ndarray:
    """Positive sequence (M,) of three phasors; of two line voltages that which they say, to a
    constant factor.
    """
    if len(X) == 3:
        return sequences(X)[0]
    return (X[0] - TURN**2 * X[1]) / 3 if pairs else X[0]


def _measure_difference(phasors: Snapshots, a: Group, b: Group) -> float:
    """How far two groups of voltages differ at worst, as a share of the larger."""
    x, y = (_positive(phasors.select_channels(g.numbers), g.pairs) for g in (a, b))
    return float(np.nanmax(np.abs(x - y)) / max(np.nanmax(np.abs(x)), 1e-12))


def _stray(phasors: Snapshots, bus: Group, load: Group) -> float:
    """Norm of the currents' residual about a constant admittance at these voltages."""
    v, i = (
        _positive(phasors.select_channels(bus.numbers), bus.pairs),
        _positive(phasors.select_channels(load.numbers), False),
    )
    valid = np.isfinite(v) & np.isfinite(i)
    v, i = v[valid], i[valid]
    y = np.vdot(v, i) / max(float(np.vdot(v, v).real), 1e-12)
    return float(np.linalg.norm(i - y * v))


def _conductors(
    recording: Recording,
    phasors: Snapshots,
    volts: Sequence[int],
    amps: Sequence[int],
    taken: Sequence[Group],
    level: float,
) -> list[list[Feeder]]:
    """Railway feeders of two conductors: contact line and negative feeder, each with
    its current.
    """
    used = {i for group in taken for i in group.numbers}
    volts, amps = (
        [i for i in numbers if i not in used and phasors.pure(i)] for numbers in (volts, amps)
    )
    arms = [contact_first(recording, pair) for pair in opposite_pairs(phasors, volts)]
    if not arms and len(volts) == 1:
        arms = [(volts[0],)]
    if not arms or usual(len(arms[0]), 2) is None:
        return []
    buses = [Group(arm, False, "", False, "") for arm in arms]
    options = []
    pairs = conductor_pairs(recording, phasors, arms[0], amps)
    for k, (contact, feeder, inward) in enumerate(pairs, 1):
        currents = contact, feeder
        shared = shared_name([recording.channels[i] for i in currents])
        load = Group(currents, False, shared or f"autotransformer feeder {k}", False, "")
        found = [
            _build_conductor_feeder(recording, load, bus, why, inward)
            for bus, why in _buses(recording, phasors, load, buses, level)
        ]
        options.append(_add_question(recording, phasors, found))
    return options


def _build_conductor_feeder(
    recording: Recording, load: Group, bus: Group, why: str, inward: bool
) -> Feeder:
    """The feeder of the currents of a contact line and a negative feeder, at their voltages."""
    names = _names(recording, bus.numbers)
    of = (
        f"contact line and negative feeder, {names}: opposite to each other, {why}"
        if len(bus.numbers) == 2
        else f"{names} is the voltage between contact line and negative feeder"
    )
    said = [of, f"the currents {_names(recording, load.numbers)} are those of its two conductors"]
    connection = usual(len(bus.numbers), 2)
    if inward:
        settings = {"name": connection} if isinstance(connection, str) else connection
        connection = {**settings, "feeder": "inward"}
        said.append("both have one angle: that of the negative feeder is counted the other way")
    return Feeder(bus.numbers, load.numbers, connection, name=load.name, why=tuple(said))


def _single(
    recording: Recording,
    phasors: Snapshots,
    volts: Sequence[int],
    amps: Sequence[int],
    taken: Sequence[Group],
    level: float,
) -> list[list[Feeder]]:
    """Single-phase feeders among the channels no group has taken: each current with its voltage, or
    with several.
    """
    used = {i for group in taken for i in group.numbers}
    free = _select_free(recording, phasors, volts, used)
    single = []
    for i in _select_free(recording, phasors, amps, used) if free else ():
        group = Group((i,), False, recording.channels[i].name.strip(), False, "")
        buses = _buses(
            recording, phasors, group, [Group((v,), False, "", False, "") for v in free], level
        )
        feeders = []
        for bus, why in buses:
            said = (
                f"one current {_names(recording, [i])}",
                f"one voltage {_names(recording, bus.numbers)}: {why}",
            )
            said += _part_of_railway(recording, phasors, volts, amps, bus.numbers[0], i)
            said += _part_of_phases(recording, phasors, free, bus.numbers[0])
            loaded = not is_return(recording, i)
            parts = [part for part in (MAYBE_HALF, HALF, ONE_PHASE) if part in " ".join(said)]
            name = f"{group.name} ({parts[0]})" if parts else group.name
            feeders.append(
                Feeder(bus.numbers, (i,), usual(1, 1), name=name, why=said, loaded=loaded)
            )
        single.append(_add_question(recording, phasors, feeders))
    return single


def _part_of_railway(
    recording: Recording,
    phasors: Snapshots,
    volts: Sequence[int],
    amps: Sequence[int],
    voltage: int,
    current: int,
) -> tuple[str, ...]:
    """What is said of a current that carries a part of a load only, or brings it back."""
    if is_return(recording, current):
        return (
            "the current of a return conductor or the rail: what the contact line brings flows back"
            " in it",
        )
    pure = [i for i in volts if i != voltage and phasors.pure(i)]
    opposite = next((i for i in pure if is_opposite(phasors, voltage, i)), None)
    if opposite is not None:
        return (f"{HALF}: no current goes with the other voltage, {_names(recording, [opposite])}",)
    other = other_conductor(recording, phasors, current, [i for i in amps if phasors.pure(i)])
    if other is not None:
        return (f"{HALF}: no voltage goes with the other current, {_names(recording, [other])}",)
    if is_between_conductors(phasors, voltage):
        return (
            f"{MAYBE_HALF}: {phasors.size([voltage]):.4g} kV is the voltage between contact line"
            " and negative feeder of such ones, and the current of one is recorded",
        )
    return ()


def _part_of_phases(
    recording: Recording, phasors: Snapshots, volts: Sequence[int], voltage: int
) -> tuple[str, ...]:
    """What is said of a single voltage that is one of several phases: by its name and angle, or by
    its size.
    """
    x, channels = phasors.select_channels([voltage])[0], recording.channels
    for other in volts:
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.nanmedian(phasors.select_channels([other])[0] / x)
        apart = abs(np.degrees(np.angle(ratio)))
        alike = abs(abs(ratio) - 1) < LARGEST_PHASE_DIFFERENCE and abs(apart - 120) < SYMMETRIC
        if other != voltage and alike and order([channels[voltage], channels[other]]):
            return (f"{ONE_PHASE}: its voltage is 120 degrees from {_names(recording, [other])}",)
    kilovolts = phasors.size([voltage])
    if is_to_ground(kilovolts) and not secondary_of(recording, {"U": [voltage]}):
        line = np.sqrt(3) * kilovolts
        return (f"{ONE_PHASE}: {line:.4g} kV, sqrt(3) times its voltage, is a nominal one",)
    return ()


def _dead(phasors: Snapshots, numbers: Sequence[int]) -> bool:
    """Whether three voltages never turn as three phases do, in either order."""
    return phasors.remember(("dead", *numbers), lambda: _never_turn(phasors, numbers))


def _never_turn(phasors: Snapshots, numbers: Sequence[int]) -> bool:
    """Whether no part of a record shows these channels as phasors of the grid's frequency."""
    if len(numbers) < 3:
        return not any(phasors.pure(i) for i in numbers)
    X = np.nan_to_num(phasors.select_channels(numbers))
    rest = np.nan_to_num(phasors.rest[[phasors.numbers.index(i) for i in numbers]])
    size = np.sqrt((np.abs(X) ** 2 + rest**2).mean(axis=0))
    return not (np.abs(sequences(X)).max(axis=0) > LEAST_SEQUENCE_SHARE * size).any()


def _mark_unloaded(
    recording: Recording, phasors: Snapshots, feeder: Feeder, level: float, strange: str
) -> Feeder:
    """The feeder, marked as unloaded where it carries no load."""
    why = _explain_no_load(recording, phasors, feeder, level, strange) if feeder.loaded else ""
    return replace(feeder, why=(*feeder.why, why), loaded=False) if why else feeder


def _find_step(recording: Recording, numbers: Sequence[int]) -> float:
    """The largest step of the samples of channels [kV or kA]; 0 of a channel that has none."""
    channels = [recording.channels[i] for i in numbers]
    if not {c.raw.dtype.kind for c in channels} <= {"i", "u"}:
        return 0.0
    return max(abs(c.gain * c.ratio * c.factor) for c in channels)


def _explain_no_load(
    recording: Recording, phasors: Snapshots, feeder: Feeder, level: float, strange: str
) -> str:
    """Why a feeder carries no load, one sentence; "" where it does."""
    if _dead(phasors, feeder.voltages):
        dead = "the voltages are no three phases: the line is dead, or they were named otherwise"
        return strange or dead
    if named := COUPLER.search(feeder.name.lower()):
        return (
            f"no load here: a bus coupler, as its name says ('{named[0]}'): its current is that of"
            " other feeders"
        )
    if not any(map(phasors.pure, feeder.currents)):
        return "no load here: the currents are no more than noise or harmonics"
    size = phasors.size(feeder.currents)
    if size > max(UNLOADED * level, STEPS_LOADED * _find_step(recording, feeder.currents)):
        return ""
    return (
        f"unloaded: {1000 * size:.3g} A where the greatest current of the file is"
        f" {1000 * level:.3g} A"
    )
