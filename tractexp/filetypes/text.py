"""Text as instruments and office programs write it: its encoding is detected."""

import re

from tractexp.errors import DATA, UserError

ENCODINGS = ("utf-8", "gbk", "cp1251", "latin-1")
MARKS = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}


def decode(content: bytes, where: str, encoding: str | None = None) -> tuple[str, str]:
    """The text and its encoding: `encoding`, or else the one of `ENCODINGS` whose letters make
    words.

    Raises `UserError` where `encoding` is none or does not fit.
    """
    marked = next((name for mark, name in MARKS.items() if content.startswith(mark)), None)
    codec = encoding or marked or _guess(content)
    try:
        return content.decode(codec), codec
    except LookupError as error:
        names = ", ".join(ENCODINGS)
        raise UserError(
            f"{DATA.encoding}={encoding}: there is no such text encoding; try {names}"
        ) from error
    except (UnicodeError, ValueError) as error:
        if encoding:
            raise UserError(
                f"{where}: not {encoding} text; leave {DATA.encoding} out to have it detected"
            ) from error
        return content.decode("latin-1"), "latin-1"


def _guess(content: bytes) -> str:
    """One-byte letters and the pairs of GBK overlap: they differ in which letters are common."""
    try:
        content.decode("utf-8")
        return "utf-8"
    except UnicodeDecodeError:
        pass
    try:
        content.decode("gbk")
        pairs = re.findall(rb"[\x81-\xfe][\x40-\xfe]", content)
        # GB 2312 keeps the characters in daily use below 0xD8; a pair of small Cyrillic letters
        # lies above
        rare = sum(
            pair[0] >= 0xD8 or pair[0] in range(0xAA, 0xB0) or pair[1] < 0xA1 for pair in pairs
        )
        if rare <= 0.2 * len(pairs):
            return "gbk"
    except UnicodeDecodeError:
        pass
    # Cyrillic letters stand with their like, accented Latin ones among plain letters
    letters = len(re.findall(rb"[\x80-\xff]", content))
    accents = len(re.findall(rb"(?<=[A-Za-z])[\x80-\xff]|[\x80-\xff](?=[a-z])", content))
    try:
        content.decode("cp1251")
    except UnicodeDecodeError:
        return "latin-1"
    return "latin-1" if accents > 0.5 * letters else "cp1251"


def split_lines(text: str) -> list[str]:
    """The lines of a text, whichever of the three line ends it uses; what follows Ctrl-Z at its end
    is cut off.
    """
    return [line.strip(" \t\0\x1a") for line in re.split(r"\r\n|\n|\r", text.lstrip("\ufeff"))]
