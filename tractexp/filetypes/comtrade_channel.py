"""The lines of a COMTRADE configuration that name its channels."""

import functools

from tractexp.filetypes.comtrade_fields import parse_number, quote_field
from tractexp.filetypes.comtrade_lines import Analog, Digital, Lines
from tractexp.recording.recording import find_unit
from tractexp.text.wording import count_noun

GREATEST = 1e12  # of a multiplier, an offset or a ratio: beyond it no unit makes sense


def read_analog(rows: Lines, k: int, count: int) -> Analog:
    """The k-th analog channel of so many."""
    line, text = rows.take(f"analog channel {k + 1} of {count}")
    fields = [part.strip() for part in text.split(",")]
    name = fields[1] if len(fields) > 1 else ""
    channel = f"analog channel {k + 1} of {count} {quote_field(name)}"
    if not any(fields[13:]):
        fields = fields[:13]
    # the first without P or S
    if len(fields) not in (10, 13) and not _is_without_side(fields):
        raise rows.refuse(
            line,
            f"{channel} has {count_noun(len(fields), 'field')}, but an analog channel has 13, or 10"
            " by the standard of 1991; correct the line, or the numbers of channels in line 2",
        )
    fields += [""] * (13 - len(fields))
    side = _read_side(rows, line, fields)
    value = functools.partial(read_value, rows, line, channel)
    gain = value(fields[5], "multiplier", None)
    offset = value(fields[6], "offset", 0.0)
    skew = value(fields[7], "time skew", 0.0) if fields[7] else 0.0
    if side:
        ratio = value(fields[10], "primary ratio", 1.0), value(fields[11], "secondary ratio", 1.0)
    else:
        ratio = parse_number(fields[10]) or 1.0, parse_number(fields[11]) or 1.0
    limits = _read_limits(fields)
    analog = Analog(name, fields[2], fields[3], fields[4], gain, offset, skew, limits, *ratio, side)
    return _check_ratio(rows, line, channel, analog)


def _is_without_side(fields: list[str]) -> bool:
    """Whether the fields of an analog channel are whole but for P or S at their end."""
    return (
        len(fields) == 12
        and parse_number(fields[4]) is None
        and parse_number(fields[11]) is not None
    )


def _read_limits(fields: list[str]) -> tuple[float, float] | None:
    """The least and the greatest raw value that a channel declares; None where it does not."""
    low = parse_number(fields[8])
    high = parse_number(fields[9])
    return None if low is None or high is None or low >= high else (low, high)


def _read_side(rows: Lines, line: int, fields: list[str]) -> str:
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


def read_value(
    rows: Lines, line: int, channel: str, field: str, what: str, default: float | None
) -> float:
    """The number of a field, `default`, with a remark, for an empty one; raises `UserError` for
    what is no number.
    """
    if not field and default is not None:
        rows.remarks.add(f"no {what}, {default:g} taken", line)
        return default
    parsed = parse_number(field)
    if parsed is None or abs(parsed) > GREATEST:
        raise rows.refuse(
            line,
            f"{channel}: {what} {quote_field(field)} is not a number between -1e12 and 1e12;"
            " correct it",
        )
    return parsed


def _check_ratio(rows: Lines, line: int, channel: str, analog: Analog) -> Analog:
    """Secondary values need a ratio; a channel that is neither voltage nor current may lack it."""
    if analog.side != "S" or (analog.primary > 0 and analog.secondary > 0):
        return analog
    words = f"its ratio {analog.primary:g}/{analog.secondary:g} is not positive"
    if find_unit(analog.unit)[0]:
        raise rows.refuse(
            line,
            f"{channel} is in secondary values, but {words}; write the ratio of its transformer"
            " there, or P for primary values",
        )
    rows.remarks.add(f"secondary values, but {words}; 1/1 taken", line)
    return Analog(**{**vars(analog), "primary": 1.0, "secondary": 1.0})


def read_digital(rows: Lines, k: int, count: int) -> Digital:
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
