"""Loads of one or two conductors: single-phase feeders, and contact line with negative feeder."""

from collections.abc import Sequence

import numpy as np

from tractexp.recording.channel_group import (
    LARGEST_PHASE_DIFFERENCE,
    SYMMETRIC,
    list_names,
    select_free,
)
from tractexp.recording.connection import choose_usual_connection
from tractexp.recording.feeder import Feeder
from tractexp.recording.feeder_voltage import add_question, find_voltages
from tractexp.recording.label import Group, find_shared_name, order
from tractexp.recording.nominal_voltage import is_to_ground
from tractexp.recording.railway import (
    find_conductor_pairs,
    find_opposite_pairs,
    find_other_conductor,
    find_unnamed_conductor,
    is_between_conductors,
    is_opposite,
    is_return,
    order_contact_first,
)
from tractexp.recording.recording import Recording
from tractexp.recording.snapshot import Snapshots
from tractexp.recording.unit import is_secondary

ONE_PHASE = "one phase of a three-phase load, a part of its power"
HALF = "half of an autotransformer feeder"
MAYBE_HALF = f"may be {HALF}"


def list_railway_feeders(
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
    arms = [order_contact_first(recording, pair) for pair in find_opposite_pairs(phasors, volts)]
    if not arms and len(volts) == 1:
        arms = [(volts[0],)]
    if not arms or choose_usual_connection(len(arms[0]), 2) is None:
        return []
    buses = [Group(arm, False, "", False, "") for arm in arms]
    options = []
    pairs = find_conductor_pairs(recording, phasors, arms[0], amps)
    for k, (contact, feeder, inward) in enumerate(pairs, 1):
        currents = contact, feeder
        shared = find_shared_name([recording.channels[i] for i in currents])
        load = Group(currents, False, shared or f"autotransformer feeder {k}", False, "")
        found = [
            _build_conductor_feeder(recording, load, bus, why, inward)
            for bus, why in find_voltages(recording, phasors, load, buses, level)
        ]
        options.append(add_question(recording, phasors, found))
    return options


def _build_conductor_feeder(
    recording: Recording, load: Group, bus: Group, why: str, inward: bool
) -> Feeder:
    """The feeder of the currents of a contact line and a negative feeder, at their voltages."""
    names = list_names(recording, bus.numbers)
    of = (
        f"contact line and negative feeder, {names}: opposite to each other, {why}"
        if len(bus.numbers) == 2
        else f"{names} is the voltage between contact line and negative feeder"
    )
    currents = list_names(recording, load.numbers)
    said = [of, f"the currents {currents} are those of its two conductors"]
    connection = choose_usual_connection(len(bus.numbers), 2)
    if inward:
        settings = {"name": connection} if isinstance(connection, str) else connection
        connection = {**settings, "feeder": "inward"}
        said.append("both have one angle: that of the negative feeder is counted the other way")
    return Feeder(bus.numbers, load.numbers, connection, name=load.name, why=tuple(said))


def list_single_feeders(
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
    free = select_free(recording, phasors, volts, used)
    single = []
    for i in select_free(recording, phasors, amps, used) if free else ():
        group = Group((i,), False, recording.channels[i].name.strip(), False, "")
        buses = find_voltages(
            recording, phasors, group, [Group((v,), False, "", False, "") for v in free], level
        )
        feeders = []
        for bus, why in buses:
            said = (
                f"one current {list_names(recording, [i])}",
                f"one voltage {list_names(recording, bus.numbers)}: {why}",
            )
            said += _describe_railway_part(recording, phasors, volts, amps, bus.numbers[0], i)
            said += _describe_phase_part(recording, phasors, free, bus.numbers[0])
            loaded = not is_return(recording, i)
            parts = [part for part in (MAYBE_HALF, HALF, ONE_PHASE) if part in " ".join(said)]
            name = f"{group.name} ({parts[0]})" if parts else group.name
            feeders.append(
                Feeder(
                    bus.numbers,
                    (i,),
                    choose_usual_connection(1, 1),
                    name=name,
                    why=said,
                    loaded=loaded,
                )
            )
        single.append(add_question(recording, phasors, feeders))
    return single


def _describe_railway_part(
    recording: Recording,
    phasors: Snapshots,
    volts: Sequence[int],
    amps: Sequence[int],
    voltage: int,
    current: int,
) -> tuple[str, ...]:
    """A sentence on a current that carries a part of a load only, or brings it back; () for
    others.
    """
    if is_return(recording, current):
        return (
            "the current of a return conductor or the rail: what the contact line brings flows back"
            " in it",
        )
    pure = [i for i in volts if i != voltage and phasors.pure(i)]
    opposite = next((i for i in pure if is_opposite(phasors, voltage, i)), None)
    if opposite is not None:
        return (_describe_half(recording, phasors, (voltage, opposite), current, amps),)
    other = find_other_conductor(recording, phasors, current, [i for i in amps if phasors.pure(i)])
    if other is not None:
        name = list_names(recording, [other])
        return (f"{HALF}: no voltage goes with the other current, {name}",)
    if is_between_conductors(phasors, voltage):
        return (
            f"{MAYBE_HALF}: {phasors.size([voltage]):.4g} kV is the voltage between contact line"
            " and negative feeder of such ones, and the current of one is recorded",
        )
    return ()


def _describe_half(
    recording: Recording,
    phasors: Snapshots,
    volts: tuple[int, int],
    current: int,
    amps: Sequence[int],
) -> str:
    """That a current is half of a load at two opposite voltages; where no name tells the conductors
    of two currents of one angle, that it may be, and how both are read as one load.
    """
    lacks = f"no current goes with the other voltage, {list_names(recording, volts[1:])}"
    pure = [i for i in amps if phasors.pure(i)]
    other = find_unnamed_conductor(recording, phasors, current, pure)
    connection = choose_usual_connection(2, 2)
    if other is None or not isinstance(connection, str):
        return f"{HALF}: {lacks}"
    first, second = sorted((current, other))
    name = list_names(recording, [other])
    return (
        f"{MAYBE_HALF}: {lacks}; if {name} is that of the other conductor, counted the other way,"
        f" both are one load: data.voltages=[{volts[0]},{volts[1]}]"
        f" data.currents=[{first},{second}] 'data.connection={{name: {connection}, feeder:"
        f" inward}}'"
    )


def _describe_phase_part(
    recording: Recording, phasors: Snapshots, volts: Sequence[int], voltage: int
) -> tuple[str, ...]:
    """A sentence on a single voltage that is one of several phases: by its name and angle, or by
    its size; () for others.
    """
    x, channels = phasors.select_channels([voltage])[0], recording.channels
    for other in volts:
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.nanmedian(phasors.select_channels([other])[0] / x)
        apart = abs(np.degrees(np.angle(ratio)))
        alike = abs(abs(ratio) - 1) < LARGEST_PHASE_DIFFERENCE and abs(apart - 120) < SYMMETRIC
        if other != voltage and alike and order([channels[voltage], channels[other]]):
            name = list_names(recording, [other])
            return (f"{ONE_PHASE}: its voltage is 120 degrees from {name}",)
    kilovolts = phasors.size([voltage])
    if is_to_ground(kilovolts) and not is_secondary(recording, {"U": [voltage]}):
        line = np.sqrt(3) * kilovolts
        return (f"{ONE_PHASE}: {line:.4g} kV, sqrt(3) times its voltage, is a nominal one",)
    return ()
