"""The configuration (.cfg) of a COMTRADE record, read line by line and checked before any data is
read.

Source: IEEE C37.111-1991, -1999 and -2013. Harmless departures are mended and noted with their
line.
"""

import functools
import re
from collections import deque
from dataclasses import dataclass, field
from datetime import datetime, timedelta

from tractexp.errors import UserError
from tractexp.filetypes.comtrade_fields import date, number, quote_field
from tractexp.filetypes.remarks import Remarks
from tractexp.recording.recording import unit_of
from tractexp.text.wording import count_noun

VALUE = {"ASCII": "f8", "BINARY": "<i2", "BINARY32": "<i4", "FLOAT32": "<f4"}  # of one analog value
FREQUENCY = (10.0, 100.0)  # Hz, nominal: 16.7 and 25 Hz railways to 60 Hz, with room
# Hz, as a third of 50 is written
_SIXTEEN = re.compile(r"^\s*(?:16[ +]2/3|50/3|16,(?:7|67|667|6667))(?!\d)")
MOST_RATES = 10  # sampling rates of one file, where their number stands for the nominal frequency
GREATEST = 1e12  # of a multiplier, an offset or a ratio: beyond it no unit makes sense
EPOCH = datetime(1970, 1, 1)  # a clock that was not set
_COUNTS = re.compile(
    r"(\d{1,12})\s*,\s*(\d{1,12})\s*([AD])\s*,\s*(\d{1,12})\s*([AD])\s*,?", re.ASCII | re.IGNORECASE
)


@dataclass(frozen=True)
class Analog:
    """An analog channel's line."""

    name: str
    phase: str
    circuit: str
    unit: str
    gain: float
    offset: float
    skew: float  # microseconds
    limits: tuple[float, float] | None
    primary: float = 1.0
    secondary: float = 1.0
    side: str = ""  # P, S, or "" where the file does not say (1991)

    @property
    def ratio(self) -> float:
        """From the values recorded to primary ones."""
        return self.primary / self.secondary if self.side == "S" else 1.0


@dataclass(frozen=True)
class Digital:
    """A status channel's line."""

    name: str
    phase: str
    circuit: str
    normal: int


@dataclass
class Header:
    """All that the configuration says."""

    station: str = ""
    device: str = ""
    revision: int = 1991
    analogs: list[Analog] = field(default_factory=list)
    digitals: list[Digital] = field(default_factory=list)
    frequency: float = 50.0
    # (Hz, last sample from 1); 0 Hz: see the time stamps
    rates: list[tuple[float, int]] = field(default_factory=list)
    dates: tuple[str, str] = ("", "")  # of the first sample and the trigger, as written
    start: datetime | None = None
    trigger: float | None = None  # s since the first sample
    kind: str = "ASCII"
    timemult: float = 1.0
    time_code: str = ""  # lines of 2013, as written
    quality: str = ""
    lines: dict[str, int] = field(default_factory=dict)  # where things stand, for messages

    @property
    def samples(self) -> int:
        """How many samples the file holds, by its last rate."""
        return self.rates[-1][1]


class _Lines:
    """The remaining lines, with their numbers."""

    def __init__(self, where: str, lines: list[str], remarks: Remarks, first: int) -> None:
        """The lines of a configuration, numbered from `first`; blank ones are passed over with a
        remark.
        """
        self.where, self.remarks = where, remarks
        lines = lines[: max((n for n, line in enumerate(lines, 1) if line), default=0)]
        self.rest = deque((n, line) for n, line in enumerate(lines, first) if line)
        self.last = first + len(lines) - 1
        for n, line in enumerate(lines, first):
            if not line:
                remarks.add("a blank line is passed over", n)

    def take(self, what: str) -> tuple[int, str]:
        """The next line with its number. Raises `UserError` with `what` was to come where there is
        none.
        """
        if not self.rest:
            raise UserError(
                f"{self.where}: ends after line {self.last}, before {what}; the file is cut short"
            )
        return self.rest.popleft()

    def peek(self) -> str:
        """The next line without taking it; "" at the end."""
        return self.rest[0][1] if self.rest else ""

    def refuse(self, line: int, words: str) -> UserError:
        """The error that a line is."""
        return UserError(f"{self.where}: line {line}: {words}")


def parse(where: str, lines: list[str], remarks: Remarks, first: int = 1) -> Header:
    """The header from a file's lines, numbered from `first`.

    Raises `UserError` naming line, channel, value, and what is allowed.
    """
    rows = _Lines(where, lines, remarks, first)
    header = Header()
    _station(rows, header)
    analogs, digitals = _counts(rows)
    header.lines["analog"] = rows.rest[0][0] if rows.rest else 0
    header.analogs = [_analog(rows, k, analogs) for k in range(analogs)]
    header.digitals = [_digital(rows, k, digitals) for k in range(digitals)]
    count = _frequency(rows, header)
    _rates(rows, header, count)
    _dates(rows, header)
    _kind(rows, header)
    _trailer(rows, header)
    return header


def _station(rows: _Lines, header: Header) -> None:
    """Read station, device and revision, where the line is there."""
    if _COUNTS.fullmatch(rows.peek()):
        rows.remarks.add("the line of station and device is missing", rows.rest[0][0])
        return
    line, text = rows.take("the station's name")
    fields = [part.strip() for part in text.split(",")]
    while len(fields) > 3 and not fields[-1]:
        fields.pop()
    if len(fields) > 1 and re.fullmatch(r"(19|20)\d\d", fields[-1], re.ASCII):
        header.revision = int(fields.pop())
    elif len(fields) > 2:
        rows.remarks.add(
            f"the standard's year {quote_field(fields.pop())} is none of 1991, 1999, 2013; taken as"
            " 1999",
            line,
        )
        header.revision = 1999
    header.station, header.device = fields[0], ",".join(fields[1:])


def _counts(rows: _Lines) -> tuple[int, int]:
    """The numbers of analog and of status channels."""
    line, text = rows.take("the numbers of channels")
    match = _COUNTS.fullmatch(text)
    if match is None or match[3].upper() == match[5].upper():
        raise rows.refuse(
            line,
            f"{quote_field(text)} is not the numbers of channels, as in 8,6A,2D: all, analog,"
            " status",
        )
    counts = {match[3].upper(): int(match[2]), match[5].upper(): int(match[4])}
    analogs = counts["A"]
    digitals = counts["D"]
    if int(match[1]) != analogs + digitals:
        raise rows.refuse(
            line,
            f"announces {match[1]} channels but {analogs} analog and {digitals} status ones;"
            " correct the numbers",
        )
    if analogs + digitals > len(rows.rest):
        raise rows.refuse(
            line,
            f"announces {analogs + digitals} channels, but only {len(rows.rest)} lines follow;"
            " correct the numbers, or the file is cut short",
        )
    if analogs == 0:
        raise rows.refuse(
            line,
            "announces no analog channel; a record of status channels alone has nothing to read",
        )
    return analogs, digitals


def _analog(rows: _Lines, k: int, count: int) -> Analog:
    """The k-th analog channel of so many."""
    line, text = rows.take(f"analog channel {k + 1} of {count}")
    fields = [part.strip() for part in text.split(",")]
    name = fields[1] if len(fields) > 1 else ""
    channel = f"analog channel {k + 1} of {count} {quote_field(name)}"
    if not any(fields[13:]):
        fields = fields[:13]
    # the first without P or S
    if len(fields) not in (10, 13) and not _lacks_side(fields):
        raise rows.refuse(
            line,
            f"{channel} has {count_noun(len(fields), 'field')}, but an analog channel has 13, or 10"
            " by the standard of 1991; correct the line, or the numbers of channels in line 2",
        )
    fields += [""] * (13 - len(fields))
    side = _read_side(rows, line, fields)
    value = functools.partial(_read_value, rows, line, channel)
    gain = value(fields[5], "multiplier", None)
    offset = value(fields[6], "offset", 0.0)
    skew = value(fields[7], "time skew", 0.0) if fields[7] else 0.0
    if side:
        ratio = value(fields[10], "primary ratio", 1.0), value(fields[11], "secondary ratio", 1.0)
    else:
        ratio = number(fields[10]) or 1.0, number(fields[11]) or 1.0
    limits = _read_limits(fields)
    analog = Analog(name, fields[2], fields[3], fields[4], gain, offset, skew, limits, *ratio, side)
    return _checked_ratio(rows, line, channel, analog)


def _lacks_side(fields: list[str]) -> bool:
    """Whether the fields of an analog channel are whole but for P or S at their end."""
    return len(fields) == 12 and number(fields[4]) is None and number(fields[11]) is not None


def _read_limits(fields: list[str]) -> tuple[float, float] | None:
    """The least and the greatest raw value that a channel declares; None where it does not."""
    low = number(fields[8])
    high = number(fields[9])
    return None if low is None or high is None or low >= high else (low, high)


def _read_side(rows: _Lines, line: int, fields: list[str]) -> str:
    """P or S of an analog channel; "", with a remark where ratios stand without it, for none."""
    side = fields[12].upper()
    if side in ("P", "S"):
        return side
    if side:
        rows.remarks.add(
            f"{quote_field(fields[12])} is neither P nor S, primary values taken", line
        )
    elif any(fields[10:12]):
        rows.remarks.add("neither P nor S stands there, primary values taken", line)
    return ""


def _read_value(
    rows: _Lines, line: int, channel: str, field: str, what: str, default: float | None
) -> float:
    """The number of a field, `default`, with a remark, for an empty one; raises `UserError` for
    what is no number.
    """
    if not field and default is not None:
        rows.remarks.add(f"no {what}, {default:g} taken", line)
        return default
    parsed = number(field)
    if parsed is None or abs(parsed) > GREATEST:
        raise rows.refuse(
            line,
            f"{channel}: {what} {quote_field(field)} is not a number between -1e12 and 1e12;"
            " correct it",
        )
    return parsed


def _checked_ratio(rows: _Lines, line: int, channel: str, analog: Analog) -> Analog:
    """Secondary values need a ratio; a channel that is neither voltage nor current may lack it."""
    if analog.side != "S" or (analog.primary > 0 and analog.secondary > 0):
        return analog
    words = f"its ratio {analog.primary:g}/{analog.secondary:g} is not positive"
    if unit_of(analog.unit)[0]:
        raise rows.refuse(
            line,
            f"{channel} is in secondary values, but {words}; write the ratio of its transformer"
            " there, or P for primary values",
        )
    rows.remarks.add(f"secondary values, but {words}; 1/1 taken", line)
    return Analog(**{**vars(analog), "primary": 1.0, "secondary": 1.0})


def _digital(rows: _Lines, k: int, count: int) -> Digital:
    """The k-th status channel of so many."""
    line, text = rows.take(f"status channel {k + 1} of {count}")
    fields = [part.strip() for part in text.split(",")]
    while len(fields) > 5 and not fields[-1]:
        fields.pop()
    if not 2 <= len(fields) <= 5 or "/" in fields[0]:
        name = quote_field(fields[1]) if len(fields) > 1 else quote_field(fields[0])
        raise rows.refuse(
            line,
            f"status channel {k + 1} of {count} {name} has {count_noun(len(fields), 'field')}, but"
            " a status channel has 5, or 3 by the standard of 1991; correct the line, or the"
            " numbers of channels in line 2",
        )
    if len(fields) == 5:
        name, phase, circuit = fields[1:4]
        return Digital(name, phase, circuit, int(fields[4] == "1"))
    return Digital(fields[1], "", "", int("1" in fields[2:]))


def _frequency(rows: _Lines, header: Header) -> int | None:
    """The nominal frequency; returns the announced number of sampling rates."""
    line, text = rows.take("the nominal frequency")
    header.lines["frequency"] = line
    text = _SIXTEEN.sub("16.6667", text)
    parsed = number(text.strip(", "))
    if (
        parsed is not None
        and 0 < parsed < MOST_RATES
        and parsed == int(parsed)
        and _is_rate(rows.peek())
    ):
        # the number of sampling rates: the line of the frequency is blank
        rows.rest.appendleft((line, text))
        text, parsed = "", None
    if "," in text.strip(", "):
        raise rows.refuse(
            line,
            f"{quote_field(text)} where the nominal frequency should be; more lines of channels may"
            " be there than line 2 announces, or the frequency is missing",
        )
    if parsed == 0 or not text.strip(", "):
        rows.remarks.add(
            f"the nominal frequency is missing: {header.frequency:g} Hz, unless the voltage shows"
            " another",
            line,
        )
        parsed = header.frequency
    if parsed is None or not FREQUENCY[0] <= parsed <= FREQUENCY[1]:
        low, high = FREQUENCY
        raise rows.refuse(
            line,
            f"nominal frequency {quote_field(text)} is not a number between {low:g} and {high:g}"
            " Hz; write that of the network there, 50 or 60",
        )
    header.frequency = parsed
    return _rate_count(rows)


def _rate_count(rows: _Lines) -> int | None:
    """The announced number of sampling rates; None, with a remark, where its line is missing."""
    if "," in rows.peek().strip(", "):
        rows.remarks.add("the number of sampling rates is missing", rows.rest[0][0])
        return None
    line, text = rows.take("the number of sampling rates")
    parsed = number(text.strip(", "))
    if parsed is None or parsed < 0 or parsed != int(parsed) or parsed > 1e6:
        raise rows.refuse(
            line,
            f"the number of sampling rates {quote_field(text)} is not a whole number from 0 on",
        )
    return int(parsed)


def _rates(rows: _Lines, header: Header, count: int | None) -> None:
    """Read rows of rate and last sample into the header, as many as announced or as there are."""
    read = 0
    while not header.rates or _is_rate(rows.peek()):
        line, rate, end = _take_rate(rows)
        header.lines.setdefault("rates", line)
        read += 1
        last = header.rates[-1][1] if header.rates else 0
        if end == last and last:
            rows.remarks.add("a sampling rate without samples of its own is passed over", line)
            continue
        if end < last or end < 1:
            raise rows.refuse(
                line,
                f"last sample {end:g} must be above zero, and above {last}, that of the line"
                " before",
            )
        header.rates.append((rate, int(end)))
    if count is not None and read != max(count, 1):
        rows.remarks.add(
            f"{count} sampling rates announced, {read} present", header.lines["rates"] - 1
        )
    _check_rates(rows, header)


def _check_rates(rows: _Lines, header: Header) -> None:
    """Raise `UserError` where time stamps are valid for some rates only."""
    if len({rate > 0 for rate, _ in header.rates}) > 1:
        listed = ", ".join(f"{rate:g}" for rate, _ in header.rates)
        raise rows.refuse(
            header.lines["rates"],
            f"sampling rates {listed} Hz: a rate of 0 means that time stamps are valid, and must be"
            " the only one",
        )


def _take_rate(rows: _Lines) -> tuple[int, float, float]:
    """(line, sampling rate [Hz], its last sample) of the next line; raises `UserError` for another
    one.
    """
    line, text = rows.take("the sampling rates")
    fields = [number(part) for part in text.strip(", ").split(",")]
    rate, end = (*fields, None, None)[:2]
    if len(fields) != 2 or rate is None or end is None or end != int(end) or abs(end) > 1e15:
        raise rows.refuse(
            line,
            f"{quote_field(text)} is not a sampling rate [Hz] and its last sample, as in 4000,8000",
        )
    if rate < 0 or rate > 1e9:
        raise rows.refuse(
            line, f"sampling rate {quote_field(text.split(',')[0])} is not between 0 and 1e9 Hz"
        )
    return line, rate, end


def _is_rate(text: str) -> bool:
    """Whether a line is a sampling rate with its last sample."""
    fields = text.strip(", ").split(",")
    return len(fields) == 2 and all(number(part) is not None for part in fields)


def _dates(rows: _Lines, header: Header) -> None:
    """Read when the first sample and the trigger were, where the lines are there."""
    entries: list[tuple[int, str]] = []
    while len(entries) < 2 and rows.rest and _LIKE_DATE.search(rows.peek()):
        entries.append(rows.take("the date of the first sample"))
    if not entries:
        rows.remarks.add("there is no date of the first sample")
        return
    header.dates = entries[0][1], entries[1][1] if len(entries) > 1 else ""
    moments = [_read_date(rows, line, text, header.revision < 1997) for line, text in entries]
    begin, at = (*moments, None)[:2]
    if begin is None:
        return
    if at not in (None, EPOCH):
        header.trigger = (at - begin) / timedelta(seconds=1)
    if begin.date() != EPOCH.date():
        header.start = begin
        return
    rows.remarks.add(
        "the clock was not set (1970); the time of the first sample is missing", entries[0][0]
    )


def _read_date(rows: _Lines, line: int, text: str, american: bool) -> datetime | None:
    """The moment that a line says, with a remark on how it was read; None where it is none."""
    moment, remark = date(text, american)
    if remark:
        rows.remarks.add(remark, line)
    return moment


_LIKE_DATE = re.compile(r"^[\s,]*$|\d.*[/:.,\-]|[/:,\-].*\d", re.ASCII)


def _kind(rows: _Lines, header: Header) -> None:
    """Read the type of the data file. Raises `UserError` for one that there is not."""
    line, text = rows.take("the type of the data file")
    header.kind, header.lines["kind"] = text.strip(", ").upper(), line
    if header.kind not in VALUE:
        raise rows.refuse(
            line, f"data file type {quote_field(text)} is not one of {', '.join(VALUE)}"
        )


def _trailer(rows: _Lines, header: Header) -> None:
    """Time multiplier (1999), time codes and clock quality (2013): missing ones have their
    defaults.
    """
    if rows.rest and "," not in rows.peek().strip(", "):
        line, text = rows.take("the time multiplier")
        parsed = number(text.strip(", "))
        if parsed is None or not 0 < parsed <= GREATEST:
            rows.remarks.add(
                f"time multiplier {quote_field(text)} is not a number above zero, 1 taken", line
            )
            parsed = 1.0
        header.timemult = parsed
    elif header.revision >= 1999:
        rows.remarks.add("no time multiplier, 1 taken")
    header.time_code, header.quality = [rows.take("")[1] if rows.rest else "" for _ in range(2)]
    if rows.rest:
        rows.remarks.add("the rest of the file is not used", rows.rest[0][0])
