"""What a file holds, without any setting: its loads, the events of each, and what can be fitted."""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any

import numpy as np

from tractexp.configuration.plugin import build
from tractexp.errors import UserError
from tractexp.record import Record, find_dips
from tractexp.record.dips import FileDip, check_load
from tractexp.record.phasor import Phasors, join_phasors
from tractexp.recording.arrangement import arrange_feeder
from tractexp.recording.event_kind import find_dead_phases
from tractexp.recording.event_number import number_events
from tractexp.recording.feeder import Feeder
from tractexp.recording.happening import (
    FEWEST_HALF_CYCLES,
    find_happenings,
    find_happenings_of_record,
)
from tractexp.recording.infeed import describe_directions
from tractexp.recording.measure import FeederWaves, measure_phasors
from tractexp.recording.proposal import list_buses_alone, propose
from tractexp.recording.quality import Quality, assess_quality, measure_stamp_jitter
from tractexp.recording.reader import WaveformReader
from tractexp.recording.recording import Recording, Segment
from tractexp.recording.sight import Sight
from tractexp.recording.snapshot import measure_network_frequency
from tractexp.recording.trace import Trace, join_traces, trace_waves
from tractexp.recording.type_test import MotorCourse, TypeTest, find_type_test
from tractexp.recording.unit import check_doubt, is_secondary, is_unit_in_doubt

TOO_SHORT = "fewer than four half cycles are measured: too few to tell what happened"
LEAST_MEASURED_VOLTAGE = 0.5  # of the greatest voltage: at less the frequency is not measured
LONGEST_UNSEEN = 0.1  # s of samples too slow for waveforms of which nothing is said


@dataclass(frozen=True)
class _Bus:
    """Tracked frequencies and phasors of the voltages that the loads of one bus share, by
    segment.
    """

    tracked: dict[Segment, dict[int, np.ndarray]] = field(default_factory=dict)
    phasors: dict[Segment, Phasors] = field(default_factory=dict)

    def measure(self, recording: Recording, feeder: Feeder, segment: Segment) -> Phasors:
        """The phasors of a load."""
        measured = measure_phasors(
            recording, feeder, segment, tracked=self.tracked.setdefault(segment, {})
        )
        first = self.phasors.setdefault(segment, measured)
        return replace(measured, t=first.t, V=first.V, f=first.f)


@dataclass(frozen=True, eq=False)
class View:
    """One file as it was looked at. `recording` is None for a table that is a record already."""

    source: str  # the path, or the name of a record
    node: Mapping[str, Any]  # the choice of `data` that reads it; {} for a record
    sights: Sequence[Sight]
    recording: Recording | None = None
    # that files beside it are of the same event, with the command; "" where none are
    proposed: str = ""

    @property
    def begun(self) -> datetime | None:
        """The moment of t = 0, where the file says it."""
        if self.recording is not None:
            return self.recording.start
        said = (
            shown.record.identity.get("time") for shown in self.sights if shown.record is not None
        )
        return next((datetime.fromisoformat(moment) for moment in said if moment), None)

    @functools.cached_property
    def quality(self) -> list[Quality]:
        """The quality of each channel."""
        recording = self.recording
        if recording is None:
            return []
        segment = max(recording.segments, key=lambda s: s.rate)
        stamps = measure_stamp_jitter(recording, segment)
        f = measure_network_frequency(recording)
        return [
            assess_quality(recording, k, segment, stamps, f) for k in range(len(recording.channels))
        ]

    @functools.cached_property
    def operations(self) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """Status channels that change (trips, breakers), first change first: name, times [s], state
        from each on.
        """
        if self.recording is None:
            return []
        t = np.concatenate([segment.t for segment in self.recording.segments])
        courses = []
        for channel in self.recording.status:
            states = channel.values()[: len(t)]
            changes = np.flatnonzero(np.diff(states.astype(np.int8))) + 1
            if len(changes):
                at = np.concatenate([[0], changes, [len(states) - 1]])
                courses.append((channel.name, t[at], states[at].astype(int)))
        return sorted(courses, key=lambda course: course[1][1])

    def powers(self, shown: Sight) -> tuple[float, float, float] | None:
        """As `Sight.powers`, with the voltage that all loads of a bus have: that of the first that
        can be fitted.

        Where none can, it is that of the first with events: only they tell what was before anything
        happened.
        """
        own = shown.powers()
        if shown.feeder is None or own is None:
            return own
        bus = [s for s in self.sights if s.terminals == shown.terminals]
        fitted = [s for s in bus if s.dips]
        eventful = [s for s in bus if s.events]
        telling = [*fitted, *eventful, *bus][0].powers()
        return own if telling is None else (telling[0], *own[1:])

    @property
    def frequency(self) -> float | None:
        """Measured [Hz] while the voltage of the first load is alive; None where nothing turns."""
        for shown in self.sights:
            source = shown.phasors[0] if shown.phasors else shown.record
            if source is not None and source.f is not None:
                return float(
                    np.median(source.f[LEAST_MEASURED_VOLTAGE * source.U.max() <= source.U])
                )
        return None


def view_of(source: str, node: Mapping[str, Any]) -> View:
    """One file, looked at by the reader that `node` chooses. Raises `UserError` where it cannot be
    read.
    """
    reader = build("data", node)
    if not isinstance(reader, WaveformReader):
        try:
            table = reader.table()
        except UserError as error:
            alone = reader.read_voltage()
            if alone is None:
                raise
            shown = overview_record(alone, [])
            return View(source, node, [replace(shown, said=(*shown.said, str(error)))])
        if table is not None:
            return View(source, node, [overview_record(*table)])
        read = reader.read()
        return View(
            source, node, [overview_record(record) for record in (*read.train, *read.validate)]
        )
    recording = reader.open_recording()
    if reader.voltages or reader.currents:
        return View(
            source, node, [describe_load(reader, recording, reader.feeder(recording))], recording
        )
    return View(source, node, describe_loads(reader, recording), recording)


def _arrange_currents(
    recording: Recording, feeder: Feeder, is_examined: bool
) -> tuple[Feeder, tuple[str, ...]]:
    """A feeder with its currents in order, where it `is_examined`; and why that cannot be, at most
    one sentence.
    """
    try:
        check_doubt(recording, feeder.channels)
        return (arrange_feeder(recording, feeder) if is_examined else feeder), ()
    except UserError as error:
        return feeder, (str(error),)


def describe_loads(reader: WaveformReader, recording: Recording) -> list[Sight]:
    """The loads of a recording as they are proposed, each with what happened to it; `reader` is
    that of its file.
    """
    feeders = [
        replace(feeder, reverse_current=feeder.reverse_current != reader.reverse_current)
        for feeder in propose(recording)
    ]
    if not feeders:
        return [describe_load(reader, recording, bus) for bus in list_buses_alone(recording)]
    loaded = any(feeder.loaded for feeder in feeders)
    sights = []
    buses = dict[str, _Bus]()
    for proposed in feeders:
        feeder, said = _arrange_currents(recording, proposed, proposed.loaded or not loaded)
        bus = buses.setdefault(str((feeder.voltages, feeder.connection)), _Bus())
        shown = describe_load(reader, recording, feeder, feeder.loaded or not loaded, bus)
        shown = replace(shown, said=(*said, *shown.said))
        sights.append(_refuse_events(shown, said[0]) if said else shown)
    return describe_directions(sights)


def _refuse_events(shown: Sight, reason: str) -> Sight:
    """The view of a load whose channels make no sense: each event says that it gives no record, and
    why.
    """
    events = (
        replace(each, event=None, why=f"it gives no record: {reason}") if each.worth else each
        for each in shown.events
    )
    return replace(shown, events=tuple(events))


def _find_doubt(recording: Recording, feeder: Feeder) -> str:
    """Why the units of a load's voltages and currents are not known; "" where they are."""
    channels = (recording.channels[i] for i in (*feeder.voltages, *feeder.currents))
    if not (feeder.currents and any(map(is_unit_in_doubt, channels))):
        return ""
    try:
        check_doubt(recording, feeder.channels)
    except UserError as error:
        return str(error)
    return ""


def _measure_stretch(
    recording: Recording, feeder: Feeder, stretch: Sequence[Segment], events: bool, bus: _Bus
) -> tuple[list[Phasors], Trace | None, list[str]]:
    """The phasors of a stretch without gaps, at most one; its trace, where `events` are sought; and
    why segments could not be measured.
    """
    parts, traces, said = [], [], []
    for segment in stretch:
        try:
            measured = bus.measure(recording, feeder, segment)
        except UserError as error:
            said.append(str(error))
            continue
        parts.append(measured)
        if events:
            waves = FeederWaves.from_recording(recording, feeder, segment)
            trace = trace_waves(waves, segment.rate, segment.start, recording.frequency, measured)
            traces.append(trace if feeder.currents else trace.without_currents())
    return [join_phasors(parts)] if parts else [], join_traces(traces) if traces else None, said


def _find_trigger(recording: Recording, trace: Trace) -> float | None:
    """When the recorder was triggered first within a trace [s]; None where it was not."""
    within = (x for x in recording.find_triggers() if trace.t[0] <= x <= trace.t[-1])
    return next(within, None)


def _cut_dips(
    reader: WaveformReader, recording: Recording, feeder: Feeder, phasors: Sequence[Phasors]
) -> tuple[list[FileDip], str]:
    """The dips that the reader cuts out of a recording for a load, and why it cuts none."""
    streams = [(p, ()) for p in phasors]
    try:
        return reader.dips(feeder, streams, recording.frequency, recording.find_triggers()), ""
    except UserError as error:
        return [], str(error)


def describe_load(
    reader: WaveformReader,
    recording: Recording,
    feeder: Feeder,
    events: bool = True,
    bus: _Bus | None = None,
) -> Sight:
    """The view of one load of a recording. What cannot be analysed is noted in `said`, and raises
    nothing.

    Without `events` no event is sought: beside loaded feeders, an unloaded one shows noise only.
    What loads of the same `bus` share is measured once.
    """
    bus = bus or _Bus()
    settings = {**feeder.settings, "reverse_current": feeder.reverse_current}
    blank = Sight(feeder.name or "load", feeder=feeder, settings=settings)
    if doubt := _find_doubt(recording, feeder):
        return replace(blank, unexamined=doubt)  # no kV, no MW
    try:
        stretches = recording.stretches()
    except UserError as error:
        return replace(blank, unexamined=str(error), said=(str(error),))
    phasors, changes, said, dead, brief = [], [], [], list[int](), list[bool]()
    for stretch in stretches:
        measured, trace, refusals = _measure_stretch(recording, feeder, stretch, events, bus)
        phasors += measured
        said += refusals
        if trace is not None:
            changes += find_happenings(trace, _find_trigger(recording, trace))
            dead = dead or find_dead_phases(trace)
            brief.append(len(trace.t) < FEWEST_HALF_CYCLES)
    dips, refused = [], ""
    if changes and feeder.currents:
        dips, refused = _cut_dips(reader, recording, feeder, phasors)
    numbered = number_events(changes, dips, reader.path, refused)
    said += [TOO_SHORT] if brief and all(brief) else []
    unexamined = "; ".join(said) if not phasors or TOO_SHORT in said else ""
    if slow := _describe_slow_segments(recording) if events and phasors else "":
        unexamined = unexamined or ("" if changes else f"{slow}; the rest shows nothing")
        feeder = replace(feeder, why=(*feeder.why, f"{slow}: not examined"))
    secondary = is_secondary(recording, feeder.channels)
    shown = replace(
        blank,
        feeder=feeder,
        phasors=tuple(phasors),
        events=tuple(numbered),
        said=tuple(said),
        unexamined=unexamined,
        secondary=secondary,
        dead_phases=" and ".join("abc"[k] for k in dead),
        type_test=_find_type_test(phasors, recording.frequency) if feeder.currents else None,
    )
    return replace(shown, said=(*said, *_explain_improbable(reader.path, shown)))


def _find_type_test(phasors: Sequence[Phasors], nominal: float) -> TypeTest | None:
    """The first type test that a stretch of a load shows."""
    courses = (MotorCourse.from_phasors(each, nominal) for each in phasors if len(each.V) == 3)
    found = (find_type_test(each, nominal) for each in courses)
    return next((each for each in found if each is not None), None)


def _describe_slow_segments(recording: Recording) -> str:
    """Which parts of a recording are sampled too slowly for waveforms; "" where they are short."""
    fast = recording.waveforms()
    slow = [(s, (s.stop - s.first) / s.rate) for s in recording.segments if s not in fast]
    return "; ".join(
        f"{seconds:.3g} s from {s.start:.3f} s on at {s.rate:g} Hz hold no waveforms"
        for s, seconds in slow
        if seconds > LONGEST_UNSEEN
    )


def _explain_improbable(where: str, shown: Sight) -> list[str]:
    """A sentence on a load that no network feeds; [] for others."""
    try:
        known = shown.feeder is not None and shown.feeder.loaded and not shown.secondary
        if known and (load := shown.powers()) is not None:
            check_load(where, load[0], float(np.hypot(*load[1:])))
    except UserError as error:
        return [str(error)]
    return []


def overview_record(record: Record, dips: Sequence[FileDip] | None = None) -> Sight:
    """The load of a record, looked at; `dips` are those that a reader makes of it.

    Without them the record is what would be fitted, and its dips have no numbers.
    """
    power = record.base.power
    changes = [
        replace(
            what,
            before=(power * what.before[0], power * what.before[1]),
            after=(power * what.after[0], power * what.after[1]),
        )
        for what in find_happenings_of_record(record)
    ]
    numbered = list(
        number_events(changes, _list_own_dips(record) if dips is None else dips, record.source)
    )
    if dips is None:
        numbered = [replace(each, dip=None) for each in numbered]
    course = MotorCourse.from_record(record)
    tested = course and find_type_test(course, record.base.frequency)
    return Sight(record.name, tuple(numbered), record=record, type_test=tested)


def _list_own_dips(record: Record) -> list[FileDip]:
    """The dips of a record that is fitted as it is: its first is the one that is meant."""
    later, t = (
        UserError("another dip of the record comes first, and is the one that is fitted"),
        record.t,
    )
    return [
        FileDip(
            number,
            float(t[a]),
            float(t[min(b, record.samples - 1)]),
            record if number == 1 else later,
        )
        for number, (a, b) in enumerate(find_dips(t, record.U), 1)
    ]
