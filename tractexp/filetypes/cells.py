"""Cells of a table as numbers, whatever way they are written.

1.25   -1,25   1.0D-3   nan   #N/A   -   1,234.5   1.234,5   1 234,5   1'234.5
"""

import itertools
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

# What programs write where there is no value
GAPS = frozenset(
    (
        "",
        "-",
        "--",
        "---",
        "nan",
        "na",
        "n/a",
        "#n/a",
        "#na",
        "#nv",
        "#value!",
        "#num!",
        "#div/0!",
        "#ref!",
        "null",
        "none",
        "nil",
        "missing",
        "no data",
        "nodata",
        "bad",
        "bad input",
        "no good data",
        "i/o timeout",
        "comm fail",
        "*",
        "?",
        "1.#qnan",
        "-1.#ind",
        "1.#ind",
    )
)
# Numbers whose digits stand in groups of three, by decimal mark
GROUPED = {
    ".": re.compile(r"[+-]?\d{1,3}(?:([,'’ \u00a0\u2009\u202f])\d{3})(?:\1\d{3})*(?:\.\d*)?"),
    ",": re.compile(r"[+-]?\d{1,3}(?:([.'’ \u00a0\u2009\u202f])\d{3})(?:\1\d{3})*(?:,\d*)?"),
}


class BadCell(Exception):
    """A cell of a column that is no number or no time.

    Attributes
    ----------
    row : int
        The cell's row, from 0.
    why : str
        The end of the sentence that the place begins.
    """

    def __init__(self, row: int, why: str) -> None:
        """A cell's row, from 0, and why it cannot be read."""
        super().__init__(row, why)
        self.row, self.why = row, why


def is_gap(cell: Any) -> bool:
    """Whether a cell stands for a missing value: it is empty or holds one of `GAPS`.

    Examples
    --------
    >>> is_gap(None), is_gap("#REF!"), is_gap("0")
    (True, True, False)
    """
    return cell is None or (isinstance(cell, str) and cell.strip().lower() in GAPS)


def is_number(cell: Any, decimal: str = ".") -> bool:
    """Whether a cell is a number, written with that decimal mark.

    Examples
    --------
    >>> is_number("1,5"), is_number("1,5", ",")
    (False, True)
    """
    try:
        _parse_number(cell, decimal)
    except ValueError:
        return False
    return True


def is_plain_number(cell: Any) -> bool:
    """Whether a cell is a number, written with a point or a comma."""
    return is_number(cell) or is_number(cell, ",")


def pick_group_mark(cell: Any, decimal: str) -> str:
    """The mark between groups of three digits of a number.

    Parameters
    ----------
    cell : any
        A cell of a table.
    decimal : str
        The decimal mark, "." or ",".

    Returns
    -------
    str
        "" where there is none, or where it could be a decimal mark.

    Examples
    --------
    >>> pick_group_mark("1,234,567", "."), pick_group_mark("1,234", ".")
    (',', '')
    """
    match = GROUPED[decimal].fullmatch(cell.strip()) if isinstance(cell, str) else None
    if match is None:
        return ""
    sure = match[1] not in ".," or decimal in match[0] or match[0].count(match[1]) > 1
    return match[1] if sure else ""


def is_grouped(cell: Any) -> bool:
    """Whether a cell is surely a number with its digits in groups."""
    return any(pick_group_mark(cell, decimal) for decimal in GROUPED)


def find_group_mark(rows: Sequence[Sequence[Any]], decimal: str) -> str:
    """The mark between groups of digits in the cells of a table; "" where there is none.

    A comma that could be a decimal mark is one of groups where points are, and every comma stands
    before three digits.
    """
    cells = [cell for row in rows for cell in row if isinstance(cell, str)]
    marks = {pick_group_mark(cell, decimal) for cell in cells} - {""}
    if decimal == "." and _are_commas_of_groups(cells):
        marks.add(",")
    return marks.pop() if len(marks) == 1 else ""


def _are_commas_of_groups(cells: Sequence[str]) -> bool:
    """Whether points are there, and each comma that could be a decimal mark is before three
    digits.
    """
    commas = [cell.strip() for cell in cells if "," in cell and is_number(cell, ",")]
    points = any("." in cell and is_number(cell) for cell in cells)
    return points and bool(commas) and all(map(GROUPED["."].fullmatch, commas))


def find_rising_group_mark(rows: Sequence[Sequence[Any]]) -> str:
    """The mark between groups of digits in a column of whole numbers that rise with it, and as
    decimals would not: 980, 1.000; "" where there is none.
    """
    for column in zip(*rows, strict=False):
        texts = [cell.strip() if isinstance(cell, str) else "" for cell in column]
        for mark in ".,":
            if _is_rising_by_groups(texts, mark):
                return mark
    return ""


def _is_rising_by_groups(texts: Sequence[str], mark: str) -> bool:
    """Whether texts are whole numbers that rise where a mark parts groups, and not where it is the
    decimal mark.
    """
    if not all(re.fullmatch(rf"\d{{1,3}}(?:\{mark}\d{{3}})*", text) for text in texts):
        return False
    parts = [text.split(mark) for text in texts]
    grouped = [float("".join(groups)) for groups in parts]
    plain = [float(f"{first}.{''.join(rest)}") for first, *rest in parts]
    return _is_rising(grouped) and not _is_rising(plain)


def _is_rising(values: Sequence[float]) -> bool:
    return all(a < b for a, b in itertools.pairwise(values))


def parse_numbers(
    cells: Sequence[Any], decimal: str = ".", gaps: bool = False, group: str = ""
) -> np.ndarray:
    """The numbers of a column's cells.

    Parameters
    ----------
    cells : N cells
        Texts or numbers.
    decimal : str
        The decimal mark, "." or ",".
    gaps : bool
        Whether a cell may stand for a missing value.
    group : str
        The mark between groups of three digits, "" for none.

    Returns
    -------
    (N,) array
        nan for a gap.

    Raises
    ------
    BadCell
        For the first cell that is no number, or is a gap where none may be.

    Examples
    --------
    >>> parse_numbers(["1.234,5", ""], ",", gaps=True, group=".").tolist()
    [1234.5, nan]
    """
    values = np.empty(len(cells))
    for row, cell in enumerate(cells):
        if group and isinstance(cell, str) and GROUPED[decimal].fullmatch(cell.strip()):
            cell = cell.replace(group, "")
        try:
            values[row] = _parse_number(cell, decimal)
        except ValueError:
            if not is_gap(cell):
                raise BadCell(
                    row, f"{quote_cell(cell)} is not a number{_remark_on_comma(str(cell), decimal)}"
                ) from None
            if not gaps:
                what = (
                    f"{quote_cell(cell)} stands for no value"
                    if cell and str(cell).strip()
                    else "the cell is empty"
                )
                raise BadCell(row, f"{what}; only P and Q may have gaps") from None
            values[row] = np.nan
    return values


def quote_cell(cell: Any) -> str:
    """A cell as a message quotes it: of a long text its first 40 characters."""
    return f"'{cell!s:.40}'"


def _parse_number(cell: Any, decimal: str) -> float:
    """The number that a cell is; raises `ValueError`."""
    if isinstance(cell, int | float) and not isinstance(cell, bool):
        return float(cell)
    if not isinstance(cell, str) or "_" in cell:
        raise ValueError
    text = cell.strip()
    if decimal == "," and "." not in text:
        text = text.replace(",", ".")
    try:
        return float(text)
    except ValueError:
        return float(text.replace("−", "-").replace("D", "e").replace("d", "e"))


def _remark_on_comma(cell: str, decimal: str) -> str:
    """A remark on a decimal mark that is not the one of the file."""
    other = {".": ",", ",": "."}[decimal]
    return (
        f" (decimals are written with '{decimal}' in this file)" if is_number(cell, other) else ""
    )
