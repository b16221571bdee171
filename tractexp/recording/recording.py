"""A file as its instrument recorded it: channels, sampling rates, times; primary values on demand.

Readers of files make a `Recording` and nothing else; which channels make up a load, and its events,
follow from it (`feeder`, `happening`), whatever the format was.
"""

import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import numpy as np

from tractexp.errors import UserError, name_setting, suggest_nearest

# {unit as files write it, in lower case: (quantity, factor to the unit used inside: kV, kA)}
UNITS: Mapping[str, tuple[str, float]] = {
    f"{prefix}{name}": (quantity, factor)
    for quantity, units in {
        "voltage": {
            "v": "",
            "volt": "kilo milli",
            "volts": "kilo milli",
            "вольт": "кило милли",
            "伏": "千 毫",
        },
        "current": {
            "a": "",
            "amp": "kilo milli",
            "amps": "kilo milli",
            "ampere": "kilo milli",
            "amperes": "kilo milli",
            "ампер": "кило милли",
            "安": "千 毫",
        },
    }.items()
    for name, prefixes in units.items()
    for prefix, factor in zip(
        ["", *(prefixes.split() or ("k", "m"))], (1e-3, 1.0, 1e-6), strict=True
    )
}
MEGA = {"MV": ("voltage", 1e3), "MA": ("current", 1e3)}  # which small letters would make milli
CYRILLIC = str.maketrans("вВаАкКмМ", "vVaAkKmM")  # кВ, А
UNBROKEN = 1.0  # cycle: a shorter hole between two sampling rates leaves one record
FEWEST_PER_CYCLE = 10  # samples: a slower segment holds no waveform but magnitudes

NOTHING_BRIDGED = (np.empty(0, dtype=int), np.empty(0))


def find_unit(text: str) -> tuple[str, float]:
    """The quantity of a unit and its size in kV, kA, ...

    Parameters
    ----------
    text : str
        As a file writes it: "V", "[kA]", "кВ", "kV rms".

    Returns
    -------
    (str, float)
        The quantity and the factor to kV or kA; ("", 1.0) for another unit.

    Examples
    --------
    >>> find_unit("[V]"), find_unit("kA"), find_unit("MW")
    (('voltage', 0.001), ('current', 1.0), ('', 1.0))
    """
    text = unicodedata.normalize("NFKC", text).strip(" .")
    text = text[1:-1].strip() if (text[:1], text[-1:]) in (("[", "]"), ("(", ")")) else text
    text = re.sub(r"(?<=[VA]) ?(?:rms|RMS|eff)$", "", text)
    latin = text.translate(CYRILLIC)
    return MEGA.get(latin) or UNITS.get(text.lower()) or UNITS.get(latin.lower(), ("", 1.0))


def find_quantity(text: str) -> str:
    """The quantity of a unit as a file writes it, also of several, where the size stays open.

    Examples
    --------
    >>> find_quantity("V/kV"), find_quantity("V/A")
    ('voltage', '')
    """
    quantities = {find_unit(part)[0] for part in re.split(r"[/|;]", text)}
    return quantities.pop() if len(quantities) == 1 else ""


@dataclass(frozen=True)
class Segment:
    """A stretch of samples of one rate.

    Attributes
    ----------
    first, stop : int
        Sample numbers, from `first` up to but not including `stop`.
    rate : float [Hz]
        Of the samples.
    start : float [s]
        Time of the first.

    Examples
    --------
    >>> Segment(0, 4, 1000.0, 0.5).t.tolist()
    [0.5, 0.501, 0.502, 0.503]
    >>> Segment(0, 1000, 1000.0, 0.0).between(0.2, 0.3).first
    200
    """

    first: int
    stop: int
    rate: float  # Hz
    start: float  # s since the file's first sample

    @property
    def t(self) -> np.ndarray:
        """Times of the samples (M,) [s]."""
        return self.start + np.arange(self.stop - self.first) / self.rate

    def between(self, start: float, end: float) -> "Segment":
        """A part of it.

        Parameters
        ----------
        start, end : float [s]
            The part is from `start` up to, but not including, `end`.

        Returns
        -------
        Segment
            Without samples where they lie outside.
        """
        first, stop = (
            min(max(int(np.ceil((t - self.start) * self.rate - 1e-6)), 0), self.stop - self.first)
            for t in (start, end)
        )
        return Segment(
            self.first + first, self.first + stop, self.rate, self.start + first / self.rate
        )


@dataclass(frozen=True, eq=False)
class Channel:
    """One measured quantity: value = gain raw + offset in `unit`, times `ratio` on the primary
    side.

    Ten minutes of waveforms are held once, as the file's integers.

    Attributes
    ----------
    name : str
        As the file has it.
    raw : (N,)
        As the file stores it, a view where possible.
    unit : str
        Of the values, "" where it is not known.
    quantity, phase, circuit : str
        What is measured, and where, as far as is known.
    gain, offset : float
        From raw values to the unit.
    ratio : float
        From the values recorded to primary ones.
    skew : float [s]
        How much later than its time stamp it is sampled.
    limits : (float, float) or None
        The least and the greatest raw value that the file declares.
    missing : float or None
        The raw value that stands for none.
    side : str
        P or S, primary or secondary, as the file says.
    form : str
        "waveform", or what else its values are.
    bridged : (samples, values)
        What stands in place of short gaps.
    """

    name: str
    raw: np.ndarray
    unit: str = ""  # as the file writes it
    # voltage, current, power, reactive_power, frequency, angle; "" for anything else
    quantity: str = ""
    phase: str = ""  # as the file labels it: A, L1, AB, N, ...
    circuit: str = ""  # what it is measured on, as the file says
    gain: float = 1.0
    offset: float = 0.0
    ratio: float = 1.0  # primary over what is recorded; 1 where primary values are recorded
    skew: float = 0.0  # s that a sample is taken later than its time stamp
    limits: tuple[float, float] | None = None  # least and greatest raw value of the converter
    missing: float | None = None  # the raw value that stands for none; nan always does
    # S: secondary values whose ratio the file does not give; ?: the file cannot say which they are
    side: str = ""
    form: str = "waveform"  # or magnitude (RMS), peak, angle, value: samples that are no waveform
    # numbers (K,) of missing samples, and what is put there, in `unit`
    bridged: tuple[np.ndarray, np.ndarray] = NOTHING_BRIDGED

    def values(self, first: int = 0, stop: int | None = None) -> np.ndarray:
        """Primary values (M,) in kV, kA, MW, Mvar, Hz or rad (another quantity in its own unit);
        nan where missing.
        """
        primary = self.read_values(first, stop)
        primary *= self.ratio * self.factor
        return primary

    def read_values(self, first: int = 0, stop: int | None = None) -> np.ndarray:
        """Values (M,) in `unit`, on the side that was recorded; nan where missing."""
        raw = self.raw[first:stop]
        with np.errstate(invalid="ignore"):  # a damaged float may be a signalling nan
            values = raw.astype(np.float64)
        values *= self.gain
        values += self.offset
        if self.missing is not None:
            values[raw == self.missing] = np.nan
        at, estimates = self.bridged
        if len(at):
            begin, end, _ = slice(first, stop).indices(len(self.raw))
            inside = (begin <= at) & (at < end)
            values[at[inside] - begin] = estimates[inside]
        return values

    recorded = read_values  # its name in version 0.2

    @property
    def factor(self) -> float:
        """From the file's unit to the one used inside; 1 where it is not known."""
        return find_unit(self.unit)[1]


@dataclass(frozen=True, eq=False)
class StatusChannel:
    """One binary channel: contacts, trips, breaker positions.

    Attributes
    ----------
    name : str
        As the file has it.
    raw : (N,)
        0 or 1, or words of which one bit is meant: a hundred channels share the file's few words.
    phase, circuit : str
        Where it is, as far as the file says.
    normal : int
        Its normal state, 0 or 1.
    bit : int or None
        The bit of the words.
    """

    name: str
    raw: np.ndarray
    phase: str = ""
    circuit: str = ""
    normal: int = 0
    bit: int | None = None

    def values(self, first: int = 0, stop: int | None = None) -> np.ndarray:
        """States (M,), 0 or 1."""
        raw = np.asarray(self.raw[first:stop])
        return (
            (raw != 0).astype(np.uint8)
            if self.bit is None
            else ((raw >> self.bit) & 1).astype(np.uint8)
        )


@dataclass(frozen=True, eq=False)
class Recording:
    """The channels of one file: waveforms, states, marks and where they are from.

    Channels have equal lengths; each segment of them is sampled uniformly.

    Attributes
    ----------
    source : str
        The file.
    channels : sequence of Channel
        All that were recorded.
    segments : sequence of Segment
        In order of time.
    frequency : float [Hz]
        Nominal, of the network.
    station, device : str
        "" where the file does not say.
    start : datetime or None
        Moment of the first sample.
    trigger : float or None [s]
        When the recorder was triggered, after the first sample.
    status : sequence of StatusChannel
        Binary channels.
    notes : sequence of str
        What was odd in the file, a sentence each.
    extra : mapping
        Fields of the file that have no attribute here, to be written again.
    triggers : sequence of float [s]
        All triggers, where there are several.
    """

    source: str  # the path, as messages name it
    channels: Sequence[Channel]
    segments: Sequence[Segment]
    frequency: float = 50.0  # Hz, nominal, as the file declares it
    station: str = ""
    device: str = ""
    start: datetime | None = None  # of the first sample
    trigger: float | None = None  # s since the first sample
    status: Sequence[StatusChannel] = ()
    notes: Sequence[str] = ()  # what was mended while reading, with the line
    # what the format has besides, for a round trip
    extra: Mapping[str, Any] = field(default_factory=dict)
    triggers: Sequence[float] = ()  # of all parts, where several were triggered

    @property
    def samples(self) -> int:
        """The number of samples of each channel."""
        return len(self.channels[0].raw)

    def waveforms(self) -> list[Segment]:
        """The segments sampled fast enough to hold a waveform; raises `UserError` when there is
        none.
        """
        fast = [s for s in self.segments if s.rate >= FEWEST_PER_CYCLE * self.frequency]
        if not fast:
            rates = ", ".join(f"{s.rate:g} Hz" for s in self.segments)
            raise UserError(
                f"{self.source}: sampled at {rates}: no waveform, for which {FEWEST_PER_CYCLE}"
                f" samples per cycle of {self.frequency:g} Hz are needed"
            )
        return fast

    def find_triggers(self) -> list[float]:
        """The moments [s since the first sample] at which the recorder was triggered."""
        if self.triggers or self.trigger is None:
            return [*self.triggers]
        return [self.trigger]

    def stretches(self) -> list[list[Segment]]:
        """The segments of `waveforms`, those that follow each other without a gap together."""
        together: list[list[Segment]] = []
        for segment in self.waveforms():
            last = together[-1][-1] if together else None
            end = None if last is None else last.start + (last.stop - last.first) / last.rate
            if end is not None and abs(segment.start - end) < UNBROKEN / self.frequency:
                together[-1].append(segment)
            else:
                together.append([segment])
        return together

    def number(self, each: int | str, where: str) -> int:
        """A channel's number, from 0, from its number or name; `where` is the setting
        in messages.
        """
        names = [channel.name.strip() for channel in self.channels]
        if isinstance(each, int) and not isinstance(each, bool):
            if not 0 <= each < len(names):
                extent = f"which has {len(names)}, counted from 0"
                raise UserError(
                    f"{name_setting(where)}: there is no channel {each} in {self.source}, {extent}"
                )
            return each
        if str(each) not in names:
            other = {"data.voltages": "current", "data.currents": "voltage"}.get(where)
            fitting = [
                name for name, c in zip(names, self.channels, strict=True) if c.quantity != other
            ]
            lack = (
                f"{self.source} has no analog channel '{each}'{suggest_nearest(str(each), fitting)}"
            )
            raise UserError(f"{name_setting(where)}: {lack}")
        if names.count(str(each)) > 1:
            raise UserError(
                f"{name_setting(where)}: {self.source} has several channels '{each}';"
                " give the number, from 0"
            )
        return names.index(str(each))

    def matrix(self, numbers: Sequence[int], segment: Segment) -> np.ndarray:
        """The primary values of some channels within a segment.

        Parameters
        ----------
        numbers : K ints
            Of the channels, from 0.
        segment : Segment
            With M samples.

        Returns
        -------
        (K, M) array
            In kV, kA, MW, Mvar, Hz or rad.

        Raises
        ------
        UserError
            Where a value is missing.
        """
        rows = np.empty((len(numbers), segment.stop - segment.first))
        for row, number in zip(rows, numbers, strict=True):
            row[:] = self.channels[number].values(segment.first, segment.stop)
            if not np.isfinite(row).all():
                i = segment.first + int(np.argmin(np.isfinite(row)))
                name = self.channels[number].name
                raise UserError(
                    f"{self.source}: channel {number} '{name}' has no value at sample {i + 1}"
                )
        return rows
