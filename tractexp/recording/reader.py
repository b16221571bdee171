"""Readers of waveform files: from channels to the dips of one load, numbered in order of time."""

import itertools
from abc import abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

from tractexp.configuration import plugin
from tractexp.configuration.overrides import format_assignment
from tractexp.errors import DATA, UserError, check_range, name_setting
from tractexp.record import Base, Events, Reader, Record, Waves, detect
from tractexp.record.dips import (
    FileDip,
    check_load,
    check_numbers,
    chosen,
    cut_dips,
    leave_out_bridged,
    level,
)
from tractexp.record.phasor import Phasors, join_phasors
from tractexp.record.record import LOAD
from tractexp.recording.arrangement import arrange_feeder, tune_frequency
from tractexp.recording.bridge import bridge_recording
from tractexp.recording.connection import choose_usual_connection
from tractexp.recording.estimator import estimator_of
from tractexp.recording.event_files import check_joined, event_paths
from tractexp.recording.feeder import Feeder
from tractexp.recording.joined import join_recordings
from tractexp.recording.label import find_shared_name, order
from tractexp.recording.measure import FeederWaves, measure_phasors
from tractexp.recording.proposal import propose
from tractexp.recording.quality import describe_clipped, measure_clipped_shares
from tractexp.recording.recording import Recording, Segment
from tractexp.recording.unit import check_doubt, check_units, convert_to_units
from tractexp.recording.unrecognized import can_be_named, explain_unrecognized
from tractexp.text import quoting
from tractexp.text.wording import count_noun

Stream = tuple[Phasors, Sequence[Waves]]  # of segments that follow each other without a gap
# cycles of waveforms stored beside a record's phasors, for the windows of its first and last
BESIDE = 2
BEFORE = 3  # cycles of one sampling rate before a dip that its waveforms have at least
COUNT = {1: "one", 2: "two", 3: "three"}


@dataclass(frozen=True, kw_only=True)
class WaveformReader(Reader):
    """Base of the readers of waveform files. A plugin reads the file; which load, which dips, is
    common to all.
    """

    quantities: ClassVar[Sequence[str]] = ("U", "I")  # that `units` may name

    path: str = ""  # the file, or a .zip that holds it
    # further files of the same event, whose channels are put beside those of the first
    join: list[str] = field(default_factory=list)
    # channels in the order a, b, c: numbers from 0, or names
    voltages: list[Any] = field(default_factory=list)
    currents: list[Any] = field(default_factory=list)  # channels, counted positive into the load
    # {U: kV, I: A} where the file does not say, or says wrongly
    units: dict[str, str] = field(default_factory=dict)
    # how the channels are connected, a name or name and settings; null: by how many they are
    connection: Any = None
    estimator: Any = None  # of the phasors, a name or name and settings; null: one cycle
    # whose powers P_h, with THD_u and THD_i, the record holds
    harmonics: list[int] = field(default_factory=list)
    train: list[int] | None = None  # dips to fit; null: the first that can be used
    validate: list[int] | None = None  # dips held out; null: every other one that can be used
    pre: float = 1.0  # s of the record before a dip starts, at most
    post: float = 10.0  # s of the record after a dip starts, at most
    # true where the recorder counts current out of the load as positive
    reverse_current: bool = False
    skew: bool = False  # true: correct the time skew of each channel that the file states

    def open_recording(self) -> Recording:
        """The files, their units and the nominal frequency that their voltages really have."""
        path, *join = event_paths(self.path, self.join, self.endings)
        recording = bridge_recording(replace(self, path=path, join=join).join_files())
        keys = {"U": "voltages", "I": "currents"}
        numbers = {
            x: [recording.number(i, f"data.{key}") for i in getattr(self, key)]
            for x, key in keys.items()
        }
        recording = convert_to_units(recording, self.units, numbers)
        chosen = numbers["U"]
        every = [
            i
            for i, c in enumerate(recording.channels)
            if c.quantity == "voltage" and c.form == "waveform"
        ]
        return tune_frequency(recording, chosen or every)

    opened = open_recording  # its name in version 0.2

    def join_files(self) -> Recording:
        """The files of one event as one recording. Raises `UserError` as `recording`, and where
        their times do not overlap.
        """
        parts = [replace(self, path=path, join=[]) for path in (self.path, *self.join)]
        return join_recordings([part.recording() for part in parts])

    @abstractmethod
    def recording(self) -> Recording:
        """Read the file as it was recorded, all channels.

        Returns
        -------
        Recording

        Raises
        ------
        UserError
            With the file, the place and the value of what is wrong.
        """

    def check(self) -> None:
        """Raise `UserError` for settings that cannot be."""
        if not self.path:
            raise UserError(
                f"{DATA.path} is missing: give the file, e.g. {DATA.path}=station{self.endings[0]}"
            )
        check_joined("data.join", [self.path, *self.join], self.endings)
        check_units(self.units, self.quantities)
        check_numbers(self.train, self.validate)
        check_range("data.pre", self.pre, 0.05)
        check_range("data.post", self.post, 0.1)

    def read(self) -> Events:
        """Read the dips that are fitted and held out.

        Returns
        -------
        Events
            Phasors; what was noted on the way is in their notes.
        """
        recording = self.open_recording()
        feeder = self.feeder(recording)
        dips = self.dips(
            feeder, self._streams(recording, feeder), recording.frequency, recording.find_triggers()
        )
        events = chosen(
            self.path, dips, self.train, self.validate, self._notes(recording, feeder, dips)
        )
        identity = _identify_load(recording, feeder)
        groups = (events.train, events.validate)
        return Events(
            *([_load_waveforms(replace(r, identity=identity)) for r in group] for group in groups)
        )

    def attach_samples(
        self, recording: Recording, feeder: Feeder, record: Record, span: tuple[float, float]
    ) -> Record:
        """The record of a dip that lasts a `span` [s] of the recording, with the samples that show
        it in memory, and which load it is.
        """
        segments = itertools.chain(*recording.stretches())
        waves = (self._waves(recording, feeder, segment) for segment in segments)
        shown = _show_samples(record, span, waves, recording.frequency)
        return _load_waveforms(replace(shown, identity=_identify_load(recording, feeder)))

    def dips(
        self,
        feeder: Feeder,
        streams: Sequence[Stream],
        frequency: float,
        triggers: Sequence[float] = (),
    ) -> list[FileDip]:
        """The dips of one load, on one base: voltage and apparent power before the first that can
        be used.

        Raises `UserError` where there is none, and where the load carries no power.
        """
        wholes = [self._whole(feeder, stream, frequency) for stream in streams]
        file_dips = cut_dips(wholes, self.path, self.pre, self.post, triggers)
        waves = list(itertools.chain(*(s for _, s in streams if len(s) > 1)))
        file_dips = [replace(dip, result=_attach_waves(dip, waves, frequency)) for dip in file_dips]
        if not file_dips:
            # raises, and says what there is instead
            detect(max(wholes, key=lambda whole: whole.samples))
        first = next((dip.result for dip in file_dips if isinstance(dip.result, Record)), None)
        if first is None:
            return file_dips
        base = self._measure_base(first, frequency)
        return [replace(dip, result=_scale_to_per_unit(dip.result, base)) for dip in file_dips]

    def _measure_base(self, record: Record, frequency: float) -> Base:
        """Voltage and apparent power before a dip. Raises `UserError` for a load without power."""
        U, S = level(record)
        if S < 1e-6:
            raise UserError(
                f"{self.path}: {DATA.currents} carry no power before the first dip ({1e6 * S:.2g}"
                " VA)"
            )
        check_load(self.path, U, S)
        return Base(U, S, frequency, LOAD)

    def _whole(self, feeder: Feeder, stream: Stream, frequency: float) -> Record:
        """All of one segment, in kV, MW and Mvar."""
        phasors, waves = stream
        window = estimator_of(self.estimator).window(frequency)
        whole = Record(
            name=Path(self.path).stem,
            t=phasors.t,
            U=phasors.U,
            P=phasors.S.real,
            Q=phasors.S.imag,
            f=phasors.f,
            U2=phasors.U2 if len(phasors.V) == 3 else None,
            base=Base(frequency=frequency),
            source=self.path,
            notes=plugin.build_chosen("connection", feeder.connection).notes,
            window=window,
            more=phasors.more,
            waves=waves[0] if len(waves) == 1 else None,
        )
        return leave_out_bridged(whole, phasors.bridged, window.length / 2)

    def _numbers(
        self, recording: Recording, key: str, connection: str, wanted: int
    ) -> tuple[int, ...]:
        """The numbers of the `wanted` channels that a setting names.

        Raises `UserError` for fewer or more, for one named twice and for one of another quantity.
        """
        named, channels = getattr(self, key), recording.channels
        where = name_setting(f"data.{key}")
        if len(named) != wanted:
            there = ", ".join(f"{i} '{c.name}' [{c.unit}]" for i, c in enumerate(channels))
            raise UserError(
                f"{where}={[*named]} must name {COUNT[wanted]} channels"
                f" ({DATA.connection}={connection}); {recording.source} has {there}"
            )
        numbers = tuple(recording.number(each, f"data.{key}") for each in named)
        if len(set(numbers)) < wanted:
            raise UserError(
                f"{where}={[*named]} names a channel twice; {wanted} different ones are needed"
            )
        for i in numbers:
            if channels[i].quantity not in (key.removesuffix("s"), ""):
                raise UserError(
                    f"{where}: channel {i} '{channels[i].name}' of {recording.source} is in"
                    f" {channels[i].unit}; choose {key}"
                )
        return numbers

    def feeder(self, recording: Recording) -> Feeder:
        """The chosen channels, or those of the only load that the file shows."""
        if not (self.voltages or self.currents):
            return self._only(recording)
        name = self.connection or self._usual(recording)
        connection = plugin.build_chosen("connection", name)
        feeder = Feeder(
            self._numbers(recording, "voltages", connection.name, connection.voltages),
            self._numbers(recording, "currents", connection.name, connection.currents),
            connection=name,
            reverse_current=self.reverse_current,
        )
        check_doubt(recording, feeder.channels)
        return arrange_feeder(recording, feeder)

    def _usual(self, recording: Recording) -> Any:
        """The connection that the number of channels says; two voltages to ground say none."""
        counts = len(self.voltages), len(self.currents)
        channels = [
            recording.channels[recording.number(each, "data.voltages")] for each in self.voltages
        ]
        labels = order(channels) if counts[0] == 2 else None
        two = counts[0] == 2 and not (labels and not labels[1])
        return choose_usual_connection(*counts, lines=two) or choose_usual_connection(3, 3)

    def _only(self, recording: Recording) -> Feeder:
        """The only load that the file shows. Raises `UserError` naming all, where
        there is not one.
        """
        proposed = [feeder for feeder in propose(recording) if feeder.loaded]
        if len(proposed) == 1:
            (only,) = proposed
            channels = ", ".join(
                recording.channels[i].name for i in (*only.voltages, *only.currents)
            )
            why = (
                "channels chosen by themselves, for they are the only load in the file:"
                f" {channels}",
                *only.why,
            )
            check_doubt(recording, only.channels)
            reverse = only.reverse_current != self.reverse_current
            return arrange_feeder(recording, replace(only, reverse_current=reverse, why=why))
        if not proposed:
            every = ", ".join(
                f"{i} '{c.name}' [{c.unit}]" for i, c in enumerate(recording.channels)
            )
            noted = (
                f" (noted while reading: {'; '.join(recording.notes)})" if recording.notes else ""
            )
            remedy = (
                f"{DATA.voltages} and {DATA.currents} name one; " if can_be_named(recording) else ""
            )
            raise UserError(
                f"{recording.source} shows no load by itself:"
                f" {explain_unrecognized(recording)}{noted}; {remedy}its channels: {every}"
            )
        loads = "; ".join(
            f"{f.name}: "
            + quoting.shell(
                *(
                    format_assignment(name_setting(f"data.{key}"), value)
                    for key, value in f.settings.items()
                )
            )
            for f in proposed
        )
        asked = "".join(
            f"{question}; " for question in sorted({f.question for f in proposed if f.question})
        )
        raise UserError(
            f"{DATA.voltages} and {DATA.currents} are missing, and {recording.source} shows"
            f" {len(proposed)} loads; {asked}choose one: {loads}"
        )

    def _streams(self, recording: Recording, feeder: Feeder) -> list[Stream]:
        """The phasors and the waves of all that was sampled without a gap.

        Raises `UserError` where no segment is long enough for phasors.
        """
        settings, streams, short = (self.estimator, self.skew, self.harmonics), [], []
        for stretch in recording.stretches():
            parts = []
            several = []
            for segment in stretch:
                try:
                    parts.append(measure_phasors(recording, feeder, segment, *settings))
                except UserError as error:
                    short.append(error)
                    continue
                several.append(self._waves(recording, feeder, segment))
            if parts:
                streams.append((join_phasors(parts), several))
        if not streams:
            raise short[0]
        return streams

    def _waves(self, recording: Recording, feeder: Feeder, segment: Segment) -> Waves:
        """The samples of a load in a segment, read where they are sliced."""
        samples = FeederWaves.from_recording(recording, feeder, segment)
        return Waves(
            samples,
            start=segment.start,
            rate=segment.rate,
            estimator=self.estimator,
            late=samples.late if self.skew else None,
            bridged=samples.bridged_times,
        )

    def _notes(
        self, recording: Recording, feeder: Feeder, dips: Sequence[FileDip]
    ) -> tuple[str, ...]:
        """How phasors were made, how many dips there are, and what recording and feeder say."""
        kind = estimator_of(self.estimator).name.replace("_", "-")
        steps = [dip.result.step for dip in dips if isinstance(dip.result, Record)]
        every = f" every {1000 * steps[0]:.3g} ms" if steps else ""
        notes = [
            f"{kind} phasors{every}, {count_noun(len(dips), 'dip')}",
            *recording.notes,
            *feeder.why,
        ]
        notes += _describe_slow(recording)
        used = (*feeder.voltages, *feeder.currents)
        chosen = [recording.channels[i] for i in used]
        skew = max(abs(channel.skew) for channel in chosen)
        if skew > 0 and not self.skew:
            notes.append(
                f"time skew of up to {1e6 * skew:.3g} microseconds not corrected (data.skew=true"
                " does)"
            )
        notes += filter(
            None, [describe_clipped(recording, measure_clipped_shares(recording, used))]
        )
        return tuple(notes)


def _identify_load(recording: Recording, feeder: Feeder) -> dict[str, str]:
    """Which load it is, as far as the file says."""
    load = feeder.name or find_shared_name([recording.channels[i] for i in feeder.currents])
    fields = {"station": recording.station, "device": recording.device, "load": load}
    for key, numbers in (("voltages", feeder.voltages), ("currents", feeder.currents)):
        fields[key] = ", ".join(recording.channels[i].name.strip() for i in numbers)
    fields["time"] = recording.start.isoformat() if recording.start else ""
    return {key: text for key, text in fields.items() if text}


def _attach_waves(dip: FileDip, waves: Sequence[Waves], frequency: float) -> Record | UserError:
    """The record of a dip with the waves that show it, of several sampling rates."""
    if isinstance(dip.result, UserError) or dip.result.waves is not None:
        return dip.result
    return _show_samples(dip.result, (dip.start, dip.end), waves, frequency)


def _show_samples(
    record: Record, span: tuple[float, float], waves: Iterable[Waves], frequency: float
) -> Record:
    """The record with the first waves that show its dip from well before its start to its end,
    without any where none do.
    """
    start, end = span[0] - BEFORE / frequency, span[1]
    there = (each for each in waves if each.start <= start and end <= each.end)
    return replace(record, waves=next(there, None))


def _load_waveforms(record: Record) -> Record:
    """The record with its own waveforms in memory, and a window's length about them."""
    if record.waves is None:
        return record
    about = BESIDE / record.base.frequency
    return replace(record, waves=record.waves.between(record.t[0] - about, record.t[-1] + about))


def _scale_to_per_unit(record: Record | UserError, base: Base) -> Record | UserError:
    """A record in kV, MW and Mvar on a base and checked, or why it cannot be used."""
    if isinstance(record, UserError):
        return record
    try:
        return replace(
            record, base=base, more=base.per_unit(record.more), **base.per_unit(record.channels)
        ).check()
    except UserError as error:
        return error


def _describe_slow(recording: Recording) -> list[str]:
    """Which segments are too slow for waveforms and are not used; [] where all are used."""
    fast = recording.waveforms()
    slow = [s for s in recording.segments if s not in fast]
    spans = ", ".join(f"{s.rate:g} Hz from {s.start:.3f} s" for s in slow)
    return [f"segments without waveform not used: {spans}"] if slow else []
