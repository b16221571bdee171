"""Channels of one quantity that belong together: by their labels, else by magnitude and angle."""

from collections.abc import Collection, Sequence

import numpy as np

from tractexp.record.phasor import TURN
from tractexp.recording.label import (
    Group,
    find_kind,
    find_label_groups,
    find_residuals,
    is_residual,
)
from tractexp.recording.recording import Recording
from tractexp.recording.snapshot import (
    Snapshots,
    find_nominal_frequency,
    measure_frequency,
    take_snapshots,
)

# three magnitudes this close, as a share of their mean, may be three phases
LARGEST_PHASE_DIFFERENCE = 0.1
SYMMETRIC = 15.0  # degrees off 120 that three phasors may be


def select_free(
    recording: Recording, phasors: Snapshots, numbers: Sequence[int], used: Collection[int]
) -> list[int]:
    """Those of channels that turn as a network does, are no residual and belong to no group."""
    return [
        i
        for i in numbers
        if i not in used and not is_residual(recording.channels[i]) and phasors.pure(i)
    ]


def list_waves(recording: Recording, quantity: str) -> list[int]:
    """The numbers of the channels that are waveforms of a quantity."""
    return [
        i
        for i, c in enumerate(recording.channels)
        if c.form == "waveform" and find_kind(c) == quantity
    ]


def find_frequency(
    recording: Recording, volts: Sequence[int], amps: Sequence[int]
) -> tuple[float, str]:
    """(Hz to look at the channels with, what is said of voltages that have no
    network's frequency).
    """
    f = measure_frequency(recording, volts) or measure_frequency(recording, amps)
    if f is None or find_nominal_frequency(f) is not None:
        return f or recording.frequency, ""
    phasors = take_snapshots(recording, volts, f)
    turns = phasors is not None and any(phasors.pure(i) for i in volts)
    return (
        recording.frequency,
        f"the voltages have {f:.3g} Hz, which is no network's" if turns else "",
    )


def find_groups(recording: Recording, phasors: Snapshots, numbers: Sequence[int]) -> list[Group]:
    """Groups among the channels of one quantity: by label, and the rest by magnitude and angle."""
    result = [
        g
        for g in find_label_groups({i: recording.channels[i] for i in numbers})
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
        ordered = _find_symmetric_order(phasors, numbers[k : k + 3])
        if ordered:
            name = f"channels {', '.join(map(str, ordered))}"
            found.append(Group(ordered, False, name, False, "equal, 120 degrees apart"))
        k += 3 if ordered else 1
    return found


def _find_symmetric_order(phasors: Snapshots, numbers: Sequence[int]) -> tuple[int, ...]:
    """The three channels in the order a, b, c where their phasors are equal and 120 degrees apart;
    else ().
    """
    X = phasors.select_channels(numbers)
    level = np.abs(X).mean(axis=0)
    if not np.isfinite(level).any() or np.nanmax(level) == 0:
        return ()
    X = np.nanmedian(
        X[:, level > 0.5 * np.nanmax(level)] / _scale_to_unit(X[0, level > 0.5 * np.nanmax(level)]),
        axis=1,
    )
    size = np.abs(X)
    if not size.min() > 0 or np.ptp(size) > LARGEST_PHASE_DIFFERENCE * size.mean():
        return ()
    off = np.abs(np.degrees(np.angle(X[1:] / X[0] * [[TURN, TURN**2], [TURN**2, TURN]])))
    for angles, turn in zip(off, ((0, 1, 2), (0, 2, 1)), strict=True):
        if angles.max() < SYMMETRIC:
            return tuple(numbers[i] for i in turn)
    return ()


def _scale_to_unit(x: np.ndarray) -> np.ndarray:
    """Complex numbers of the same angles and of size 1; 1 where they are 0."""
    size = np.abs(x)
    return np.where(size > 0, x, 1) / np.where(size > 0, size, 1)


def list_names(recording: Recording, numbers: Sequence[int]) -> str:
    """ "4 'Ia', 5 'Ib'"."""
    return ", ".join(f"{i} '{recording.channels[i].name}'" for i in numbers)
