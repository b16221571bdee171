"""Which channels show one load, and how they are connected."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from tractexp.record.phasor import TURN, sequences
from tractexp.recording.connection import usual
from tractexp.recording.label import Group, groups, kind, residual, words
from tractexp.recording.recording import Recording
from tractexp.recording.snapshot import Snapshots, frequency, nearest_nominal, snapshots

ALIKE = 0.1  # three magnitudes this close, as a share of their mean, may be three phases
SYMMETRIC = 15.0  # degrees off 120 that three phasors may be
UNLOADED = 0.005  # of the greatest current in the file: less is an unloaded feeder
STEPS_LOADED = 3.0  # quantisation steps that a current must exceed
CLOSES = 0.03  # of the sum of magnitudes: currents that add up to less belong to one bus
SYSTEM = 0.75  # of the RMS: what three phases have of one sequence at some time
SAME_BUS = 0.02  # voltages that never differ by more are those of one bus, or of two tied ones


@dataclass(frozen=True)
class Feeder:
    """One load's channels, numbers from 0, in the order that their connection takes them."""

    voltages: tuple[int, ...]
    currents: tuple[int, ...]
    connection: Any  # the plugin that makes phase quantities of them: a name, or name and settings
    reverse_current: bool = False  # the recorder counts current out of the load as positive
    name: str = ""
    why: tuple[str, ...] = ()  # the evidence for it, and what was changed in the order, one sentence each
    loaded: bool = True

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


def propose(recording: Recording) -> list[Feeder]:
    """The feeders that a recording of any number of channels shows; loaded ones first, [] where there are none.

    By what the names share, else by magnitudes and angles; each with the voltages its name or its behaviour says.
    """
    waves = {i: c for i, c in enumerate(recording.channels) if c.form == "waveform" and kind(c)}
    volts = [i for i in waves if kind(waves[i]) == "voltage"]
    amps = [i for i in waves if kind(waves[i]) == "current"]
    f, strange = _frequency(recording, volts, amps)
    phasors = snapshots(recording, sorted(waves), f)
    if not volts or not amps or phasors is None:
        return []
    buses = _groups(recording, phasors, volts)
    three = any(len(bus.numbers) == 3 or bus.pairs for bus in buses)  # without them two currents are two feeders
    loads = [g for g in _groups(recording, phasors, amps) if len(g.numbers) == 3 or three]
    feeders = [_feeder(recording, phasors, load, buses) for load in loads if buses and _fits(load, buses)]
    feeders += _single(recording, phasors, volts, amps, [*buses, *loads])
    feeders = _kirchhoff(phasors, feeders)
    level = max((_size(phasors, f.currents) for f in feeders), default=0.0)
    marked = (_marked(recording, phasors, feeder, level, strange) for feeder in feeders)
    return sorted(marked, key=lambda f: not f.loaded)


def _frequency(recording: Recording, volts: Sequence[int], amps: Sequence[int]) -> tuple[float, str]:
    """(Hz to look at the channels with, what is said of voltages that have no network's frequency)."""
    f = frequency(recording, volts) or frequency(recording, amps)
    if f is None or nearest_nominal(f) is not None:
        return f or recording.frequency, ""
    phasors = snapshots(recording, volts, f)
    turns = phasors is not None and any(phasors.pure(i) for i in volts)
    return recording.frequency, f"the voltages have {f:.3g} Hz, which is no network's" if turns else ""


def _groups(recording: Recording, phasors: Snapshots, numbers: Sequence[int]) -> list[Group]:
    """Groups among the channels of one quantity: by label, and the rest by magnitude and angle."""
    result = [
        g for g in groups({i: recording.channels[i] for i in numbers})
        if len(g.numbers) == 3 or g.pairs == (recording.channels[g.numbers[0]].quantity != "current")
    ]  # fmt: skip
    result = [g for g in result if g.certain or all(phasors.pure(i) for i in g.numbers)]
    taken = {i for g in result for i in g.numbers}
    free = [i for i in numbers if i not in taken and not residual(recording.channels[i]) and phasors.pure(i)]
    k = 0
    while k + 3 <= len(free):
        ordered = _symmetric(phasors, free[k : k + 3])
        if ordered:
            result.append(Group(ordered, False, f"channels {', '.join(map(str, ordered))}", False))
            k += 3
        else:
            k += 1
    return sorted(result, key=lambda g: g.numbers[0])


def _symmetric(phasors: Snapshots, numbers: Sequence[int]) -> tuple[int, ...]:
    """The three channels in the order a, b, c where their phasors are equal and 120 degrees apart; else ()."""
    X = phasors.of(numbers)
    level = np.abs(X).mean(axis=0)
    if not np.isfinite(level).any() or np.nanmax(level) == 0:
        return ()
    X = np.nanmedian(X[:, level > 0.5 * np.nanmax(level)] / _unit(X[0, level > 0.5 * np.nanmax(level)]), axis=1)
    size = np.abs(X)
    if not size.min() > 0 or np.ptp(size) > ALIKE * size.mean():
        return ()
    off = np.abs(np.degrees(np.angle(X[1:] / X[0] * [[TURN, TURN**2], [TURN**2, TURN]])))
    for angles, order in zip(off, ((0, 1, 2), (0, 2, 1)), strict=True):
        if angles.max() < SYMMETRIC:
            return tuple(numbers[i] for i in order)
    return ()


def _unit(x: np.ndarray) -> np.ndarray:
    size = np.abs(x)
    return np.where(size > 0, x, 1) / np.where(size > 0, size, 1)


def _fits(load: Group, buses: Sequence[Group]) -> bool:
    return len(load.numbers) == 3 or any(len(bus.numbers) == 2 or not bus.pairs for bus in buses)


def _feeder(recording: Recording, phasors: Snapshots, load: Group, buses: Sequence[Group]) -> Feeder:
    bus, why = _bus(recording, phasors, load, buses)
    voltages, connection = _connection(load, bus)
    said = [
        f"currents {_names(recording, load.numbers)}: {_by(load)}",
        f"voltages {_names(recording, bus.numbers)}: {why}",
    ]
    if bus.pairs:
        said.append("the voltages are line to line, as their names say")
    if len(load.numbers) == 2:
        said.append("two currents are recorded: the third is minus their sum, as where no current returns to earth")
    return Feeder(voltages, load.numbers, connection, name=load.name or bus.name or "the feeder", why=tuple(said))


def _connection(load: Group, bus: Group) -> tuple[tuple[int, ...], Any]:
    """(the voltages used, the connection that makes phase quantities of them)."""
    voltages = bus.numbers
    connection = usual(len(voltages), len(load.numbers), bus.pairs)
    if connection is None:  # three line-to-line voltages and two currents: two of them say the same
        voltages = voltages[:2]
        connection = usual(2, len(load.numbers), bus.pairs)
    settings: dict[str, Any] = {} if isinstance(connection, str) else {**connection}
    if load.missing not in (None, 1):
        settings["phases"] = "".join(p for k, p in enumerate("abc") if k != load.missing)
    if bus.missing not in (None, 2):
        settings["pairs"] = [pair for k, pair in enumerate(("ab", "bc", "ca")) if k != bus.missing]
    if isinstance(connection, str) and settings:
        return voltages, {"name": connection, **settings}
    return voltages, settings or connection


def _by(group: Group) -> str:
    if group.certain:
        return "their names differ in the phase alone"
    return "the file's phases say so" if not group.name.startswith("channels ") else "equal, 120 degrees apart"


def _names(recording: Recording, numbers: Sequence[int]) -> str:
    return ", ".join(f"{i} '{recording.channels[i].name}'" for i in numbers)


def _bus(recording: Recording, phasors: Snapshots, load: Group, buses: Sequence[Group]) -> tuple[Group, str]:
    """The voltages that a group of currents belongs to, and what says so."""
    if len(buses) == 1:
        return buses[0], "the only ones in the file"
    texts = [_text(recording, each) for each in (load, *buses)]
    own = sorted(texts[0])
    common = [sum(w in t for t in texts[1:]) for w in own]
    scores = [
        sum(1 / n for w, n in zip(own, common, strict=True) if n and w in text) for text in texts[1:]
    ]  # a word that names one bus only weighs most
    best = max(scores)
    ties = [bus for bus, score in zip(buses, scores, strict=True) if score >= best - 1e-9]
    if len(ties) == 1:
        shared = sorted(w for w in texts[0] & texts[1 + buses.index(ties[0])] if common[own.index(w)] < len(buses))
        return ties[0], f"their names share '{' '.join(shared)}' with the currents'"
    alive = [bus for bus in ties if _size(phasors, bus.numbers) > 0.5 * max(_size(phasors, b.numbers) for b in ties)]
    apart = max(_apart(phasors, a, b) for a, b in combinations(alive, 2)) if len(alive) > 1 else np.inf
    if len(alive) == 1:
        return alive[0], "the only ones alive"
    if apart < SAME_BUS:
        return alive[0], f"{len(alive)} groups of voltages differ by at most {100 * apart:.2g} %, the first is taken"
    return min(alive, key=lambda bus: _stray(phasors, bus, load)), "the currents follow these voltages best"


def _text(recording: Recording, group: Group) -> set[str]:
    channels = [recording.channels[i] for i in group.numbers]
    shared = set.intersection(*(words(f"{c.name} {c.circuit}") for c in channels)) - {"u", "v", "i"}
    if len(channels) == 1:  # a phase is a name of its own there: "Ia" goes with "Ua"
        shared |= {f"phase {word[1:]}" for word in shared if word[0] in "uvi" and 1 < len(word) < 4}
    return shared


def _size(phasors: Snapshots, numbers: Sequence[int]) -> float:
    """Magnitude [kV, kA] where it is large: the upper quartile of the mean over the channels."""
    size = np.nan_to_num(np.abs(phasors.of(numbers))).mean(axis=0)
    return float(np.percentile(size, 75)) if len(size) else 0.0


def _positive(X: np.ndarray, pairs: bool) -> np.ndarray:
    """Positive sequence (M,) of three phasors; of two line voltages that which they say, to a constant factor."""
    if len(X) == 3:
        return sequences(X)[0]
    return (X[0] - TURN**2 * X[1]) / 3 if pairs else X[0]


def _apart(phasors: Snapshots, a: Group, b: Group) -> float:
    """How far two groups of voltages differ at worst, as a share of the larger."""
    x, y = (_positive(phasors.of(g.numbers), g.pairs) for g in (a, b))
    return float(np.nanmax(np.abs(x - y)) / max(np.nanmax(np.abs(x)), 1e-12))


def _stray(phasors: Snapshots, bus: Group, load: Group) -> float:
    """Norm of the currents' residual about a constant admittance at these voltages."""
    v, i = _positive(phasors.of(bus.numbers), bus.pairs), _positive(phasors.of(load.numbers), False)
    valid = np.isfinite(v) & np.isfinite(i)
    v, i = v[valid], i[valid]
    y = np.vdot(v, i) / max(float(np.vdot(v, v).real), 1e-12)
    return float(np.linalg.norm(i - y * v))


def _single(
    recording: Recording, phasors: Snapshots, volts: Sequence[int], amps: Sequence[int], taken: Sequence[Group]
) -> list[Feeder]:
    """Single-phase feeders among the channels no group has taken: each current with its voltage."""
    used = {i for group in taken for i in group.numbers}
    free = [i for i in volts if i not in used and not residual(recording.channels[i]) and phasors.pure(i)]
    single = []
    for i in amps:
        if i in used or residual(recording.channels[i]) or not free or not phasors.pure(i):
            continue
        group = Group((i,), False, recording.channels[i].name.strip(), False)
        bus, why = _bus(recording, phasors, group, [Group((v,), False, "", False) for v in free])
        said = (f"one current {_names(recording, [i])}", f"one voltage {_names(recording, bus.numbers)}: {why}")
        single.append(Feeder(bus.numbers, (i,), usual(1, 1), name=group.name, why=said))
    return single


def _kirchhoff(phasors: Snapshots, feeders: list[Feeder]) -> list[Feeder]:
    """The feeders, with a note where the sum of their currents is zero, as they are or with one reversed.

    The whole station first, then the feeders of each bus.
    """
    three = [k for k, f in enumerate(feeders) if len(f.currents) == 3]
    level = max((_size(phasors, feeders[k].currents) for k in three), default=0.0)
    loaded = [k for k in three if _size(phasors, feeders[k].currents) > UNLOADED * level]
    if closed := _closed(phasors, feeders, loaded):
        return _said(feeders, loaded, *closed)
    for bus in sorted({feeders[k].voltages for k in loaded}):
        own = [k for k in loaded if feeders[k].voltages == bus]
        if closed := _closed(phasors, feeders, own):
            feeders = _said(feeders, own, *closed)
    return feeders


def _closed(phasors: Snapshots, feeders: list[Feeder], loaded: list[int]) -> tuple[np.ndarray, float] | None:
    """(signs, residual) of the simplest sum of three or more currents that closes; None where none does."""
    if len(loaded) < 3:
        return None
    X = np.array([phasors.of(feeders[k].currents) for k in loaded])  # (F, 3, M)
    X = X[:, :, np.isfinite(X).all(axis=(0, 1))]
    if not X.size:
        return None
    plain, each = np.ones(len(loaded)), np.arange(len(loaded))
    tried = [plain, *(np.where(each == k, s, plain) for k in each for s in (0, -1))]
    if len(loaded) > 4:
        tried += [np.where(np.isin(each, pair), 0, plain) for pair in combinations(each, 2)]
    tried = [signs for signs in tried if np.count_nonzero(signs) >= 3]
    closes = [_closure(X, signs) for signs in tried]
    if min(closes) >= CLOSES:
        return None
    simple = next(k for k in range(len(tried)) if closes[k] < max(CLOSES / 3, 2 * min(closes)))
    return tried[simple], closes[simple]


def _closure(X: np.ndarray, signs: np.ndarray) -> float:
    """Sum of the currents over the sum of their magnitudes, root mean square over phases and time."""
    total = np.tensordot(signs, X, axes=1)
    return float(np.linalg.norm(total) / np.linalg.norm(np.tensordot(np.abs(signs), np.abs(X), axes=1)))


def _said(feeders: list[Feeder], loaded: list[int], signs: np.ndarray, closes: float) -> list[Feeder]:
    marked = list(feeders)
    out = [feeders[k].name for k, s in zip(loaded, signs, strict=True) if s == 0]
    for k, sign in zip(loaded, signs, strict=True):
        said = f"the currents of {np.count_nonzero(signs)} feeders add up to {100 * closes:.2g} % of their magnitudes"
        if out:
            said += f", without {' and '.join(out)}" + (": a bus tie, or one of another bus" if sign == 0 else "")
        if sign < 0:
            said += " once this one's polarity is reversed"
        marked[k] = replace(marked[k], reverse_current=bool(sign < 0), why=(*marked[k].why, said))
    return marked


def _dead(phasors: Snapshots, numbers: Sequence[int]) -> bool:
    """Whether three voltages never turn as three phases do, in either order."""
    if len(numbers) < 3:
        return not any(phasors.pure(i) for i in numbers)
    X = np.nan_to_num(phasors.of(numbers))
    rest = np.nan_to_num(phasors.rest[[phasors.numbers.index(i) for i in numbers]])
    size = np.sqrt((np.abs(X) ** 2 + rest**2).mean(axis=0))
    return not (np.abs(sequences(X)).max(axis=0) > SYSTEM * size).any()


def _marked(recording: Recording, phasors: Snapshots, feeder: Feeder, level: float, strange: str) -> Feeder:
    """The feeder, marked as unloaded where it carries no load."""
    if _dead(phasors, feeder.voltages):
        why = strange or "the voltages are no three phases: the line is dead, or they were named otherwise"
        return replace(feeder, why=(*feeder.why, why), loaded=False)
    size = _size(phasors, feeder.currents)
    step = max(abs(c.gain * c.ratio * c.factor) for c in (recording.channels[i] for i in feeder.currents))
    integral = all(recording.channels[i].raw.dtype.kind in "iu" for i in feeder.currents)
    if size > UNLOADED * level and not (integral and size < STEPS_LOADED * step):
        return feeder
    said = f"unloaded: {1000 * size:.3g} A where the greatest current of the file is {1000 * level:.3g} A"
    return replace(feeder, why=(*feeder.why, said), loaded=False)
