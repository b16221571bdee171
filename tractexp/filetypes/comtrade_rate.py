"""The lines of a COMTRADE configuration that tell its sampling rates."""

from tractexp.filetypes.comtrade_fields import parse_number, quote_field
from tractexp.filetypes.comtrade_lines import Header, Lines


def read_rate_count(rows: Lines) -> int | None:
    """The announced number of sampling rates; None, with a remark, where its line is missing."""
    if "," in rows.peek().strip(", "):
        rows.remarks.add("the number of sampling rates is missing", rows.rest[0][0])
        return None
    line, text = rows.take("the number of sampling rates")
    parsed = parse_number(text.strip(", "))
    if parsed is None or parsed < 0 or parsed != int(parsed) or parsed > 1e6:
        raise rows.refuse(
            line,
            f"the number of sampling rates {quote_field(text)} is not a whole number from 0 on",
        )
    return int(parsed)


def read_rates(rows: Lines, header: Header, count: int | None) -> None:
    """Read rows of rate and last sample into the header, as many as announced or as there are."""
    read = 0
    while not header.rates or is_rate(rows.peek()):
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


def _check_rates(rows: Lines, header: Header) -> None:
    """Raise `UserError` where time stamps are valid for some rates only."""
    if len({rate > 0 for rate, _ in header.rates}) > 1:
        listed = ", ".join(f"{rate:g}" for rate, _ in header.rates)
        raise rows.refuse(
            header.lines["rates"],
            f"sampling rates {listed} Hz: a rate of 0 means that time stamps are valid, and must be"
            " the only one",
        )


def _take_rate(rows: Lines) -> tuple[int, float, float]:
    """(line, sampling rate [Hz], its last sample) of the next line; raises `UserError` for another
    one.
    """
    line, text = rows.take("the sampling rates")
    fields = [parse_number(part) for part in text.strip(", ").split(",")]
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


def is_rate(text: str) -> bool:
    """Whether a line is a sampling rate with its last sample."""
    fields = text.strip(", ").split(",")
    return len(fields) == 2 and all(parse_number(part) is not None for part in fields)
