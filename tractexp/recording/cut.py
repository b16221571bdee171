"""A part of a recording: what was recorded between two times."""

from dataclasses import replace
from datetime import timedelta
from typing import Any

import numpy as np

from tractexp.errors import UserError
from tractexp.recording.recording import Recording, Segment


def cut_recording(recording: Recording, begin: float, end: float) -> Recording:
    """The samples from `begin` to `end` [s since the first], as a recording of its own that starts
    at 0.

    Raises `UserError` where nothing was recorded then.
    """
    segments: list[Segment] = []
    parts: list[slice] = []
    count = 0
    for segment in recording.segments:
        t = segment.t
        first, stop = np.searchsorted(t, [begin - 1e-9, end + 1e-9]).tolist()
        if stop > first:
            parts.append(slice(segment.first + first, segment.first + stop))
            segments.append(Segment(count, count + stop - first, segment.rate, float(t[first])))
            count += stop - first
    if not segments:
        raise UserError(
            f"{recording.source}: nothing was recorded between {begin:.3f} and {end:.3f} s"
        )
    origin = segments[0].start
    moved = [trigger - origin for trigger in recording.find_triggers()]
    triggers = [trigger for trigger in moved if 0 <= trigger <= end - origin]
    return replace(
        recording,
        channels=[_cut_channel(channel, parts) for channel in recording.channels],
        status=[_cut_channel(status, parts) for status in recording.status],
        segments=[replace(segment, start=segment.start - origin) for segment in segments],
        start=recording.start and recording.start + timedelta(seconds=origin),
        trigger=triggers[0] if triggers else None,
        triggers=triggers,
        notes=[*recording.notes, f"cut from {recording.source}, {begin:.3f} to {end:.3f} s"],
        extra={
            key: recording.extra[key]
            for key in ("format", "revision", "kind", "sides")
            if key in recording.extra
        },
    )


def _cut_channel(channel: Any, parts: list[slice]) -> Any:
    """A channel's samples within some stretches, one after the other."""
    raw = np.asarray(channel.raw)
    return replace(
        channel,
        raw=raw[parts[0]] if len(parts) == 1 else np.concatenate([raw[part] for part in parts]),
    )
