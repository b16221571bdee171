"""What a person sees while a sweep runs: jobs done, the best of each variant so far,
the time left.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from tractexp.sweep.job import SweepJob, find_shared_overrides
from tractexp.sweep.status import FAILED, SEARCHED, Status
from tractexp.text.progress import Pace, build_console, say

MOST_NAMED_VARIANTS = 3  # variants named in a line of a log file


class Tally:
    """Counts the ends of a sweep's jobs."""

    def __init__(self, jobs: Sequence[SweepJob]):
        """Count the jobs of a sweep as they end."""
        self.total, self.done, self.failed = len(jobs), 0, 0
        self.common = find_shared_overrides(jobs)
        self.jobs: dict[str, int] = {}  # done, by variant
        self.best: dict[str, float] = {}
        self.first = time.perf_counter()

    def add(self, job: SweepJob, end: Status) -> None:
        """Count a job that has ended."""
        variant = job.variant(self.common)
        self.done += 1
        if self.done == 1:
            self.first = time.perf_counter()
        self.failed += end.status == FAILED
        self.jobs[variant] = self.jobs.get(variant, 0) + 1
        value = end.metric(SEARCHED)
        if value is not None:
            self.best[variant] = min(value, self.best.get(variant, value))

    def rank_variants(self) -> list[tuple[str, float]]:
        """(variant, best objective), the best first."""
        return sorted(self.best.items(), key=lambda item: item[1])

    @property
    def time_left(self) -> str:
        """The time left, by the pace since the first end: before it, the workers were starting."""
        if self.done < 2:
            return "time left not known yet"
        spent = time.perf_counter() - self.first
        return f"about {spent * (self.total - self.done) / (self.done - 1):.0f} s left"

    def line(self) -> str:
        """ "3 of 12 jobs, 1 failed, best objectives ..."."""
        parts = [f"{self.done} of {self.total} jobs"]
        if self.failed:
            parts.append(f"{self.failed} failed")
        if self.best:
            parts.append(
                "best objectives "
                + ", ".join(f"{n} {f:.4g}" for n, f in self.rank_variants()[:MOST_NAMED_VARIANTS])
            )
        return f"  {', '.join(parts)}; {self.time_left}"


@contextmanager
def show_progress(jobs: Sequence[SweepJob]) -> Iterator[Callable[[SweepJob, Status], None]]:
    """Yield what is to be called with each job's end: a live bar on a terminal, a line now and then
    in a log file.
    """
    tally = Tally(jobs)
    if build_console().is_terminal:
        with _show_bar(tally) as callback:
            yield callback
        return
    pace = Pace()

    def note(job: SweepJob, end: Status) -> None:
        tally.add(job, end)
        if pace() and tally.done < tally.total:
            say(tally.line())

    yield note


@contextmanager
def _show_bar(tally: Tally) -> Iterator[Callable[[SweepJob, Status], None]]:
    """Within it, a bar counts the jobs, in a terminal."""
    from rich.console import Group
    from rich.live import Live
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = [
        TextColumn("  jobs"),
        BarColumn(bar_width=30),
        MofNCompleteColumn(),
        TextColumn("{task.fields[note]}", markup=False),
        TimeElapsedColumn(),
    ]
    bar = Progress(*columns, console=build_console())
    line = bar.add_task("", total=tally.total, note="")

    def render_progress() -> Any:
        return Group(bar, _build_table(tally))

    with Live(
        render_progress(), console=build_console(), transient=True, refresh_per_second=4
    ) as live:

        def note(job: SweepJob, end: Status) -> None:
            tally.add(job, end)
            failed = f"{tally.failed} failed, " if tally.failed else ""
            bar.update(line, completed=tally.done, note=f"{failed}{tally.time_left};")
            live.update(render_progress())

        yield note


def _build_table(tally: Tally) -> Any:
    """The best objective of each variant so far, best first."""
    from rich.table import Table
    from rich.text import Text

    grid = Table.grid(padding=(0, 2))
    for name, value in tally.rank_variants():
        grid.add_row(Text(f"  {name}"), f"best {value:.4e}", f"{tally.jobs[name]} jobs")
    return grid
