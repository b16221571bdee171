"""Phasors of a load from the channels that show it."""

import numpy as np

from tractexp.errors import UserError
from tractexp.plugin import build
from tractexp.record.phasor import Phasors, measure
from tractexp.recording.feeder import Feeder
from tractexp.recording.recording import Recording, Segment


def waves_of(recording: Recording, feeder: Feeder, segment: Segment) -> np.ndarray:
    """The load's voltages [kV] and as many currents [kA] into it, (2 K, M), within a segment.

    K is 3, or 1 for a single-phase load. Raises `UserError` where a value is missing.
    """
    connection = build("connection", {"name": feeder.connection})
    V = connection.voltage() @ recording.matrix(feeder.voltages, segment)
    I = connection.current() @ recording.matrix(feeder.currents, segment)
    return np.concatenate([V, -I if feeder.reverse_current else I])


def phasors_of(
    recording: Recording, feeder: Feeder, segment: Segment, estimator: str = "one_cycle", skew: bool = False
) -> Phasors:
    """The phasors of a feeder within one segment; `skew` corrects what the file says of late channels.

    Raises `UserError` for a segment that is too short.
    """
    late = np.array([recording.channels[i].skew for i in (*feeder.voltages, *feeder.currents)])
    made = build("estimator", {"name": estimator})
    try:
        return measure(
            waves_of(recording, feeder, segment), segment.rate, recording.frequency, segment.start,
            skew=late if skew else None, phasors=made.phasors,
        )  # fmt: skip
    except UserError as error:
        raise UserError(f"{recording.source}: segment from {segment.start:.3f} s: {error}") from error
