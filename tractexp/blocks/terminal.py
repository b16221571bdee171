"""A report as a terminal or a log file shows it: sentences and tables."""

import io
import re
from collections.abc import Sequence
from typing import Any

from tractexp.blocks.block import CodeBlock, Heading, Items, Paragraphs, Report, Table, VerdictBlock
from tractexp.text.wording import write_on_one_line

PLAIN_LINE_WIDTH = 200  # characters of a line of text that is no terminal's
MISSING_CELL = "-"  # in a row that is a line
COLUMN_GAP = 2  # characters between two columns
NARROWEST_WORDS = 12  # characters to which a column of words may be folded
COMMAND = re.compile(r"(?<=: )(tractexp[ .][^;]*)")  # it is copied whole


def show(report: Report, console: Any, width: int | None = None) -> None:
    """Print a report on a console of rich, its sentences folded at `width` characters."""
    for text in (report.title, report.lead):
        if text:
            _print_text(text, console, width)
    for block in report.blocks:
        if isinstance(block, Table):
            _write_table(block.brief, console)
        else:
            for line in _write_lines(block):
                _print_text(line, console, width)


def _print_text(text: str, console: Any, width: int | None) -> None:
    for line in fold(write_on_one_line(text), width):
        console.print(line, markup=False)


def fold(text: str, width: int | None) -> list[str]:
    """The lines of a sentence, all but the first indented; each command in it is one line, which
    the terminal breaks, so that it is copied whole.
    """
    from rich.cells import cell_len

    if width is None or cell_len(text) <= width:
        return [text]
    lead = text[: len(text) - len(text.lstrip())]
    indent = f"{lead}  "
    lines = list[str]()
    for k, part in enumerate(COMMAND.split(text)):
        if k % 2:  # a command
            lines.append(indent + part)
            continue
        begun = False
        for word in part.removeprefix("; ").split():
            if begun and cell_len(f"{lines[-1]} {word}") <= width:
                lines[-1] += f" {word}"
            else:
                lines.append((indent if lines else lead) + word)
            begun = True
    return lines


def _write_lines(block: Any) -> Sequence[str]:
    """The lines of a block; none of what only a page can show."""
    if isinstance(block, Paragraphs | VerdictBlock):
        return block.texts
    if isinstance(block, Items):
        return [f"  {text}" for text in block.texts]
    if isinstance(block, CodeBlock):
        return [f"  {line}" for line in block.text.split("\n")]
    if isinstance(block, Heading):
        return [block.text]
    return ()


def render_plain(report: Report) -> str:
    """The report as text."""
    from rich.console import Console

    text = io.StringIO()
    show(
        report,
        Console(
            file=text,
            highlight=False,
            soft_wrap=True,
            width=PLAIN_LINE_WIDTH,
            color_system=None,
            force_jupyter=False,
        ),
    )
    return "\n".join(line.rstrip() for line in text.getvalue().rstrip().splitlines())


def _write_table(table: Table, console: Any) -> None:
    """The first column and those of words are to the left. Columns of words are folded where the
    console is narrow; where that is not enough, each row is a sentence.
    """
    from rich.box import SIMPLE_HEAD
    from rich.table import Table as Grid

    if not table.columns:
        return
    if _measure_least_width(table) > console.width:
        _print_rows(table, console)
        return
    grid = Grid(
        title=write_on_one_line(table.title) or None,
        title_justify="left",
        box=SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        padding=(0, COLUMN_GAP - 1, 0, 0),
    )
    for i, column in enumerate(table.columns):
        justify = "left" if i == 0 or i in table.words else "right"
        grid.add_column(
            write_on_one_line(column), justify=justify, no_wrap=not _is_folded(table, i)
        )
    for row in table.cells:
        grid.add_row(*map(write_on_one_line, row))
    console.print(grid, markup=False)


def _is_folded(table: Table, column: int) -> bool:
    """Whether the cells of a column are folded where there is no room for them."""
    return column in table.words or column == len(table.columns) - 1


def _measure_least_width(table: Table) -> int:
    """How many characters a table needs, its columns of words folded."""
    from rich.cells import cell_len

    total = COLUMN_GAP * (len(table.columns) - 1)
    for i, column in enumerate(table.columns):
        cells = [column, *(row[i] for row in table.cells)]
        longest = max(map(cell_len, cells))
        if _is_folded(table, i):
            words = [cell_len(word) for cell in cells for word in cell.split()]
            longest = min(longest, max([NARROWEST_WORDS, *words]))
        total += longest
    return total


def _print_rows(table: Table, console: Any) -> None:
    """Each row of a table as a line: its first cell, and what the columns say of it in the order
    that the first line tells.
    """
    if table.title:
        _print_text(table.title, console, console.width)
    for first, *rest in [table.columns, *table.cells]:
        told = ", ".join(cell or MISSING_CELL for cell in rest)
        _print_text(f"{first}: {told}", console, console.width)
