"""Phasors of a load from the channels that show it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tractexp.configuration.plugin import build_chosen
from tractexp.errors import DATA, UserError
from tractexp.record.phasor import Phasors
from tractexp.record.phasor_measurement import measure
from tractexp.recording.bridge import find_bridged
from tractexp.recording.estimator import estimator_of
from tractexp.recording.feeder import Feeder
from tractexp.recording.recording import Recording, Segment


@dataclass(frozen=True, eq=False)
class FeederWaves:
    """The load's voltages [kV] and as many currents [kA] into it, (2 K, M), read from a segment
    where sliced.

    K is 3, or 1 for a single-phase load. `waves[:, a:b]` raises `UserError` where a value is
    missing.
    """

    recording: Recording
    feeder: Feeder
    segment: Segment
    sums: np.ndarray  # (2 K, channels) the weights with which the feeder's channels make up each

    @classmethod
    def from_recording(
        cls, recording: Recording, feeder: Feeder, segment: Segment
    ) -> "FeederWaves":
        """Voltages and currents of a feeder in one segment, as its connection adds up the
        channels.
        """
        connection = build_chosen("connection", feeder.connection)
        V, I = (
            connection.voltage(),
            (-1.0 if feeder.reverse_current else 1.0) * connection.current(),
        )
        I = I if feeder.currents else np.zeros((len(V), 0))  # of a bus alone
        sums = np.zeros((len(V) + len(I), V.shape[1] + I.shape[1]))
        sums[: len(V), : V.shape[1]], sums[len(V) :, V.shape[1] :] = V, I
        return cls(recording, feeder, segment, sums)

    @property
    def numbers(self) -> tuple[int, ...]:
        """The feeder's channels, voltages first."""
        return (*self.feeder.voltages, *self.feeder.currents)

    @property
    def shape(self) -> tuple[int, int]:
        """(sums, samples)."""
        return len(self.sums), self.segment.stop - self.segment.first

    def __getitem__(self, at: tuple[slice, slice]) -> np.ndarray:
        """A part of the sums, read from the file when it is asked for."""
        sums, (first, stop, _) = self.sums[at[0]], at[1].indices(self.shape[1])
        part = replace(
            self.segment, first=self.segment.first + first, stop=self.segment.first + stop
        )
        waves = np.zeros((len(sums), stop - first))
        for number, weights in zip(self.numbers, sums.T, strict=True):
            if weights.any():
                (values,) = self.recording.matrix([number], part)
                for k in np.flatnonzero(weights):
                    waves[k] += weights[k] * values
        return waves

    @property
    def bridged_times(self) -> tuple[float, ...]:
        """Times [s] of samples that were missing in some channel."""
        at = find_bridged(self.recording, self.numbers, self.segment)
        return tuple((self.segment.start + at / self.segment.rate).tolist())

    @property
    def late(self) -> np.ndarray:
        """Time (2 K,) [s] by which each is sampled later than stamped.

        Raises `UserError` where one combines channels that differ in it.
        """
        delays, skew = [], np.array([self.recording.channels[i].skew for i in self.numbers])
        for used in self.sums != 0:
            if np.ptp(skew[used]) > 1e-9:
                names = ", ".join(
                    self.recording.channels[i].name for i in np.array(self.numbers)[used]
                )
                raise UserError(
                    f"{DATA.skew}=true: the channels {names} are sampled at different times, and"
                    f" the connection needs them at once; leave {DATA.skew} out"
                )
            delays.append(skew[used][0])
        return np.array(delays)


def measure_phasors(
    recording: Recording,
    feeder: Feeder,
    segment: Segment,
    estimator: Any = None,
    skew: bool = False,
    harmonics: Sequence[int] = (),
    tracked: dict[int, np.ndarray] | None = None,
) -> Phasors:
    """Measure the phasors of a feeder within one segment.

    Parameters
    ----------
    recording : Recording
        With all channels.
    feeder : Feeder
        Which of them are the load's.
    segment : Segment
        The samples.
    estimator : name, mapping or None
        A name, or name and settings; None: the usual one.
    skew : bool
        Whether what the file says of late channels is corrected.
    harmonics : ints
        Measured besides the fundamental.
    tracked : dict or None
        Frequencies that the loads of a bus share, as in
        `tractexp.record.phasor_measurement.measure`.

    Returns
    -------
    Phasors

    Raises
    ------
    UserError
        For a segment that is too short, and for harmonics that the sampling cannot show.
    """
    for h in harmonics:
        if h < 2 or h * 1.1 * recording.frequency >= segment.rate / 2:
            most = int(segment.rate / 2 / 1.1 / recording.frequency)
            raise UserError(
                f"{DATA.harmonics}={[*harmonics]}: at {segment.rate:g} Hz they can be 2 to {most}"
            )
    waves = FeederWaves.from_recording(recording, feeder, segment)
    try:
        phasors = measure(
            waves,
            segment.rate,
            recording.frequency,
            segment.start,
            skew=waves.late if skew else None,
            window=estimator_of(estimator).averager,
            harmonics=harmonics,
            tracked=tracked,
        )
        return replace(phasors, bridged=waves.bridged_times)
    except UserError as error:
        raise UserError(
            f"{recording.source}: segment from {segment.start:.3f} s: {error}"
        ) from error
