"""Single missing samples of channels, bridged where a recording is opened."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tractexp.record.gap import describe_bridged, estimate_wave_values, find_single_gaps
from tractexp.recording.recording import NOTHING_BRIDGED, Channel, Recording, Segment
from tractexp.text.wording import list_first

NAMED_CHANNELS = 3  # that are told


def bridge_recording(recording: Recording) -> Recording:
    """The recording with single missing samples of its channels bridged, and a note on them.

    Longer gaps stay, and are refused where they are read.
    """
    channels = [_bridge_channel(channel, recording.segments) for channel in recording.channels]
    told = [(k, channel) for k, channel in enumerate(channels) if len(channel.bridged[0])]
    if not told:
        return recording
    at = np.unique(np.concatenate([channel.bridged[0] for _, channel in told]))
    names = [f"{k} '{channel.name.strip()}'" for k, channel in told]
    which = list_first(names, NAMED_CHANNELS)
    said = f"{describe_bridged(_times(recording, at))} ({which})"
    note = f"{said}: bridged, and in a dip in no sum of P and Q"
    return replace(recording, channels=channels, notes=(*recording.notes, note))


def _bridge_channel(channel: Channel, segments: Sequence[Segment]) -> Channel:
    """A channel with what is put in place of its single missing samples."""
    if channel.form != "waveform" or not _may_lack(channel):
        return channel
    numbers, estimates = [], []
    for segment in segments:
        x = channel.read_values(segment.first, segment.stop)
        at = find_single_gaps(np.isnan(x))
        numbers.append(segment.first + at)
        estimates.append(estimate_wave_values(x, at))
    bridged = np.concatenate(numbers), np.concatenate(estimates)
    return replace(channel, bridged=bridged) if len(bridged[0]) else channel


def _may_lack(channel: Channel) -> bool:
    """Whether the raw values can stand for none at all: integers cannot without a mark."""
    if channel.raw.dtype.kind in "iu":
        return channel.missing is not None and bool((channel.raw == channel.missing).any())
    return True


def _times(recording: Recording, numbers: np.ndarray) -> list[float]:
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
