"""Whether three voltages are those to ground or those between lines."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from tractexp.configuration.plugin import build_chosen
from tractexp.errors import DATA, UserError
from tractexp.record.phasor import compute_sequences
from tractexp.recording.connection import choose_usual_connection
from tractexp.recording.feeder import Feeder
from tractexp.recording.label import (
    find_kind,
    find_label_groups,
    is_backward,
    is_to_ground,
    name_channel,
    order,
)
from tractexp.recording.live_phasors import (
    LEAST_FAULT_UNBALANCE,
    LEAST_LIVE_SEQUENCE,
    LivePhasors,
    measure_zero_sequence,
)
from tractexp.recording.nominal_voltage import is_between_phases
from tractexp.recording.recording import Recording
from tractexp.recording.snapshot import measure_network_frequency, take_snapshots

ZERO = 0.02  # V0 over V2 of line voltages in a fault to earth, whose sum is zero whatever happens
EARTH = 0.1  # I0 over I1 of a fault to earth
ROOT3 = 0.02  # line over phase voltages may be so far from sqrt 3, and 3 degrees from 30
# {recording: its voltages to ground and their levels}, which are compared with those of each load
_known_levels: WeakKeyDictionary[Recording, list[tuple[tuple[int, ...], float]]] = (
    WeakKeyDictionary()
)


def take_lines_by_label(recording: Recording, feeder: Feeder) -> Feeder:
    """Voltages that their labels call line to line, put in the order AB, BC, CA."""
    labels = (
        order([recording.channels[i] for i in feeder.voltages])
        if len(feeder.voltages) == 3
        else None
    )
    if not is_taken_to_ground(feeder) or labels is None or not labels[1]:
        return feeder
    voltages = tuple(feeder.voltages[labels[0].index(k)] for k in range(3))
    names = ", ".join(f"'{recording.channels[i].name}'" for i in voltages)
    why = (
        f"the voltages {names} are line to line, as their labels say:"
        f" data.connection={name_line_connection(feeder)} is used"
    )
    if is_backward([recording.channels[i] for i in voltages]):
        why += ", U21 as V1 - V2 (where it is V2 - V1, the power is the opposite)"
    return replace(
        feeder, voltages=voltages, connection=name_line_connection(feeder), why=(*feeder.why, why)
    )


def is_taken_to_ground(feeder: Feeder) -> bool:
    """Whether three voltages are taken as they stand, to ground."""
    return len(feeder.voltages) == 3 and feeder.connection == choose_usual_connection(
        3, len(feeder.currents)
    )


def name_line_connection(feeder: Feeder) -> Any:
    """The connection of the same channels with the voltages between phases."""
    return choose_usual_connection(len(feeder.voltages), len(feeder.currents), lines=True)


def check_lines(recording: Recording, feeder: Feeder) -> None:
    """Refuse phase voltages where the connection needs line-to-line ones."""
    connection = build_chosen("connection", feeder.connection)
    labels = order([recording.channels[i] for i in feeder.voltages])
    if not connection.lines or labels is None or labels[1]:
        return
    names = ", ".join(
        f"{i} '{recording.channels[i].name}' [{recording.channels[i].unit}]"
        for i in feeder.voltages
    )
    raise UserError(
        f"{DATA.voltages}={[*feeder.voltages]}: {names} are labelled as phases to ground, and"
        f" {DATA.connection}={connection.name} takes line-to-line voltages; give three channels to"
        " ground, or lines"
    )


def _names_ground(recording: Recording, numbers: Sequence[int]) -> bool:
    """Whether the name of a voltage says that it is to ground."""
    return any(is_to_ground(recording.channels[i]) for i in numbers)


def explain_lines_by_shape(recording: Recording, feeder: Feeder, live: LivePhasors) -> str:
    """Why three voltages must be line to line though no label says so; "" where
    nothing shows it.
    """
    used = f"they are line to line, and data.connection={name_line_connection(feeder)} is used"
    V1, V2 = (np.abs(x) for x in compute_sequences(live.V))
    I0, I1 = (
        measure_zero_sequence(live.I),
        np.median(np.abs(compute_sequences(live.I)[0])[live.calm]),
    )
    fault = (
        (V2 > LEAST_FAULT_UNBALANCE * V1) & (I0 > EARTH * I1) & (5 * np.median(I0[live.calm]) < I0)
    )
    V0 = measure_zero_sequence(live.V)
    if np.count_nonzero(fault) >= 2 and (V0[fault] < ZERO * V2[fault]).all():
        return (
            "the voltages add up to zero even in a fault to earth, where the currents do not:"
            f" {used}"
        )
    size = _measure_level(recording, feeder.voltages)
    for numbers, other in _measure_levels(recording):
        alike = abs(size / max(other, 1e-12) / np.sqrt(3) - 1) < 5 * ROOT3
        alike &= {*numbers}.isdisjoint(feeder.voltages)
        if alike and _are_differences(recording, feeder.voltages, numbers):
            others = ", ".join(name_channel(recording, i) for i in numbers)
            return (
                f"the voltages are sqrt 3 times, and 30 degrees ahead of, those of {others}: {used}"
            )
    level = float(np.median(V1[live.calm]))
    if is_between_phases(level) and not _names_ground(recording, feeder.voltages):
        return f"{level:.4g} kV is near a nominal voltage, and times sqrt 3 near none: {used}"
    return ""


def _measure_levels(recording: Recording) -> list[tuple[tuple[int, ...], float]]:
    """The voltages to ground of a recording, three by three, with their median
    positive sequence.
    """
    if recording not in _known_levels:
        volts = {i: c for i, c in enumerate(recording.channels) if find_kind(c) == "voltage"}
        three = [
            group.numbers
            for group in find_label_groups(volts)
            if len(group.numbers) == 3 and not group.pairs
        ]
        _known_levels[recording] = [
            (numbers, _measure_level(recording, numbers)) for numbers in three
        ]
    return _known_levels[recording]


def _measure_level(recording: Recording, numbers: Sequence[int]) -> float:
    """Median positive sequence of three voltages while they are alive; 0 where they have no
    waveform.
    """
    windows = take_snapshots(recording, numbers, measure_network_frequency(recording))
    if windows is None:
        return 0.0
    size = np.nan_to_num(np.abs(compute_sequences(windows.select_channels(numbers))[0]))
    return float(np.median(size[size >= LEAST_LIVE_SEQUENCE * size.max()]))


def _are_differences(recording: Recording, ours: Sequence[int], theirs: Sequence[int]) -> bool:
    """Whether three voltages are the differences of three others."""
    windows = take_snapshots(recording, [*ours, *theirs])
    if windows is None:
        return False
    x, y = (compute_sequences(windows.select_channels(numbers))[0] for numbers in (ours, theirs))
    large = np.nan_to_num(np.abs(y)) > LEAST_LIVE_SEQUENCE * np.nanmax(np.abs(y), initial=0)
    if not large.any():
        return False
    ratio = np.median(np.abs(x[large] / y[large])) * np.exp(
        1j * np.median(np.angle(x[large] / y[large]))
    )
    return abs(np.abs(ratio) / np.sqrt(3) - 1) < ROOT3 and abs(np.degrees(np.angle(ratio)) - 30) < 3
