"""The paper's tables and figures, done again: one page, one verdict for each claim."""

import time
from collections import Counter
from dataclasses import field
from pathlib import Path

from tractexp import files
from tractexp.api.paper import SEEDS, check, paper
from tractexp.plugin import plugin
from tractexp.tasks.console import listed, say
from tractexp.tasks.task import Job, Task, call


@plugin
class Paper(Task):
    """Measure what the paper claims, on the shipped stand-ins or on records of your own: paper.json, .html and .md."""

    resumes = True
    reads = ("data", "model", "objective", "budget", "time_limit", "target")
    instead = {"optimizer": "it compares the paper's three; task=generalise takes any"}

    parts: list[str] = field(default_factory=list)  # such as [table1,figure9]; empty: all
    held_out: dict[str, list[str]] = field(default_factory=dict)  # {choice of data: files}; without data.validate
    seeds: int = SEEDS
    workers: int | None = None  # processes that search; null: one for each core
    docs: str | None = None  # write paper.md to this file too

    def check(self) -> None:
        check(self.parts, self.seeds, self.workers)

    def run(self, job: Job) -> None:
        from tractexp.api.setup import recorded

        started = time.perf_counter()
        job = job.holding_out(self.held_out)
        for line in recorded(job.events_of_fit.train, job.events_of_fit.validate, "hold out"):
            say(line)
        made = call(
            paper, **job.asked, parts=self.parts, seeds=self.seeds, workers=self.workers,
            progress=lambda line: say(f"  {line}"),
        )  # fmt: skip
        paths = made.write_results(job.folder)
        for claim in made.claims:
            say(f"  {claim.verdict}: {claim.text}")
            say(f"    {claim.measured}")
        if made.claims:
            say(made.table().title)
        say(f"in {time.perf_counter() - started:.0f} s")
        paths += made.write_drawings(job.folder)
        if self.docs is not None:
            paths += publish(paths, Path(self.docs))
        listed(paths)
        log(job, paths, made.counts)


def publish(paths: list[Path], docs: Path) -> list[Path]:
    """Write the Markdown page to `docs`, where it could be made."""
    return [files.copy(path, docs) for path in paths if path.suffix == ".md"]


def log(job: Job, paths: list[Path], counts: Counter[str]) -> None:
    """Log the page and how many claims got which verdict."""
    metrics = {verdict.replace(" ", "_"): float(n) for verdict, n in counts.items()}
    job.log(name="the paper", values={}, metrics=metrics, artifacts=paths)
