"""Short gaps of channels, bridged where a recording is opened."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tractexp.record.change import find_runs
from tractexp.record.gap import (
    describe_bridged,
    estimate_wave_values,
    find_short_gaps,
    limit_wave_gap,
)
from tractexp.recording.recording import NOTHING_BRIDGED, Channel, Recording, Segment
from tractexp.text.wording import list_first

NAMED_CHANNELS = 3  # that are told, and parts of a recording


def bridge_recording(recording: Recording) -> Recording:
    """The recording with short gaps of its channels bridged, and a note on them.

    A longer one of all channels parts it: what lies before and behind is looked at by itself.
    Others stay, and are refused where they are read.
    """
    recording = _part_recording(recording)
    channels = [_bridge_channel(channel, recording) for channel in recording.channels]
    told = [(k, channel) for k, channel in enumerate(channels) if len(channel.bridged[0])]
    if not told:
        return recording
    at = np.unique(np.concatenate([channel.bridged[0] for _, channel in told]))
    names = [f"{k} '{channel.name.strip()}'" for k, channel in told]
    which = list_first(names, NAMED_CHANNELS)
    said = f"{describe_bridged(_find_times(recording, at))} ({which})"
    note = f"{said}: bridged, and in a dip in no sum of P and Q"
    return replace(recording, channels=channels, notes=(*recording.notes, note))


def _part_recording(recording: Recording) -> Recording:
    """The recording without samples of which no channel has a value, more than are bridged."""
    empty = _find_empty_samples(recording)
    if not empty.any():
        return recording
    parts = []
    for segment in recording.segments:
        lacking = empty[segment.first : segment.stop]
        short = find_short_gaps(lacking, limit_wave_gap(segment.rate, recording.frequency))
        lacking[short] = False
        parts += [
            replace(
                segment,
                first=segment.first + part.start,
                stop=segment.first + part.stop,
                start=segment.start + part.start / segment.rate,
            )
            for part in find_runs(~lacking)
        ]
    if parts == recording.segments or not parts:
        return recording
    count = sum(part.stop - part.first for part in parts)
    told = ", ".join(f"{part.start:.6g} s" for part in parts[:NAMED_CHANNELS])
    note = (
        f"{sum(s.stop - s.first for s in recording.segments) - count} samples have no value in any"
        f" channel: parts that begin at {told} are looked at by themselves"
    )
    return replace(recording, segments=parts, notes=(*recording.notes, note))


def _find_empty_samples(recording: Recording) -> np.ndarray:
    """Which samples (N,) have no value in any channel of waves; it ends at the first that lacks
    none.
    """
    empty = np.zeros(1, dtype=bool)
    stop = max((segment.stop for segment in recording.segments), default=0)
    waves = (channel for channel in recording.channels if channel.form == "waveform")
    for number, channel in enumerate(waves):
        if not _may_lack(channel):
            return np.zeros(1, dtype=bool)
        lacking = np.isnan(channel.read_values(0, stop))
        empty = empty & lacking if number else lacking
        if not empty.any():
            break
    return empty


def _bridge_channel(channel: Channel, recording: Recording) -> Channel:
    """A channel with what is put in place of its missing samples."""
    if channel.form != "waveform" or not _may_lack(channel):
        return channel
    numbers, estimates = [], []
    for segment in recording.segments:
        x = channel.read_values(segment.first, segment.stop)
        at = find_short_gaps(np.isnan(x), limit_wave_gap(segment.rate, recording.frequency))
        numbers.append(segment.first + at)
        estimates.append(estimate_wave_values(x, at))
    bridged = np.concatenate(numbers), np.concatenate(estimates)
    return replace(channel, bridged=bridged) if len(bridged[0]) else channel


def _may_lack(channel: Channel) -> bool:
    """Whether the raw values can stand for none at all: integers cannot without a mark."""
    if channel.raw.dtype.kind in "iu":
        return channel.missing is not None and bool((channel.raw == channel.missing).any())
    return True


def _find_times(recording: Recording, numbers: np.ndarray) -> list[float]:
    """Times [s] of samples, ascending numbers (K,)."""
    return [
        segment.start + (int(number) - segment.first) / segment.rate
        for segment in recording.segments
        for number in numbers[(segment.first <= numbers) & (numbers < segment.stop)]
    ]


def find_bridged(recording: Recording, channels: Sequence[int], segment: Segment) -> np.ndarray:
    """The samples (K,) of a segment, counted from its first, that are bridged in some of the
    channels.
    """
    numbers = [recording.channels[i].bridged[0] for i in channels]
    at = np.unique(np.concatenate([NOTHING_BRIDGED[0], *numbers]))
    return at[(segment.first <= at) & (at < segment.stop)] - segment.first
