"""The logical structure of a PQDIF file: what was observed, channel by channel, each a few series
of values.

A data source defines channels and their series; monitor settings give transformer ratios; an
observation holds instances of channels, whose series are stored as they are, scaled, as counts of
equal steps, or shared with another.

Source: IEEE Std 1159.3-2019 (and -2003), clause on the logical structure; the GUIDs are the
standard's.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tractexp.errors import UserError
from tractexp.filetypes.comtrade_samples import HUGE
from tractexp.filetypes.pqdif_records import Collection, read_records, tag
from tractexp.filetypes.remarks import Remarks
from tractexp.storage import files

SOURCE, OBSERVATION = (
    tag("89738619-f1c3-11cf-9d89-0080c72e70a3"),
    tag("8973861a-f1c3-11cf-9d89-0080c72e70a3"),
)
SETTINGS = tag("b48d858c-f5f5-11cf-9d89-0080c72e70a3")
# of a data source
SOURCE_NAME, CHANNELS = (
    tag("b48d8587-f5f5-11cf-9d89-0080c72e70a3"),
    tag("b48d858d-f5f5-11cf-9d89-0080c72e70a3"),
)
CHANNEL, NUMBER = (
    tag("b48d858e-f5f5-11cf-9d89-0080c72e70a3"),
    tag("b48d858f-f5f5-11cf-9d89-0080c72e70a3"),
)
NAME, PHASE = (
    tag("b48d8590-f5f5-11cf-9d89-0080c72e70a3"),
    tag("b48d8591-f5f5-11cf-9d89-0080c72e70a3"),
)
GROUP, KIND = (
    tag("b48d8594-f5f5-11cf-9d89-0080c72e70a3"),
    tag("b48d8592-f5f5-11cf-9d89-0080c72e70a3"),
)
SERIES_DEFINITIONS = tag("b48d8598-f5f5-11cf-9d89-0080c72e70a3")
SERIES_DEFINITION = tag("b48d859a-f5f5-11cf-9d89-0080c72e70a3")
QUANTITY = tag("c690e872-f755-11cf-9d89-0080c72e70a3")
QUANTITIES = {1: "U", 2: "I", 3: "P"}
UNIT, VALUE = (
    tag("b48d859b-f5f5-11cf-9d89-0080c72e70a3"),
    tag("b48d859c-f5f5-11cf-9d89-0080c72e70a3"),
)
CHARACTERISTIC = tag("3d786f9e-f76e-11cf-9d89-0080c72e70a3")
STORAGE = tag("b48d85a1-f5f5-11cf-9d89-0080c72e70a3")
# of monitor settings
USE_RATIO, CHANNEL_SETTINGS = (tag(f"62f2818{digit}-f9c4-11cf-9d89-0080c72e70a3") for digit in "12")
CHANNEL_SETTING = tag("3d786f9a-f76e-11cf-9d89-0080c72e70a3")
FREQUENCY = tag("0fa118c3-cb4a-11d2-b30b-fe25cb9a1760")
PRIMARY, SECONDARY = (tag(f"62f2818{digit}-f9c4-11cf-9d89-0080c72e70a3") for digit in "ab")
# of an observation
START, TRIGGERED = (tag(f"3d786f8{digit}-f76e-11cf-9d89-0080c72e70a3") for digit in "ce")
INSTANCES, INSTANCE, SERIES, ONE_SERIES = (
    tag(f"3d786f9{n}-f76e-11cf-9d89-0080c72e70a3") for n in range(1, 5)
)
SCALE, OFFSET, VALUES = (tag(f"3d786f9{n}-f76e-11cf-9d89-0080c72e70a3") for n in (6, 7, 9))
SHARED_CHANNEL = tag("8973861f-f1c3-11cf-9d89-0080c72e70a3")
SHARED_SERIES = tag("89738620-f1c3-11cf-9d89-0080c72e70a3")
# kinds of channels, and of the values of series
WAVEFORM, PHASOR, LOG = (tag(f"67f6af8{n}-f753-11cf-9d89-0080c72e70a3") for n in range(3))
TIME = tag("c690e862-f755-11cf-9d89-0080c72e70a3")
SCALED, STEPPED = 2, 4  # bits of how a series is stored
MOMENTS, SECONDS, CYCLES = 1, 2, 3  # units of times
DAY_SECONDS = 86400.0  # s
# Hz, where the file does not say it: most who write PQDIF are in North America
USUAL_FREQUENCY = 60.0
MOST_UNPACKED_VALUES = 30_000_000  # values that are unpacked: a few bytes may stand for many
MOST_STEPPED = 1_000_000  # of which one series of equal steps has, where no other one is as long


@dataclass(frozen=True)
class SeriesDefinition:
    """A series of a channel: what its values are of the quantity, its unit (a number of the
    standard).
    """

    value: bytes
    unit: int
    characteristic: bytes
    storage: int


@dataclass(frozen=True)
class ChannelDefinition:
    """A channel of a data source. `number` tells it from all others of the file."""

    number: int
    name: str
    phase: int
    circuit: str
    quantity: str  # U, I, P; "" of another
    kind: bytes
    series: tuple[SeriesDefinition, ...]


@dataclass(frozen=True, eq=False)
class Instance:
    """A channel's part of an observation: times (N,) [s] since `Observation.start`, and series with
    N values.
    """

    channel: ChannelDefinition
    t: np.ndarray
    series: tuple[tuple[SeriesDefinition, np.ndarray], ...]


@dataclass(frozen=True, eq=False)
class Observation:
    """The channels observed from `start` on, a day since 30 December 1899 and a second of it."""

    start: tuple[int, float]
    triggered: tuple[int, float] | None
    instances: tuple[Instance, ...]


def count_seconds(moment: tuple[int, float], since: tuple[int, float]) -> float:
    """From one moment to another [s]."""
    return DAY_SECONDS * (moment[0] - since[0]) + moment[1] - since[1]


def read_observations(
    path: Path,
    encoding: str | None,
    kinds: Sequence[bytes],
    remarks: Remarks,
    most: float = math.inf,
) -> "PqdifContent":
    """The channels of some kinds, as far as they have times, of the first `most` observations that
    have any.

    Raises `UserError` for what is no PQDIF file, and for a damaged one, with the record.
    """
    files.check_there(path)
    reading = PqdifContent(kinds, remarks)
    for kind, body in read_records(path, encoding, remarks):
        if kind == SOURCE:
            reading.source(body)
        elif kind == SETTINGS:
            reading.settings(body)
        elif kind == OBSERVATION:
            reading.observation(body)
            if len(reading.observations) >= most:
                break
    return reading


class PqdifContent:
    """The content of a file: `observations`, the `station`, and the nominal `frequency` [Hz], 0
    where none is said.

    While the records are read, an observation belongs to the source and the settings before it.
    """

    def __init__(self, kinds: Sequence[bytes], remarks: Remarks) -> None:
        """Nothing observed yet, of quantities of these kinds."""
        self.kinds, self.remarks = kinds, remarks
        self.definitions: list[ChannelDefinition] = []
        self.ratios: dict[int, float] = {}
        self.observations: list[Observation] = []
        self.station, self.frequency, self.count, self.room = "", 0.0, 0, MOST_UNPACKED_VALUES

    def source(self, body: Collection) -> None:
        """Take in a record that defines the channels."""
        name = body.text(SOURCE_NAME)
        channels = body.collection(CHANNELS)
        self.station, self.ratios, self.definitions = self.station or name, {}, []
        for each in channels.collections(CHANNEL) if channels else ():
            listed = each.collection(SERIES_DEFINITIONS)
            series = [
                SeriesDefinition(
                    one.identifier(VALUE),
                    int(one.number(UNIT)),
                    one.identifier(CHARACTERISTIC),
                    int(one.number(STORAGE)),
                )
                for one in (listed.collections(SERIES_DEFINITION) if listed else ())
            ]
            circuit = " ".join(each.texts(GROUP)) or (name if name != self.station else "")
            phase = int(each.number(PHASE))
            kind = each.identifier(KIND)
            quantity = QUANTITIES.get(int(each.number(QUANTITY)), "")
            definition = ChannelDefinition(
                self.count, each.text(NAME), phase, circuit, quantity, kind, tuple(series)
            )
            self.definitions.append(definition)
            self.count += 1

    def settings(self, body: Collection) -> None:
        """Take in a record of settings: the nominal frequency and the ratios of transformers."""
        self.frequency = body.number(FREQUENCY) or self.frequency
        listed, self.ratios = body.collection(CHANNEL_SETTINGS), {}
        if not body.number(USE_RATIO):
            return
        for each in listed.collections(CHANNEL_SETTING) if listed else ():
            primary = each.number(PRIMARY)
            secondary = each.number(SECONDARY)
            if primary > 0 and secondary > 0:
                self.ratios[int(each.number(NUMBER, -1))] = primary / secondary

    def observation(self, body: Collection) -> None:
        """Take in a record of samples."""
        start = body.moment(START)
        listed = body.collection(INSTANCES)
        if start is None or listed is None:
            self.remarks.add(
                f"{_name_record(body)}: an observation without start or channels is not read"
            )
            return
        every = [_Stored(each) for each in listed.collections(INSTANCE)]
        times: dict[tuple[int, SeriesDefinition], np.ndarray | None] = {}
        instances = []
        for one in every:
            if not 0 <= one.number < len(self.definitions):
                raise body.body.describe_damage(
                    f"channel {one.number} is observed, and {len(self.definitions)} are defined"
                )
            channel = self.definitions[one.number]
            if channel.kind in self.kinds and (
                instance := self._instance(channel, one.owners(every), start, times)
            ):
                instances.append(instance)
        if instances:
            self.observations.append(Observation(start, body.moment(TRIGGERED), tuple(instances)))

    def _instance(
        self,
        channel: ChannelDefinition,
        stored: Sequence["_Series"],
        start: tuple[int, float],
        times: dict[tuple[int, SeriesDefinition], np.ndarray | None],
    ) -> Instance | None:
        """One channel of an observation; None where it has no times. `times` are those of the
        channels before.
        """
        pairs = [*zip(channel.series, stored, strict=False)]
        longest = max((one.length for d, one in pairs if not d.storage & STEPPED), default=0)
        clock = next(((d, one) for d, one in pairs if d.value == TIME), None)
        if clock is None:
            return None
        key = (clock[1].owner.at, clock[0])
        if key not in times:
            times[key] = self._times(*clock, start, longest)
        t = times[key]
        if t is None:
            return None
        series = self._sampled_series(channel, pairs, len(t), longest)
        return Instance(channel, t, tuple(series)) if series else None

    def _sampled_series(
        self,
        channel: ChannelDefinition,
        pairs: Sequence[tuple[SeriesDefinition, "_Series"]],
        count: int,
        longest: int,
    ) -> list[tuple[SeriesDefinition, np.ndarray]]:
        """The series of a channel but its times, with their primary values (count,); others are
        passed over with a remark.
        """
        ratio = self.ratios.get(channel.number - self.definitions[0].number, 1.0)
        series = []
        for definition, one in pairs:
            values = None if definition.value == TIME else self._values(definition, one, longest)
            if values is None:
                continue
            if len(values) == count:
                series.append((definition, values * ratio))
                continue
            counts = f"{len(values)} values at {count} times"
            self.remarks.add(f"{_name_record(one.own)}: {channel.name} has {counts}: not read")
        return series

    def _times(
        self, definition: SeriesDefinition, one: "_Series", start: tuple[int, float], longest: int
    ) -> np.ndarray | None:
        """Times (N,) [s] since the start of the observation; None where they are in no unit of
        time.
        """
        raw = one.raw
        if raw is not None and raw.dtype.names:
            self._take(one, len(raw))
            with np.errstate(all="ignore"):
                return (
                    DAY_SECONDS * (raw["day"].astype(float) - start[0]) + raw["second"] - start[1]
                )
        values = self._values(definition, one, longest)
        if values is None or definition.unit not in (SECONDS, CYCLES):
            return None
        if definition.unit == SECONDS:
            return values
        nominal = self.frequency or USUAL_FREQUENCY
        self.remarks.add(f"times are in cycles, taken of {nominal:g} Hz")
        return values / nominal

    def _values(
        self, definition: SeriesDefinition, one: "_Series", longest: int
    ) -> np.ndarray | None:
        """The values (N,) of a series in its unit; None where they are no real numbers."""
        raw = one.raw
        if raw is None or raw.dtype.kind not in "uif":
            return None
        with np.errstate(all="ignore"):
            if definition.storage & STEPPED:
                values = self._expand_steps(
                    one, raw.astype(float) if len(raw) <= longest + MOST_STEPPED else raw, longest
                )
            else:
                self._take(one, len(raw))
                values = raw.astype(float)
            if definition.storage & SCALED:
                values = values * one.number(SCALE, 1.0) + one.number(OFFSET, 0.0)
            if (np.abs(values) > HUGE).any():
                raise one.own.body.describe_damage(f"a series has a value beyond {HUGE:g}")
        return values

    def _expand_steps(self, one: "_Series", raw: np.ndarray, longest: int) -> np.ndarray:
        """Values of [runs, count, step, count, step, ...]: each run goes on from the one before."""
        runs = int(raw[0]) if len(raw) and 0 <= raw[0] <= len(raw) / 2 else -1
        counts = raw[1 : 1 + 2 * max(runs, 0) : 2]
        steps = raw[2 : 2 + 2 * max(runs, 0) : 2]
        if runs < 0 or len(steps) < runs or not np.isfinite(raw).all() or (counts < 0).any():
            raise one.own.body.describe_damage(
                "a series of equal steps does not say how many there are of each"
            )
        if (total := float(counts.sum())) > max(longest, MOST_STEPPED):
            raise one.own.body.describe_damage(
                f"a series of equal steps has {total:.0f} of them, for {longest} values"
            )
        self._take(one, total)
        rises = np.repeat(steps, counts.astype(int))
        return np.concatenate([[0.0], np.cumsum(rises)[:-1]]) if len(rises) else rises

    def _take(self, one: "_Series", count: float) -> None:
        """Count values that are unpacked. Raises `UserError` where a small file stands for too
        many.
        """
        self.room -= count
        if self.room < 0:
            raise UserError(
                f"{one.own.body.where}: the file's series stand for more than"
                f" {MOST_UNPACKED_VALUES:,} values; give a part of it, or the event that is meant,"
                " exported by the recorder's software"
            )


@dataclass(frozen=True, eq=False)
class _Series:
    """A series as it is stored; `owner` is the one whose values it shares, else itself."""

    own: Collection
    owner: Collection

    @property
    def raw(self) -> np.ndarray | None:
        """The stored values; None where there are none."""
        return self.owner.vector(VALUES)

    @property
    def length(self) -> int:
        """How many values are stored."""
        raw = self.raw
        return 0 if raw is None else len(raw)

    def number(self, name: bytes, default: float) -> float:
        """Its own scale or offset, else that of the owner."""
        return self.own.number(name, self.owner.number(name, default))


class _Stored:
    """An instance of a channel as it is stored."""

    def __init__(self, instance: Collection) -> None:
        """A channel's number and its series, as an observation stores them."""
        listed = instance.collection(SERIES)
        self.number = int(instance.number(NUMBER, -1))
        self.series = list(listed.collections(ONE_SERIES)) if listed else []

    def owners(self, every: Sequence["_Stored"]) -> list[_Series]:
        """Each series with the one whose values it has."""
        pairs = []
        for own in self.series:
            channel, series = (
                int(own.number(SHARED_CHANNEL, -1)),
                int(own.number(SHARED_SERIES, -1)),
            )
            shared = 0 <= channel < len(every) and 0 <= series < len(every[channel].series)
            pairs.append(_Series(own, every[channel].series[series] if shared else own))
        return pairs


def _name_record(body: Collection) -> str:
    """Which record of the file it is, for remarks."""
    return body.body.where.rpartition(": ")[2]
