"""Rows that a table itself marks as bad: by a word, by the data error of a synchrophasor's status
word (IEEE C37.118.2, bits 15 and 14 of STAT), by OPC's quality code, or by one number everywhere.
"""

import re
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from tractexp.filetypes.table import TableFile
from tractexp.record.gap import MOST_ROWS, find_short_gaps

NAMED = re.compile(
    r"quality|qual\b|\bstat(us)?\b|valid|flag|qualität|güte|gültig|calidad|qualité"
    r"|качеств|достоверн|质量|品质|有效",
    re.IGNORECASE,
)
BAD = {
    *("bad", "invalid", "questionable", "suspect", "uncertain", "missing", "lost", "error"),
    *("false", "schlecht", "ungültig", "mala", "malo", "inválido", "mauvais", "invalide"),
    *("плохое", "недостоверно", "坏", "无效"),
}
FEWEST_FILLED = 3  # columns that one number in all of them says to be filled in
DATA_ERROR = 0xC000  # of STAT: any of these bits says that the values are not to be used
HEX_WORD = re.compile(r"(0x)?[0-9a-f]{4}h?", re.IGNORECASE)
OPC_GOOD, OPC_QUALITY = 192, 0xC0  # the code of good values; the bits that are 0 of bad ones


def find_bad_rows(table: TableFile, count: int) -> tuple[np.ndarray, tuple[str, ...]]:
    """(which of the table's `count` rows are marked bad, few in a row, what is said of marks).

    Rows marked in a row are used as they stand: what they are worth, nobody but the reader knows.
    """
    bad = np.zeros(count, dtype=bool)
    said = list[str]()
    for number, name in enumerate(table.heading.names):
        if not NAMED.search(name):
            continue
        marked = _read_marks(table.cells(number), name)
        if marked is None or len(marked) != count or not marked.any():
            continue
        few = np.zeros(len(marked), dtype=bool)
        few[find_short_gaps(marked, MOST_ROWS)] = True
        rest = int(np.count_nonzero(marked & ~few))
        if few.any():
            said.append(f"'{name}' marks {np.count_nonzero(few)} rows as bad: left out")
        if rest:
            said.append(f"'{name}' marks {rest} rows as bad, one after another: used as they stand")
        bad |= few
    return bad, tuple(said)


def find_filled_rows(columns: Sequence[np.ndarray]) -> tuple[np.ndarray, tuple[str, ...]]:
    """(which rows of columns (N,), few in a row, hold one number in all of them, what is said).

    Zeros, or -9999, are what a concentrator writes where a frame did not come.
    """
    rows = np.array(columns)
    filled = (rows == rows[0]).all(axis=0) if len(rows) >= FEWEST_FILLED else rows[0] != rows[0]
    lost = np.zeros(len(filled), dtype=bool)
    lost[find_short_gaps(filled, MOST_ROWS)] = True
    if not lost.any():
        return lost, ()
    numbers = ", ".join(f"{x:g}" for x in np.unique(rows[0][lost]))
    count = np.count_nonzero(lost)
    return lost, (f"{count} rows hold nothing but {numbers}: lost frames, left out",)


def _read_marks(cells: Sequence[Any], name: str) -> np.ndarray | None:
    """Which cells (N,) mark their row as bad; None where they are no marks."""
    texts = [str(cell).strip().lower() for cell in cells]
    if not any(text[:1].isdigit() for text in texts):  # words
        return np.array([text in BAD for text in texts])
    if "stat" in name.lower():  # status words of IEEE C37.118
        return np.array([bool(word & DATA_ERROR) for word in _read_status_words(texts)])
    codes = list(map(_read_code, texts))  # quality codes of OPC
    if Counter(codes).most_common(1)[0][0] != OPC_GOOD:
        return None
    return np.array([code is not None and not code & OPC_QUALITY for code in codes])


def _read_status_words(texts: Sequence[str]) -> list[int]:
    """Status words, written in decimal digits or as four hexadecimal ones; 0 for what is none."""
    if all(map(HEX_WORD.fullmatch, texts)):
        return [int(text.removeprefix("0x").removesuffix("h"), 16) for text in texts]
    return [_read_code(text) or 0 for text in texts]


def _read_code(text: str) -> int | None:
    """A whole number in decimal digits; None for another text."""
    return int(float(text)) if re.fullmatch(r"\d+(\.0*)?", text) else None
