"""The paper's tables and figures, done again: one page, one verdict for each claim."""

import re
import sys
import time
from collections import Counter
from dataclasses import field
from pathlib import Path
from typing import Any

from tractexp import files
from tractexp.api.paper import SEEDS, check, paper
from tractexp.plugin import plugin
from tractexp.tasks.console import NEXT_LINES, say
from tractexp.tasks.generalise import with_siblings
from tractexp.tasks.task import Job, Task


@plugin
class Paper(Task):
    """Measure what the paper claims, on the shipped stand-ins or on records of your own: paper.html and paper.md."""

    reads = ("data", "model", "objective", "budget", "time_limit", "target")
    instead = {"optimizer": "it compares the paper's three; task=generalise takes any"}

    parts: list[str] = field(default_factory=list)  # such as [table1,figure9]; empty: all
    held_out: dict[str, list[str]] = field(default_factory=dict)  # {choice of data: files}; without data.validate
    seeds: int = SEEDS
    workers: int | None = None  # processes that search; null: one for each core
    docs: str | None = None  # write paper.md to this file too, without its figures

    def check(self) -> None:
        check(self.parts, self.seeds, self.workers, where="task.")

    def run(self, job: Job) -> None:
        started = time.perf_counter()
        made = replicated(with_siblings(job, self.held_out), self.parts, self.seeds, self.workers)
        paths = made.write(job.folder)
        for claim in made.claims:
            say(f"  {claim.verdict}: {claim.text}")
            say(f"    {claim.measured}")
        say(f"{len(made.claims)} claims: " + ", ".join(f"{n} {verdict}" for verdict, n in made.counts.items()))
        say(f"in {time.perf_counter() - started:.0f} s")
        if self.docs is not None:
            paths.append(publish(paths, Path(self.docs)))
        for path in paths:
            say(f"  {path}")
        log(job, paths, made.counts)


def replicated(job: Job, parts: list[str], seeds: int, workers: int | None) -> Any:
    """What is measured on a job's records, which are told first."""
    from tractexp.record import describe

    events, config = job.events(), job.config
    for role, group in (("fit", events.train), ("hold out", events.validate)):
        for event in group:
            say(f"{role}: {describe(event)}")
            for note in event.record.notes:
                say(f"  note: {note}")
    return paper(
        events.train, events.validate, model=config["model"], parts=parts, seeds=seeds, seed=job.seed, workers=workers,
        objective=config["objective"], **{key: config[key] for key in ("budget", "time_limit", "target")},
        tell=lambda line: say(f"  {line}"), count=Counting(),
    )  # fmt: skip


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
    return files.write(docs, re.sub(r"!\[(.*?)\]\((.*?)\)", r"*\2 of the run's folder: \1*", text))


def log(job: Job, paths: list[Path], counts: Counter[str]) -> None:
    """Log the page and how many claims got which verdict."""
    metrics = {verdict.partition(":")[0].replace(" ", "_"): float(n) for verdict, n in counts.items()}
    job.log(name="the paper", values={}, metrics=metrics, artifacts=paths)
