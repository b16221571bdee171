"""One recording of the files of one event: their channels side by side, at the same instants."""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import numpy as np

from tractexp.errors import UserError
from tractexp.recording.event_files import (
    SAME_INSTANT,
    Alignment,
    SampledFile,
    align,
    move_samples,
    name_files,
    tell_apart,
)
from tractexp.recording.recording import Channel, Recording, Segment


def join_recordings(recordings: Sequence[Recording]) -> Recording:
    """The recordings of one event as one; the first says station, device and times.

    Raises `UserError` for rates that differ and times that do not overlap.
    """
    first, *others = recordings
    if not others:
        return first
    aligned = _align(recordings)
    cut = [_cut_common(each, aligned, k) for k, each in enumerate(recordings)]
    channels, said = _name_channels(cut)
    notes = itertools.chain.from_iterable(_list_notes(each, first) for each in recordings)
    return replace(
        cut[0],
        channels=channels,
        status=[status for each in cut for status in each.status],
        trigger=next((each.trigger for each in cut if each.trigger is not None), None),
        triggers=max((each.triggers for each in cut), key=len),
        notes=list(dict.fromkeys([*aligned.notes, *said, *notes])),
        extra={},
    )


def _list_notes(recording: Recording, first: Recording) -> list[str]:
    """The notes of a recording, with its file's name where they are not of the first one, too."""
    name = Path(recording.source).name
    return [note if note in first.notes else f"{name}: {note}" for note in recording.notes]


def _align(recordings: Sequence[Recording]) -> Alignment:
    """Where recordings have the same instants: those of several segments where all are alike."""
    first = recordings[0]
    if all(len(each.segments) == 1 for each in recordings):
        return align([_describe_samples(each) for each in recordings])
    for each in recordings:
        if [*map(_describe_segment, each.segments)] != [*map(_describe_segment, first.segments)]:
            raise UserError(
                f"{each.source} has other stretches of samples than {first.source}: files of one"
                " event that have several rates, or gaps, are joined where all have the same; read"
                " each by itself"
            )
        step = timedelta(seconds=1 / first.segments[0].rate)
        if each.start and first.start and abs(each.start - first.start) > step / 2:
            raise UserError(
                f"{each.source} begins at {each.start} and {first.source} at {first.start}: files"
                " of one event that have several rates, or gaps, are joined where they begin"
                " together; read each by itself"
            )
    count = len(recordings)
    said = f"{name_files(each.source for each in recordings)} are joined sample by sample"
    return Alignment([0] * count, [0.0] * count, first.samples, (said,))


def _describe_segment(segment: Segment) -> tuple[float, ...]:
    """The numbers that segments of files must share to be joined without moving a sample."""
    return segment.first, segment.stop, round(segment.rate, 3), round(segment.start, 6)


def _describe_samples(recording: Recording) -> SampledFile:
    """Rate, count and begin of a recording of one segment."""
    (segment,) = recording.segments
    begun = recording.start and recording.start + timedelta(seconds=segment.start)
    count = segment.stop - segment.first
    return SampledFile(recording.source, segment.rate, count, segment.start, begun)


def _cut_common(recording: Recording, aligned: Alignment, k: int) -> Recording:
    """File k at the instants that all files have."""
    if len(recording.segments) > 1:
        return recording
    (segment,) = recording.segments
    first = segment.first + aligned.first[k]
    late = aligned.late[k]
    gone = segment.start + (aligned.first[k] + late) / segment.rate
    part = slice(first, first + aligned.count)
    return replace(
        recording,
        channels=[
            _move_channel(channel, first, aligned.count, late) for channel in recording.channels
        ],
        status=[replace(status, raw=status.raw[part]) for status in recording.status],
        segments=[Segment(0, aligned.count, segment.rate, 0.0)],
        start=recording.start and recording.start + timedelta(seconds=gone),
        trigger=None if recording.trigger is None else recording.trigger - gone,
        triggers=[trigger - gone for trigger in recording.triggers],
    )


def _move_channel(channel: Channel, first: int, count: int, late: float) -> Channel:
    """A channel at other instants: as it was stored, where these are those of samples."""
    if abs(late) <= SAME_INSTANT:
        return replace(channel, raw=channel.raw[first : first + count])
    values = move_samples(channel.read_values(), first, count, late)
    return replace(channel, raw=values, gain=1.0, offset=0.0, missing=None, limits=None)


def _name_channels(recordings: Sequence[Recording]) -> tuple[list[Channel], list[str]]:
    """The channels of all, each with a name of its own; notes on those that several files have.

    A name that several files have gets what their own names tell them apart by.
    """
    told = tell_apart([each.source for each in recordings])
    kept: list[tuple[int, Channel]] = []
    notes: list[str] = []
    for k, recording in enumerate(recordings):
        for channel in recording.channels:
            if any(j < k and _hold_same_samples(channel, one) for j, one in kept):
                name = channel.name.strip()
                source = Path(recording.source).name
                notes.append(f"channel '{name}' of {source} is that of an earlier file")
            else:
                kept.append((k, channel))
    names = [channel.name.strip() for _, channel in kept]
    return [
        channel if names.count(name) == 1 else replace(channel, name=f"{name} {told[k]}".strip())
        for name, (k, channel) in zip(names, kept, strict=True)
    ], notes


def _hold_same_samples(one: Channel, other: Channel) -> bool:
    """Whether two files hold the same samples under the same name, and not one value alone, as
    dead channels do.
    """
    if other.name.strip() != one.name.strip() or len(other.raw) != len(one.raw):
        return False
    values = one.values()
    varies = bool((values != values[:1]).any())
    return varies and bool(np.array_equal(values, other.values(), equal_nan=True))
