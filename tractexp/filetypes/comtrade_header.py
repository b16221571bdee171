"""The configuration (.cfg) of a COMTRADE record, read line by line and checked before any data is
read.

Source: IEEE C37.111-1991, -1999 and -2013. Harmless departures are mended and noted with their
line.
"""

import re
from datetime import datetime, timedelta

from tractexp.filetypes.comtrade_channel import GREATEST, read_analog, read_digital
from tractexp.filetypes.comtrade_fields import parse_date, parse_number, quote_field
from tractexp.filetypes.comtrade_lines import Header, Lines
from tractexp.filetypes.comtrade_rate import is_rate, read_rate_count, read_rates
from tractexp.filetypes.remarks import Remarks

VALUE = {"ASCII": "f8", "BINARY": "<i2", "BINARY32": "<i4", "FLOAT32": "<f4"}  # of one analog value
FREQUENCY = (10.0, 100.0)  # Hz, nominal: 16.7 and 25 Hz railways to 60 Hz, with room
# Hz, as a third of 50 is written
_SIXTEEN = re.compile(r"^\s*(?:16[ +]2/3|50/3|16,(?:7|67|667|6667))(?!\d)")
MOST_RATES = 10  # sampling rates of one file, where their number stands for the nominal frequency
EPOCH = datetime(1970, 1, 1)  # a clock that was not set
_COUNTS = re.compile(
    r"(\d{1,12})\s*,\s*(\d{1,12})\s*([AD])\s*,\s*(\d{1,12})\s*([AD])\s*,?", re.ASCII | re.IGNORECASE
)


def parse(where: str, lines: list[str], remarks: Remarks, first: int = 1) -> Header:
    """The header from a file's lines, numbered from `first`.

    Raises `UserError` naming line, channel, value, and what is allowed.
    """
    rows = Lines(where, lines, remarks, first)
    header = Header()
    _read_station(rows, header)
    analogs, digitals = _read_counts(rows)
    header.lines["analog"] = rows.rest[0][0] if rows.rest else 0
    header.analogs = [read_analog(rows, k, analogs) for k in range(analogs)]
    header.digitals = [read_digital(rows, k, digitals) for k in range(digitals)]
    count = _read_frequency(rows, header)
    read_rates(rows, header, count)
    _read_dates(rows, header)
    _read_kind(rows, header)
    _read_trailer(rows, header)
    return header


def _read_station(rows: Lines, header: Header) -> None:
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


def _read_counts(rows: Lines) -> tuple[int, int]:
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


def _read_frequency(rows: Lines, header: Header) -> int | None:
    """The nominal frequency; returns the announced number of sampling rates."""
    line, text = rows.take("the nominal frequency")
    header.lines["frequency"] = line
    text = _SIXTEEN.sub("16.6667", text)
    parsed = parse_number(text.strip(", "))
    if (
        parsed is not None
        and 0 < parsed < MOST_RATES
        and parsed == int(parsed)
        and is_rate(rows.peek())
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
    return read_rate_count(rows)


def _read_dates(rows: Lines, header: Header) -> None:
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


def _read_date(rows: Lines, line: int, text: str, american: bool) -> datetime | None:
    """The moment that a line says, with a remark on how it was read; None where it is none."""
    moment, remark = parse_date(text, american)
    if remark:
        rows.remarks.add(remark, line)
    return moment


_LIKE_DATE = re.compile(r"^[\s,]*$|\d.*[/:.,\-]|[/:,\-].*\d", re.ASCII)


def _read_kind(rows: Lines, header: Header) -> None:
    """Read the type of the data file. Raises `UserError` for one that there is not."""
    line, text = rows.take("the type of the data file")
    header.kind, header.lines["kind"] = text.strip(", ").upper(), line
    if header.kind not in VALUE:
        raise rows.refuse(
            line, f"data file type {quote_field(text)} is not one of {', '.join(VALUE)}"
        )


def _read_trailer(rows: Lines, header: Header) -> None:
    """Read time multiplier (1999), time codes and clock quality (2013) into `header`; those that
    are missing have their defaults.
    """
    # a line with commas within is the time codes already
    if rows.rest and "," not in rows.peek().strip(", "):
        line, text = rows.take("the time multiplier")
        parsed = parse_number(text.strip(", "))
        if parsed is None or not 0 < parsed <= GREATEST:
            rows.remarks.add(
                f"time multiplier {quote_field(text)} is no number from 0 to {GREATEST:g}, 1 taken",
                line,
            )
            parsed = 1.0
        header.timemult = parsed
    elif header.revision >= 1999:
        rows.remarks.add("no time multiplier, 1 taken")
    header.time_code = rows.take("")[1] if rows.rest else ""
    header.quality = rows.take("")[1] if rows.rest else ""
    if rows.rest:
        rows.remarks.add("the rest of the file is not used", rows.rest[0][0])
