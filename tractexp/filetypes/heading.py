"""The heading of a table, titles, names of columns and units, and the row at which its values
begin.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from tractexp.errors import UserError
from tractexp.filetypes.cells import is_gap, is_grouped, is_plain_number
from tractexp.filetypes.clock import is_date, is_time
from tractexp.filetypes.column_unit import is_unit, split_unit

MOST_COLUMNS = 4096
FEWEST_ALIKE_ROWS = 3  # rows of numbers of one length make sure that a table has begun


@dataclass(frozen=True)
class TableHeading:
    """The columns' names and units ("" where there is none), and the number of the first row of
    values, from 0.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    first: int
    line: int | None  # number of the row with the names, from 0; None where there is none


def find_heading(
    rows: Sequence[Sequence[Any]], source: str, header: int | None = None
) -> TableHeading:
    """The heading of a table's first rows; `header` is the row of the names, from 0, None to search
    for it.

    Raises `UserError` where there are no rows of numbers, no names above them, or too many columns.
    """
    check_column_count(max(map(len, rows), default=0), source)
    first = _find_first_values(rows, source, header)
    named = header if header is not None else _find_name_row(rows, first)
    if named is None:
        blank = ("",) * len(rows[first])
        return TableHeading(blank, blank, first, None)
    parted = [split_unit(_format_cell(cell)) for cell in rows[named]]
    names, units = map(list, zip(*parted, strict=True))
    beside = _find_units_beside(rows, named, first, any(units))
    if beside is not None:
        own = _pad_texts(_strip_brackets(rows[beside]), len(units))
        units = [unit or by_name for unit, by_name in zip(own, units, strict=False)]
    above = rows[: named - 1 if beside == named - 1 else named]
    for groups in above[-1:]:
        names = _join_group_names(groups, names)
    width = max(len(rows[first]), len(rows[named]))
    return TableHeading(_pad_texts(names, width), _pad_texts(units, width), first, named)


def _find_first_values(rows: Sequence[Sequence[Any]], source: str, header: int | None) -> int:
    """The row, from 0, at which values begin, below a `header` that is given; raises `UserError`
    where there is none.
    """
    begin = 0 if header is None else header + 1
    for i in range(begin, len(rows)):
        if _is_beginning(rows, i):
            return i
    if len(rows) == 1 and len(rows[0]) > 1:
        raise UserError(f"{source}: there are no rows below the header line")
    above = "" if header is None else f" below the header line {header + 1}"
    raise UserError(
        f"{source}: there are no rows of numbers{above}; a table has a line that names its columns,"
        " such as t,U,P,Q, and rows of numbers below it"
    )


def check_column_count(count: int, source: str) -> None:
    """Raise `UserError` for more columns than can be looked at: what each may be takes time."""
    if count > MOST_COLUMNS:
        raise UserError(
            f"{source} has {count:,} columns; a table has at most {MOST_COLUMNS:,}: leave out those"
            " that are not of the load"
        )


def is_value(cell: Any) -> bool:
    """Whether a cell may stand below a heading: a number in any spelling, a time, or a gap."""
    return is_plain_number(cell) or is_grouped(cell) or is_time(cell)


def _format_cell(cell: Any) -> str:
    """A cell as text; "" where it is empty."""
    return "" if cell is None else str(cell).strip()


def _is_numeric(row: Sequence[Any]) -> bool:
    """Whether a row holds values: two or more, and not fewer than texts."""
    values = sum(is_value(cell) for cell in row)
    texts = sum(not (is_value(cell) or is_gap(cell) or is_date(cell)) for cell in row)
    return values >= 2 and values >= texts


def _is_beginning(rows: Sequence[Sequence[Any]], i: int) -> bool:
    """Whether values begin with row `i`: it and those after it are alike. One bad cell in a row is
    no heading.
    """
    following = [row for row in rows[i : i + FEWEST_ALIKE_ROWS] if row]
    return _is_numeric(rows[i]) and all(
        _is_numeric(row) and len(row) >= len(rows[i]) - 1 for row in following
    )


def _find_name_row(rows: Sequence[Sequence[Any]], first: int) -> int | None:
    """The row of names above the values: the nearest with a text for most columns that is no row of
    units.
    """
    for i in range(first - 1, -1, -1):
        texts = [_format_cell(cell) for cell in rows[i]]
        filled = [text for text in texts if text]
        enough = len(filled) >= 2 and 2 * len(filled) >= len(rows[first]) - 1
        if enough and not (_are_units(_strip_brackets(rows[i])) and i > 0):
            return i
    return None


def _find_units_beside(
    rows: Sequence[Sequence[Any]], named: int, first: int, with_units: bool
) -> int | None:
    """The row of units below the names, or above names without units of their own (one letter alone
    is a group's).
    """
    if named + 1 < first and _are_units(_strip_brackets(rows[named + 1])):
        return named + 1
    above = _strip_brackets(rows[named - 1]) if named and not with_units else []
    return named - 1 if _are_units(above) and len({text for text in above if text}) > 1 else None


def _strip_brackets(row: Sequence[Any]) -> list[str]:
    """The texts of a row without brackets."""
    return [_format_cell(cell).strip("[]() ") for cell in row]


def _are_units(texts: Sequence[str]) -> bool:
    """Whether a row is one of units: most of its texts are units, and none is a column's name."""
    filled = [text for text in texts if text and text != "-"]
    names_too = len(set(filled)) == len(filled) and "t" in (text.lower() for text in filled)
    return len(filled) >= 1 and 2 * sum(map(is_unit, filled)) > len(filled) and not names_too


def _join_group_names(groups: Sequence[Any], names: list[str]) -> list[str]:
    """The names, after those of the row above them where it is one of groups ("Bus 1; Bus 1; Load
    2").
    """
    above = _spread_merged_cells([_format_cell(cell) for cell in groups], names)
    repeated = _find_repeated(names)
    over = [upper for upper, name in zip(above, names, strict=False) if name in repeated]
    told = all(over) and len({*over}) > 1
    few = sum(map(bool, above)) < len(names) - 1
    if len(above) != len(names) or len(names) < 3 or (few and not told):
        return names
    return [f"{upper} {name}".strip() for upper, name in zip(above, names, strict=True)]


def _find_repeated(names: Sequence[str]) -> set[str]:
    """The names that several columns have."""
    return {name for name, count in Counter(names).items() if name and count > 1}


def _spread_merged_cells(above: list[str], names: Sequence[str]) -> list[str]:
    """A row of groups with the text of a merged cell, which stands over its first column, over all
    of its columns.

    Only where names repeat, so that they need the groups to be told apart.
    """
    repeated = _find_repeated(names)
    if not repeated or sum(map(bool, above)) < 2:
        return above
    padded = _pad_texts(above, len(names))
    filled = list[str]()
    last = ""
    for text, name in zip(padded, names, strict=False):
        last = text or last
        filled.append(last if name in repeated or text else "")
    return filled


def _pad_texts(texts: Sequence[str], width: int) -> tuple[str, ...]:
    """Texts and so many empty ones that they are `width`."""
    return (*texts, *("",) * (width - len(texts)))
