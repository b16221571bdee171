"""What a task prints: lines and tables."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from tractexp.progress import FIRST_LINE as FIRST_LINE
from tractexp.progress import NEXT_LINES as NEXT_LINES
from tractexp.progress import console as console
from tractexp.progress import say as say


def listed(paths: Iterable[Path]) -> None:
    """Print what was written."""
    for path in paths:
        say(f"  {path}")


def table(columns: Sequence[str], rows: Sequence[Sequence[str]], title: str = "") -> None:
    """Print a table; the first column is text, the others are aligned to the right except the last."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    made = Table(*[], title=title or None, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    for i, column in enumerate(columns):
        made.add_column(column, justify="left" if i in (0, len(columns) - 1) else "right", no_wrap=i < len(columns) - 1)
    for row in rows:
        made.add_row(*row)
    console().print(made, markup=False)
