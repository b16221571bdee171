"""The loads that a recording of any number of channels shows."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tractexp.record.phasor import compute_sequences
from tractexp.recording.channel_group import (
    find_frequency,
    find_groups,
    list_names,
    list_waves,
    select_free,
)
from tractexp.recording.connection import choose_usual_connection
from tractexp.recording.feeder import Feeder
from tractexp.recording.feeder_voltage import are_dead, list_feeders
from tractexp.recording.kirchhoff import note_closed_sums
from tractexp.recording.label import Group, find_kind
from tractexp.recording.lone_feeder import list_railway_feeders, list_single_feeders
from tractexp.recording.railway import describe_direct_voltage
from tractexp.recording.recording import Recording
from tractexp.recording.snapshot import UNLOADED, Snapshots, take_snapshots
from tractexp.recording.transformer import mark_other_sides

STEPS_LOADED = 3.0  # quantisation steps that a current must exceed
COUPLER = re.compile(
    r"coupl|bus[ _-]?(?:tie|sec)|sectionali[sz]|kuppl|traverse|tron[cç]on|母联|分段|шсв|секцион"
    r"|acopl|congiuntore|parallelo sbarre|(?<![^\W\d_])(?:tie|q?b/?c|св)(?![^\W\d_])"
)
ALONE = "no current is recorded: there is no load to fit"


def _find_options(
    recording: Recording, phasors: Snapshots, volts: Sequence[int], amps: Sequence[int]
) -> list[list[Feeder]]:
    """The feeders that currents may be, each with the voltages that may be its own, the likeliest
    first.
    """
    buses = find_groups(recording, phasors, volts)
    # without them two currents are two feeders
    three = any(len(bus.numbers) == 3 or bus.pairs for bus in buses)
    loads = [g for g in find_groups(recording, phasors, amps) if len(g.numbers) == 3 or three]
    level = max(phasors.size(each) for each in (*(g.numbers for g in loads), *((i,) for i in amps)))
    # with which two currents are enough
    two = any(len(bus.numbers) == 2 or not bus.pairs for bus in buses)
    fitting = [load for load in loads if buses and (two or len(load.numbers) == 3)]
    options = [list_feeders(recording, phasors, load, buses, level) for load in fitting]
    options += list_railway_feeders(recording, phasors, volts, amps, [*buses, *loads], level)
    currents = [Group(f.channels["I"], False, "", False, "") for each in options for f in each]
    taken = [*buses, *loads, *currents]
    return options + list_single_feeders(recording, phasors, volts, amps, taken, level)


def propose(recording: Recording) -> list[Feeder]:
    """The feeders that a recording of any number of channels shows; loaded ones first, [] where
    there are none.

    By what the names share, else by magnitudes and angles; each with the voltages its name or its
    behaviour says.
    """
    volts, amps = (list_waves(recording, quantity) for quantity in ("voltage", "current"))
    f, strange = find_frequency(recording, volts, amps)
    phasors = take_snapshots(recording, sorted([*volts, *amps]), f)
    if not volts or not amps or phasors is None or describe_direct_voltage(recording):
        return []
    options = _find_options(recording, phasors, volts, amps)
    feeders = _add_excluding_feeders(
        note_closed_sums(phasors, [each[0] for each in options]), options
    )
    level = max((phasors.size(f.currents) for f in feeders), default=0.0)
    marked = [_mark_unloaded(recording, phasors, feeder, level, strange) for feeder in feeders]
    return sorted(mark_other_sides(recording, phasors, marked), key=lambda f: not f.loaded)


def list_buses_alone(recording: Recording) -> list[Feeder]:
    """The buses of a recording that shows no load, by their voltages; [] where none turns as a
    network does.
    """
    volts = list_waves(recording, "voltage")
    f, strange = find_frequency(recording, volts, [])
    phasors = take_snapshots(recording, volts, f)
    if not volts or phasors is None or strange or describe_direct_voltage(recording):
        return []
    pure = {i for i in volts if phasors.pure(i)}
    grouped = [g for g in find_groups(recording, phasors, volts) if not pure.isdisjoint(g.numbers)]
    taken = {i for g in grouped for i in g.numbers}
    alone = select_free(recording, phasors, volts, taken)
    feeders = [_propose_bus(recording, phasors, group) for group in grouped]
    why = (_explain_lone_voltages(recording),)
    names = [recording.channels[i].name.strip() for i in alone]
    return feeders + [
        Feeder((i,), (), choose_usual_connection(1, 1), name=name, why=why, loaded=False)
        for i, name in zip(alone, names, strict=True)
    ]


def _explain_lone_voltages(recording: Recording) -> str:
    """Why voltages are shown without currents."""
    amps = [i for i, c in enumerate(recording.channels) if find_kind(c) == "current"]
    if not amps:
        return ALONE
    currents = list_names(recording, amps)
    return f"which voltages {currents} belong to cannot be told: no load is shown"


def _propose_bus(recording: Recording, phasors: Snapshots, group: Group) -> Feeder:
    """A bus without currents, its voltages in the order in which they turn."""
    numbers, names = group.numbers, list_names(recording, group.numbers)
    said = [f"voltages {names}: {group.evidence}", _explain_lone_voltages(recording)]
    if len(numbers) == 3:
        first, second = (
            float(np.nanmedian(np.abs(x)))
            for x in compute_sequences(phasors.select_channels(numbers))
        )
        if second > first:
            numbers = (numbers[0], numbers[2], numbers[1])
            said.append("they turn in the order a, c, b")
    name = group.name or "the voltages"
    return Feeder(
        numbers,
        (),
        choose_usual_connection(len(numbers), 3, group.pairs),
        name=name,
        why=tuple(said),
        loaded=False,
    )


def _add_excluding_feeders(
    feeders: Sequence[Feeder], options: Sequence[Sequence[Feeder]]
) -> list[Feeder]:
    """The feeders, each followed by those that exclude it, of which the same is said."""
    result = []
    for feeder, (first, *others) in zip(feeders, options, strict=True):
        said, reverse = feeder.why[len(first.why) :], feeder.reverse_current
        result += [
            feeder,
            *(replace(f, reverse_current=reverse, why=(*f.why, *said)) for f in others),
        ]
    return result


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
    if are_dead(phasors, feeder.voltages):
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
