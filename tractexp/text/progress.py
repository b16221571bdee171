"""Progress of a call: one live line on a terminal and in a notebook, lines in a log file.

What a log file has of it goes to the standard error: the output is the answer. All by rich. In a
notebook its own live display asks for ipywidgets; the same bar is shown by IPython's display
instead, which every notebook has.
"""

import functools
import itertools
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

from tractexp.text.wording import write_on_one_line

LOG_WIDTH = 120  # characters a table may take in a log file
WIDTH = "COLUMNS"  # the variable by which a user says how many, wherever it is printed
EVERYTHING = "--all"  # the option that prints more than the first screen
STILL = "  still"  # begins what is told of a stage that takes long: on a live line, in no log file
# s: a log file gets a progress line after so long, then every so often
FIRST_LINE, NEXT_LINES = 2.0, 10.0
BLINK = 0.15  # s between two pictures of a bar in a notebook

# of a call: None shows it, False does not, a callable gets each line
Progress = Callable[[str], None] | bool | None


# gives what is to be called at the end of each part
Counting = AbstractContextManager[Callable[[], None]]


def make_silent_counter(total: int) -> Counting:
    """Nobody counts the parts."""
    return nullcontext(lambda: None)


@functools.cache
def build_console() -> Any:
    """Where progress is printed: a terminal's or a notebook's own width, a fixed one in logs."""
    from rich.console import Console

    lively = Console(highlight=False, soft_wrap=True)
    if lively.is_terminal or lively.is_jupyter or WIDTH in os.environ:
        return lively
    return Console(highlight=False, soft_wrap=True, width=LOG_WIDTH)


def find_text_width() -> int | None:
    """Where sentences are folded, in characters; None where each is one line, as in a log file."""
    return build_console().width if build_console().is_terminal or WIDTH in os.environ else None


def is_everything_asked() -> bool:
    """Whether the command was asked for more than the first screen."""
    return bool(_everything)


_everything: list[str] = []


def ask_for(arguments: list[str]) -> list[str]:
    """Note whether a command line asks for everything by `--all`; the rest of it."""
    _everything[:] = [argument for argument in arguments if argument == EVERYTHING]
    return [argument for argument in arguments if argument != EVERYTHING]


def say(text: str = "") -> None:
    """Print one line."""
    build_console().print(write_on_one_line(text), markup=False)


def log(text: str) -> None:
    """Print one line of progress for a log file, beside the output."""
    print(write_on_one_line(text), file=sys.stderr, flush=True)


@contextmanager
def report_search(
    iterations: int | None, budget: int | None, progress: Progress = None
) -> Iterator[Any]:
    """Yield the search loop's progress callback: a live line, or a line now and then in a log file;
    None for False.
    """
    from rich.progress import BarColumn, TextColumn

    if progress is False:
        yield None
        return
    if not _can_overwrite():
        pace = Pace()

        def line(iteration: int, best: float, simulations: int) -> None:
            if spent := pace():
                rest = describe_remaining_time(
                    spent, share(iteration, simulations, iterations, budget)
                )
                log(
                    f"  iteration {iteration}: {simulations} simulations, best objective"
                    f" {best:.4g}{rest}"
                )

        yield line
        return
    columns = [
        TextColumn("  searching"),
        BarColumn(bar_width=24),
        TextColumn(
            "{task.fields[simulations]} simulations, best objective"
            " {task.fields[best]}{task.fields[rest]}"
        ),
    ]
    started = time.perf_counter()
    total = 1.0 if iterations or budget else None
    with _show_bar(columns, total, simulations=0, best="", rest="") as update:

        def callback(iteration: int, best: float, simulations: int) -> None:
            done = share(iteration, simulations, iterations, budget)
            rest = describe_remaining_time(time.perf_counter() - started, done)
            update(completed=done or 0.0, simulations=simulations, best=f"{best:.4g}", rest=rest)

        yield callback


@contextmanager
def count_parts(what: str, total: int, progress: Progress = None) -> Iterator[Callable[[], None]]:
    """Yield a function to call at the end of each of `total` parts: a bar, or a line now and then
    in a log file.

    A callable gets a line for each.
    """
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

    if progress is False:
        yield lambda: None
        return
    if callable(progress):
        ended = itertools.count(1)
        yield lambda: progress(f"{next(ended)} of {total} {what}")
        return
    if _can_overwrite():
        columns = [
            TextColumn(f"  {what}"),
            BarColumn(bar_width=30),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
        ]
        with _show_bar(columns, total) as update:
            yield lambda: update(advance=1)
        return
    pace, done, first = Pace(), 0, 0.0

    def count() -> None:
        nonlocal done, first
        done, first = done + 1, first or time.perf_counter()
        if pace() and done < total:
            # by what came after the first one, before which workers start
            rate = describe_rate(time.perf_counter() - first, done - 1, total - 1)
            log(f"  {done} of {total} {what}{rate}")

    yield count


def describe_rate(spent: float, done: int, total: int) -> str:
    """The end of a progress line: how fast parts end, of which so many of `total` took `spent` [s],
    and the time that the rest takes; "" before the first one.

    Examples
    --------
    >>> describe_rate(2.0, 2, 4)
    ', 1 a second, about 2 s left'
    """
    if not done or spent <= 0:
        return ""
    return f", {done / spent:.2g} a second{describe_remaining_time(spent, done / total)}"


def make_counter(what: str, progress: Progress = None) -> Callable[[int], Counting]:
    """`counting` of as many parts as will be said; a callable, which is told what begins, is told
    of none.
    """
    return lambda total: count_parts(what, total, None if callable(progress) else progress)


@contextmanager
def tell_stages(progress: Progress = None) -> Iterator[Callable[[str], None]]:
    """Yield a function for the lines of the stages: the newest stands on a live line.

    A log file has a stage once the call has taken `FIRST_LINE` seconds, and not that it goes on.
    """
    from rich.progress import SpinnerColumn, TextColumn

    if callable(progress) or progress is False:
        yield progress or (lambda line: None)
        return
    if _can_overwrite():
        with _show_bar(
            [SpinnerColumn(), TextColumn("{task.fields[stage]}", markup=False)], None, stage=""
        ) as update:
            yield lambda line: update(stage=write_on_one_line(line))
        return
    started = time.perf_counter()

    def log_late(line: str) -> None:
        if time.perf_counter() - started >= FIRST_LINE and not line.startswith(STILL):
            log(f"  {line}")

    yield log_late


def tell(progress: Progress, lines: Iterable[str]) -> None:
    """Pass each line to a callable; any other progress shows the share alone."""
    if callable(progress):
        for line in lines:
            progress(line)


def share(
    iteration: int, simulations: int, iterations: int | None, budget: int | None
) -> float | None:
    """How much of the search is done, in [0, 1], by whichever end comes first; None where neither
    is set.

    An end that the search has passed, as an optimizer may pass its own `iterations`, was none.
    """
    parts = [
        done / end
        for done, end in ((iteration, iterations), (simulations, budget))
        if end and done <= end
    ]
    return max(parts, default=None)


def describe_remaining_time(spent: float, done: float | None) -> str:
    """The end of a progress line: the time [s] that the rest takes; "" before the first part."""
    return f", about {spent / done - spent:.0f} s left" if done and done < 1 else ""


class Pace:
    """When a log file gets its lines: each call gives the seconds since the start where one is due,
    else 0.
    """

    def __init__(self, first: float | None = None):
        """Begin to count; the first line is due after `first` seconds."""
        self.started, self.due = time.perf_counter(), FIRST_LINE if first is None else first

    def __call__(self) -> float:
        """Seconds spent where a line is due, else 0."""
        spent = time.perf_counter() - self.started
        if spent < self.due:
            return 0.0
        self.due = spent + NEXT_LINES
        return spent


def _can_overwrite() -> bool:
    """Whether lines can be overwritten: in a terminal or a notebook."""
    return build_console().is_terminal or build_console().is_jupyter


@contextmanager
def _show_bar(
    columns: list[Any], total: float | None, **fields: Any
) -> Iterator[Callable[..., None]]:
    """Yield `update(completed=..., **fields)` of one bar, which vanishes at the end."""
    from rich.progress import Progress as Bar

    if not build_console().is_jupyter:
        with Bar(*columns, console=build_console(), transient=True, refresh_per_second=8) as bar:
            line = bar.add_task("", total=total, **fields)
            yield lambda **news: bar.update(line, **news)
        return
    from IPython.display import HTML, display

    bar = Bar(*columns, console=build_console(), auto_refresh=False)
    line = bar.add_task("", total=total, **fields)
    shown: Any = display(bar, display_id=True)
    due = time.perf_counter() + BLINK

    def update(**news: Any) -> None:
        nonlocal due
        bar.update(line, **news)
        if time.perf_counter() >= due:
            due = time.perf_counter() + BLINK
            shown.update(bar)

    try:
        yield update
    finally:
        due = float("inf")  # later lines are not shown
        shown.update(HTML(""))
