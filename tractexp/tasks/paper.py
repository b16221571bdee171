"""The paper's tables and figures, done again: one page, one verdict for each claim."""

import functools
import re
import sys
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

from tractexp.errors import UserError, check_choice, check_range
from tractexp.plugin import plugin
from tractexp.tasks.console import NEXT_LINES, say
from tractexp.tasks.generalise import with_siblings
from tractexp.tasks.task import Job, Task

PARTS = (
    "table1", "table2", "table3", "table4", "table5", "figure3", "figure4", "figure6", "figure8", "figure9", "figure10",
    "figure11", "equations",
)  # fmt: skip


@plugin
class Paper(Task):
    """Measure what the paper claims, on the shipped stand-ins or on records of your own: paper.html and paper.md."""

    reads = ("data", "model", "objective", "budget", "time_limit", "target")
    instead = {"optimizer": "it compares the paper's three; task=generalise takes any"}

    parts: list[str] = field(default_factory=list)  # such as [table1,figure9]; empty: all
    held_out: dict[str, list[str]] = field(default_factory=dict)  # {choice of data: files}; without data.validate
    seeds: int = 30
    workers: int | None = None  # processes that search; null: one for each core
    docs: str | None = None  # write paper.md to this file too, without its figures

    def check(self) -> None:
        for part in self.parts:
            check_choice("task.parts", part, PARTS)
        check_range("task.seeds", self.seeds, 1)
        if self.workers is not None:
            check_range("task.workers", self.workers, 1)

    def run(self, job: Job) -> None:
        from tractexp.report.paper import write

        started = time.perf_counter()
        made = study(with_siblings(job, self.held_out), self.seeds, self.workers)
        parts = [part for part in PARTS if part in self.parts or not self.parts]
        need_held_out(made, parts)
        paths, judged = write(made, parts, job.folder)
        counts = Counter(claim.verdict for claim in judged)
        for claim in judged:
            say(f"  {claim.verdict}: {claim.text}")
            say(f"    {claim.measured}")
        say(f"{len(judged)} claims: " + ", ".join(f"{n} {verdict}" for verdict, n in counts.items()))
        say(f"in {time.perf_counter() - started:.0f} s")
        if self.docs is not None:
            paths.append(publish(paths, Path(self.docs)))
        for path in paths:
            say(f"  {path}")
        log(job, paths, counts)


def study(job: Job, seeds: int, workers: int | None) -> Any:
    """The experiments on a job's records."""
    from tractexp.identification.search import Limits
    from tractexp.record import describe
    from tractexp.replication.study import Study

    events = job.events()
    for role, group in (("fit", events.train), ("hold out", events.validate)):
        for event in group:
            say(f"{role}: {describe(event)}")
            for note in event.record.notes:
                say(f"  note: {note}")
    limits = Limits(job.config["budget"], job.config["time_limit"], job.config["target"])
    return Study(
        recipe=functools.partial(problem, job.config, events.train),
        node=job.config["model"],
        train=tuple(events.train),
        held_out=tuple(events.validate),
        seeds=seeds,
        seed=job.seed,
        workers=workers,
        limits=limits,
        tell=lambda line: say(f"  {line}"),
        count=Counting(),
    )


def problem(config: Mapping[str, Any], events: Any) -> Any:
    """The identification problem of these events, composed anew: compiled code does not travel to a worker."""
    return Job(config, {}, Path()).problem(events)


def need_held_out(made: Any, parts: list[str]) -> None:
    """Raise `UserError`, before anything is measured, where a part needs a dip that is not there."""
    for kind, needing in (
        ("interpolation", {"table4", "figure10"}),
        ("extrapolation", {"table5", "figure11"}),
    ):
        if needing & set(parts):
            made.held(kind)


class Counting:
    """Says now and then how many searches are done."""

    def __init__(self) -> None:
        self.said = time.perf_counter()

    def __call__(self, done: int, total: int) -> None:
        now = time.perf_counter()
        if done == total or now - self.said > NEXT_LINES:
            self.said = now
            say(f"    {done} of {total} searches")
            sys.stdout.flush()


def publish(paths: list[Path], docs: Path) -> Path:
    """Write the Markdown page to `docs` without its figures, which are named where they stand in the run's page."""
    text = next(path for path in paths if path.suffix == ".md").read_text(encoding="utf-8")
    try:
        docs.parent.mkdir(parents=True, exist_ok=True)
        docs.write_text(re.sub(r"!\[(.*?)\]\((.*?)\)", r"*\2 of the run's folder: \1*", text), encoding="utf-8")
    except OSError as error:
        raise UserError(f"task.docs={docs}: the page cannot be written there: {error.strerror}") from error
    return docs


def log(job: Job, paths: list[Path], counts: Counter[str]) -> None:
    """Log the page and how many claims got which verdict."""
    metrics = {verdict.partition(":")[0].replace(" ", "_"): float(n) for verdict, n in counts.items()}
    job.log(name="the paper", values={}, metrics=metrics, artifacts=paths)
