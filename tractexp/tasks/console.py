"""What a person sees while a task runs: lines, tables, and one progress line."""

import functools
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

LOG_WIDTH = 120  # characters a table may take in a log file
FIRST_LINE, NEXT_LINES = 2.0, 10.0  # s: a log file gets a progress line after so long, then every so often


@functools.cache
def console() -> Any:
    from rich.console import Console

    made = Console(highlight=False, soft_wrap=True)
    return made if made.is_terminal else Console(highlight=False, soft_wrap=True, width=LOG_WIDTH)


def say(text: str = "") -> None:
    """Print one line."""
    console().print(text, markup=False)


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


@contextmanager
def searching(iterations: int | None, budget: int | None) -> Iterator[Any]:
    """Yield the search loop's progress callback: a live line on a terminal, a line now and then in a log file."""
    if console().is_terminal:
        with _live(iterations, budget) as callback:
            yield callback
    else:
        yield _Lines(iterations, budget)


@contextmanager
def counting(what: str, total: int) -> Iterator[Callable[[], None]]:
    """Yield what is to be called at the end of each of `total` parts: a bar on a terminal, a line now and then."""
    if console().is_terminal:
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = [TextColumn(f"  {what}"), BarColumn(bar_width=30), MofNCompleteColumn(), TimeRemainingColumn()]
        with Progress(*columns, console=console(), transient=True) as bar:
            line = bar.add_task("", total=total)
            yield lambda: bar.advance(line)
        return
    started, due, done = time.perf_counter(), FIRST_LINE, 0

    def count() -> None:
        nonlocal due, done
        done += 1
        spent = time.perf_counter() - started
        if spent >= due and done < total:
            due = spent + NEXT_LINES
            say(f"  {done} of {total} {what}, about {spent * (total - done) / done:.0f} s left")
            sys.stdout.flush()

    yield count


def share(iteration: int, simulations: int, iterations: int | None, budget: int | None) -> float | None:
    """How much of the search is done, in [0, 1], by whichever end comes first; None where neither is known."""
    parts = [done / end for done, end in ((iteration, iterations), (simulations, budget)) if end]
    return min(max(parts), 1.0) if parts else None


class _Lines:
    def __init__(self, iterations: int | None, budget: int | None):
        self.iterations, self.budget = iterations, budget
        self.started = time.perf_counter()
        self.due = FIRST_LINE

    def __call__(self, iteration: int, best: float, simulations: int) -> None:
        spent = time.perf_counter() - self.started
        if spent < self.due:
            return
        self.due = spent + NEXT_LINES
        done = share(iteration, simulations, self.iterations, self.budget)
        left = f", about {spent / done - spent:.0f} s left" if done else ""
        say(f"  iteration {iteration}: {simulations} simulations, best objective {best:.4g}{left}")
        sys.stdout.flush()


@contextmanager
def _live(iterations: int | None, budget: int | None) -> Iterator[Any]:
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = [
        TextColumn("  searching"),
        BarColumn(bar_width=24),
        TextColumn("{task.fields[simulations]} simulations, best objective {task.fields[best]:.4g},"),
        TimeRemainingColumn(compact=True),
        TextColumn("left"),
    ]
    with Progress(*columns, console=console(), transient=True, refresh_per_second=8) as progress:
        line = progress.add_task("", total=1.0 if iterations or budget else None, simulations=0, best=float("nan"))

        def callback(iteration: int, best: float, simulations: int) -> None:
            done = share(iteration, simulations, iterations, budget)
            progress.update(line, completed=done or 0.0, simulations=simulations, best=best)

        yield callback
