"""A report as a terminal or a log file shows it: sentences and tables."""

import io
from collections.abc import Sequence
from typing import Any

from tractexp.blocks.block import CodeBlock, Heading, Items, Paragraphs, Report, Table, VerdictBlock
from tractexp.wording import one_line

PLAIN_LINE_WIDTH = 200  # characters of a line of text that is no terminal's


def show(report: Report, console: Any) -> None:
    """Print a report on a console of rich."""
    for text in (report.title, report.lead):
        if text:
            console.print(one_line(text), markup=False)
    for block in report.blocks:
        if isinstance(block, Table):
            _table(block.brief, console)
        else:
            for line in _lines(block):
                console.print(one_line(line), markup=False)


def _lines(block: Any) -> Sequence[str]:
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


def plain(report: Report) -> str:
    """The same as text."""
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


def _table(table: Table, console: Any) -> None:
    """The first column and those of words are to the left; the last is folded."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table as Grid

    if not table.columns:
        return
    grid = Grid(
        title=one_line(table.title) or None, title_justify="left", box=SIMPLE_HEAD, pad_edge=False
    )
    last = len(table.columns) - 1
    for i, column in enumerate(table.columns):
        justify, fixed = (
            "left" if i == 0 or i in table.words else "right",
            i < last and i not in table.words,
        )
        grid.add_column(one_line(column), justify=justify, no_wrap=fixed)
    for row in table.cells:
        grid.add_row(*map(one_line, row))
    console.print(grid, markup=False)
