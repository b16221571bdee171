"""What a table lacks to be fitted, and the columns that may be meant for it."""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

from tractexp.errors import DATA
from tractexp.filetypes.cells import is_plain_number
from tractexp.filetypes.column_key import has_quantity, list_quantity_keys
from tractexp.filetypes.column_options import MappedColumn, find_other_columns
from tractexp.filetypes.table import TableFile


def read_sample_numbers(table: TableFile, number: int) -> list[float]:
    """The numbers among a column's cells in the first rows, with either decimal mark."""
    cells = [row[number] for row in table.sample if number < len(row)]
    return [float(str(cell).replace(",", ".")) for cell in filter(is_plain_number, cells)]


def describe_missing_columns(
    table: TableFile, options: Mapping[str, Any], groups: Mapping[str, Any]
) -> str:
    """The sentence on what is missing of a table whose columns make up `groups`."""
    names = [table.label(k) for k in find_other_columns(table, ())]
    if not names:
        return (
            f"{table.source}: no line names the columns; add one, such as t,U,P,Q, or name them by"
            f" number, from 0: {DATA.columns}={{t: 0, U: 1, P: 2, Q: 3}}"
        )
    listed = f"the header line names {', '.join(names)}"
    if groups and "t" in options:
        return (
            f"{table.source}: what {DATA.columns} names makes no table of powers, phasors or"
            f" waveforms with the others; {listed}; name all that are needed: {DATA.columns}={{t:"
            f" ..., U: ..., P: ..., Q: ...}}"
        )
    missing = [] if "t" in options else ["t"]
    if not groups:
        missing += _list_missing_powers(options)
    return (
        f"{table.source}: column {', '.join(missing)} is missing; {listed};"
        f" {_suggest_columns(table, options, missing)}"
    )


def _suggest_columns(table: TableFile, options: Mapping[str, Any], missing: Sequence[str]) -> str:
    """The setting that says which columns the missing ones are, with those that may be meant."""
    meant = {key: name for key in missing if (name := _find_meant_column(table, options, key))}
    said = ", ".join(f"{key}: '{meant[key]}'" if key in meant else f"{key}: ..." for key in missing)
    which = f"if {', '.join(meant.values())} is meant, say so" if meant else "say which is which"
    return f"{which}: {DATA.columns}={{{said}}}"


def _list_missing_powers(options: Mapping[str, Any]) -> list[str]:
    """Which of U, P and Q no column holds."""
    there = {"U": bool(list_quantity_keys(options, "U", ("U", "U1")))}
    there |= {letter: has_quantity(options, letter) for letter in "PQ"}
    return [key for key, is_there in there.items() if not is_there]


def _find_meant_column(
    table: TableFile, options: Mapping[str, list[MappedColumn]], key: str
) -> str:
    """The one column that may be meant by a key that is missing: of its quantity by name, or that
    counts up as t does.

    "" where there is none or several: a name that only looks alike says nothing.
    """
    if key == "t":
        return _find_counting_column(table, options)
    names = [name for name in options if name[0] == key and "_" not in name]
    alike = {one.number: one.name for name in names for one in options[name]}
    return next(iter(alike.values())) if len(alike) == 1 else ""


def _find_counting_column(table: TableFile, options: Mapping[str, list[MappedColumn]]) -> str:
    """The one column without a role that counts up as t does; "" for none or several."""
    taken = {one.number for one in itertools.chain(*options.values())}
    free = [k for k in find_other_columns(table, taken) if _is_increasing(table, k)]
    return table.label(free[0]) if len(free) == 1 else ""


def _is_increasing(table: TableFile, number: int) -> bool:
    """Whether a column increases in every row of the sample, as times do."""
    rows = sum(number < len(row) for row in table.sample)
    values = read_sample_numbers(table, number)
    return len(values) == rows > 1 and all(a < b for a, b in itertools.pairwise(values))
