"""A page on a sweep that goes on: jobs done, the best of each variant, its curve, the time left.

A thread of the sweep's process reads from the jobs' folders how they ended, whatever launches them,
and writes the page anew; a browser that shows the page loads it again. What is written when the
sweep has ended loads no more.
"""

import contextlib
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np

from tractexp.blocks import Report, style
from tractexp.blocks.block import Markup
from tractexp.blocks.chart import Chart
from tractexp.errors import UserError
from tractexp.storage import files
from tractexp.sweep import status
from tractexp.sweep.job import SweepJob, find_shared_overrides
from tractexp.sweep.progress import Tally
from tractexp.sweep.status import FAILED, FINISHED, SEARCHED, Status
from tractexp.text import quoting
from tractexp.text.progress import say

PAGE = "sweep.html"
LEADS_TO = "comparison.html"
PERIOD = 5  # s between two looks at the folders, and between two loads of the page
MOST_NAMED_VARIANTS, MOST_NAMED_FAILURES = 30, 10
Curve = tuple[np.ndarray, np.ndarray]  # simulations (n,), the best objective so far (n,)


@dataclass(frozen=True)
class Standing:
    """How a variant stands: the jobs that have ended, where their searches did, and its best."""

    name: str
    jobs: int
    ends: Sequence[float]
    best: SweepJob | None

    @property
    def rank(self) -> tuple[bool, float, str]:
        """The key by which variants are ranked on the page: the best end, none last."""
        return not self.ends, min(self.ends, default=0.0), self.name


class LivePage:
    """The page of a sweep's folder; `add` tells it of jobs."""

    def __init__(self, folder: Path):
        """The page of a sweep's folder, of no jobs yet."""
        self.folder, self.pace = folder, Tally(())
        self.jobs: dict[Path, SweepJob] = {}
        self.ends: dict[Path, Status] = {}
        self.waiting: dict[Path, int | None] = {}  # when an earlier attempt ended
        self.curves: dict[Path, Curve | None] = {}

    def print_address(self) -> None:
        """Print where it is."""
        say(f"  to watch it: {(self.folder / PAGE).absolute().as_uri()}")

    def add(self, jobs: Sequence[SweepJob], remaining: Sequence[SweepJob]) -> None:
        """Show these jobs, of which the `remaining` are run now."""
        self.pace = Tally(remaining)
        self.jobs |= {job.folder: job for job in jobs}
        self.waiting |= {job.folder: _read_time(job.folder) for job in remaining}
        for folder in self.jobs.keys() - self.waiting.keys() - self.ends.keys():
            if (end := _read_end(folder)) is not None:
                self.ends[folder] = end

    def look(self) -> bool:
        """Note the jobs that have ended since the last look; whether there are any."""
        ended = {}
        for folder, before in self.waiting.items():
            if _read_time(folder) in (None, before):
                continue
            if (end := _read_end(folder)) is not None:
                ended[folder] = end
        for folder, end in ended.items():
            del self.waiting[folder]
            self.pace.add(self.jobs[folder], end)
        self.ends |= ended
        return bool(ended)

    def _list_curves(self, standings: Sequence[Standing]) -> list[tuple[str, Curve]]:
        """The fitness of the best search of each variant, by its name, where it is known."""
        curves = ((standing.name, self._curve(standing.best)) for standing in standings)
        return [(name, curve) for name, curve in curves if curve]

    def _list_failures(self) -> list[str]:
        """The jobs that failed, each with why, one sentence each."""
        return [
            f"{self.jobs[folder].name}: {end.message}"
            for folder, end in self.ends.items()
            if end.status == FAILED
        ]

    def report(self, ended: str = "") -> Report:
        """The page; it loads itself again unless the sweep has `ended`, which says how."""
        common = find_shared_overrides([*self.jobs.values()])
        failures = self._list_failures()
        page = Report(
            f"Sweep {self.folder.name}",
            " ".join(sorted(common)),
            reload=None if ended else PERIOD,
        )
        failed = f", {len(failures)} failed" if failures else ""
        page.verdict(
            f"{len(self.ends)} of {len(self.jobs)} jobs{failed}; {ended or self.pace.time_left}",
            kind="bad" if failures else "plain",
        )
        if (self.folder / LEADS_TO).is_file():
            page.add(Markup(f'<p><a href="{LEADS_TO}">{quoting.html(LEADS_TO)}</a></p>'))
        _add_standings(page, standings := self._rank_variants(common))
        if curves := self._list_curves(standings):
            page.chart(_draw_curves(curves), "The best search of each variant so far.")
        if failures:
            page.heading("Failures").items(_shorten(failures, MOST_NAMED_FAILURES))
        again = "" if ended else f"; this page loads itself again every {PERIOD} s"
        return page.text(f"Written at {time.strftime('%H:%M:%S')}{again}.")

    def _rank_variants(self, common: set[str]) -> list[Standing]:
        """The variants of which a job has ended, the best first."""
        of: dict[str, list[Path]] = {}
        for folder in self.ends:
            of.setdefault(self.jobs[folder].variant(common), []).append(folder)
        standings = []
        for name, folders in of.items():
            measured = {f: value for f in folders if (value := self.ends[f].metric(SEARCHED))}
            best = min(measured, key=measured.__getitem__, default=None)
            ends = [*measured.values()]
            standings.append(Standing(name, len(folders), ends, best and self.jobs[best]))
        return sorted(standings, key=lambda standing: standing.rank)

    def _curve(self, job: SweepJob | None) -> Curve | None:
        """The curve of a job, read once."""
        if job is None:
            return None
        if job.folder not in self.curves:
            self.curves[job.folder] = _read_curve(job.folder)
        return self.curves[job.folder]

    def write(self, ended: str = "") -> None:
        """Write the page; a disk that is full ends no sweep, and a folder that is gone stays so."""
        if self.folder.is_dir():
            with contextlib.suppress(OSError, UserError):
                self.report(ended).save(self.folder / PAGE)

    def follow(self, over: threading.Event) -> None:
        """Look and write now and then until it is over."""
        while not over.wait(PERIOD):
            if self.look():
                self.write()


@contextlib.contextmanager
def keep_live(page: LivePage, more: bool = False) -> Iterator[None]:
    """Keep the page as the jobs are, and let it say how the sweep ended, unless `more` may follow.

    Where more follows, the page goes on loading itself until `write` says that it has ended.
    """
    over, ended = threading.Event(), "interrupted"
    thread = threading.Thread(target=page.follow, args=(over,), daemon=True)
    page.write()
    thread.start()
    try:
        yield
        ended = "" if more else "ended"
    finally:
        over.set()
        thread.join()
        page.look()
        page.write(ended)


def _add_standings(page: Report, standings: Sequence[Standing]) -> None:
    """Add the table of variants."""
    if not standings:
        return
    rows = [
        [s.name, s.jobs, min(s.ends, default=None), median(s.ends) if s.ends else None]
        for s in standings[:MOST_NAMED_VARIANTS]
    ]
    columns = ["variant", "jobs", "best objective [pu²]", "median [pu²]"]
    page.table(columns, rows, "At the end of the search, before the estimate is polished.")
    if (more := len(standings) - len(rows)) > 0:
        page.text(f"and {more} more variants")


def _draw_curves(curves: Sequence[tuple[str, Curve]]) -> Chart:
    """The best objective by simulations; the best variants in color and on top."""
    chart = Chart("simulations", ["objective [pu²]"], log_x=True, log_y=True)
    for name, curve in curves[len(style.PALETTE) :]:
        chart.line(name, *curve, style.BEHIND, step=True, legend=False)
    for (name, curve), color in zip(curves, style.PALETTE, strict=False):
        chart.line(name, *curve, color, step=True, width=2)
    return chart


def _shorten(texts: Sequence[str], most: int) -> list[str]:
    """The first texts, and how many more there are."""
    if (more := len(texts) - most) > 0:
        return [*texts[:most], f"and {more} more"]
    return list(texts)


def _read_end(folder: Path) -> Status | None:
    """How a job ended; None where it has not, or was interrupted."""
    end = status.read(folder)
    return end if end is not None and end.status in (FINISHED, FAILED) else None


def _read_time(folder: Path) -> int | None:
    """When a job's status was written; None where there is none."""
    try:
        return (folder / status.FILE).stat().st_mtime_ns
    except OSError:
        return None


def _read_curve(folder: Path) -> Curve | None:
    """The search of a job, of its `history.csv`; None where it left none."""
    from tractexp.identification.optimizer import REFUSED
    from tractexp.identification.result import parse_history

    try:
        text = files.read_text(folder / "history.csv", files.RESULT)
        simulations, _, objective = parse_history(text)
    except (OSError, ValueError, UserError):
        return None
    valid = objective < REFUSED
    return (simulations[valid], objective[valid]) if valid.any() else None
