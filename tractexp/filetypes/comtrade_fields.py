"""Numbers and dates as the lines of recorders' files hold them, and a value of a file for a
message.
"""

import re
from datetime import datetime
from math import isfinite

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d{1,4})?", re.ASCII)
_DATE = re.compile(
    r"(\d{1,4})[/.\-](\d{1,2})[/.\-](\d{1,4})\s*[,;"
    r" T]*\s*(\d{1,2})\s*:\s*(\d{1,2})\s*:\s*(\d{1,2})(?:[.,](\d*))?\s*,?",
    re.ASCII,
)


def parse_number(text: str) -> float | None:
    """A finite number as files write it; None for any other text.

    Examples
    --------
    >>> parse_number(" 1.5D3 "), parse_number("inf")
    (1500.0, None)
    """
    text = text.strip()
    if not _NUMBER.fullmatch(text):
        return None
    value = float(text.replace("d", "e").replace("D", "e"))
    return value if isfinite(value) else None


def quote_field(text: str) -> str:
    """A value of the file for a message: not longer than a line bears."""
    return f"'{text[:40]}…'" if len(text) > 40 else f"'{text}'"


def parse_date(text: str, american: bool) -> tuple[datetime | None, str]:
    """The date of a field, in whichever order its numbers allow.

    Parameters
    ----------
    text : str
        As in 31/12/2024,23:59:59.000000.
    american : bool
        Whether the month is written first, as in files of 1991.

    Returns
    -------
    datetime or None
        None where no order gives a day of the calendar.
    str
        A remark on how it was read; "" where nothing is odd.

    Examples
    --------
    >>> parse_date("31/12/2024,23:59:59.5", american=False)[0].isoformat()
    '2024-12-31T23:59:59.500000'
    """
    match = _DATE.fullmatch(text.strip())
    if match is None:
        return (
            None,
            f"{quote_field(text)} is not a date and time, as in 31/12/2024,23:59:59.000000; not"
            " used",
        )
    a, b, c, hour, minute, second = map(int, match.groups()[:6])
    micro = int((match[7] or "0")[:6].ljust(6, "0"))
    orders = [(c, a, b), (c, b, a)] if american else [(c, b, a), (c, a, b)]  # (year, month, day)
    if len(match[1]) > 2:
        orders = [(a, b, c), (a, c, b)]
    for k, (year, month, day) in enumerate(orders):
        try:
            moment = datetime(_complete_year(year), month, day, hour, minute, second, micro)
        except ValueError:
            continue
        return moment, f"date {quote_field(text)} read as {moment:%Y-%m-%d}" if k or len(
            match[1]
        ) > 2 else ""
    return None, f"{quote_field(text)} is not a day of the calendar; not used"


def _complete_year(year: int) -> int:
    """The year of which two digits may be written: 70 to 99 are of the last century."""
    if year >= 100:
        return year
    return year + (1900 if year >= 70 else 2000)
