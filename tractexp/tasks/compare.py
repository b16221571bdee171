"""Compare the runs of a sweep, or of any filter over MLflow."""

import shutil
from dataclasses import field
from pathlib import Path
from typing import Any

from tractexp.plugin import plugin
from tractexp.tasks.console import listed, say, table
from tractexp.tasks.task import Job, Task, call

SAID = 8  # sentences on the terminal; the page has all


@plugin
class Compare(Task):
    """Settle which optimizer is better: tables, tests over paired seeds, charts, one page, sentences to quote."""

    reads = ()
    instead = {"data": "choose among the runs by task.data"}

    sweep: str | None = None  # folder of a sweep; null: the newest under outputs/sweeps
    filter: str | None = None  # instead: a filter over MLflow, "tags.data = 'tibet_50pct'"
    data: str | None = None  # compare the runs on this choice of data only
    floor: float | None = None  # objective that the noise leaves; null: polished from the runs and many starts
    targets: list[float] = field(default_factory=lambda: [10.0, 2.0, 1.01])  # of running times, times the floor
    ties: float = 1e-3  # objectives within this share of the floor count as equal in the tests
    reference: str | None = None  # test only against this variant; null: every pair

    def check(self) -> None:
        from tractexp.api.compare import check

        check(self.sweep, self.filter, self.targets, self.ties, self.floor)

    def run(self, job: Job) -> None:
        from tractexp.api.compare import compare

        node = job.config["tracking"]
        settings = {key: getattr(self, key) for key in ("filter", "data", "targets", "ties", "floor", "reference")}
        made = call(compare, self.sweep, uri=node["uri"], experiment=node["experiment"], **settings)
        report(made.comparison, made.source)
        paths = made.write(job.folder)
        if made.folder is not None:
            paths = [Path(shutil.copy2(path, made.folder / path.name)) for path in paths] + paths
        listed(paths)
        track(job, made.comparison, made.folder, paths[-2:])


def report(comparison: Any, source: str) -> None:
    """Print the table and the sentences."""
    from tractexp.comparison import claims
    from tractexp.comparison.claims import number

    target, hardest = min((target, i) for i, target in enumerate(comparison.targets))
    say(f"{source}: {comparison.gathered.problem}")
    rows = [
        [
            *(s.name, str(s.failures), number(s.objective.median), number(s.objective.worst), f"{s.at_floor:.0%}"),
            number(s.ert["simulations"][hardest]),
        ]
        for s in comparison.summaries
    ]
    table(["variant", "failed", "median", "worst", "at floor", "ERT"], rows)
    say(f"objectives in pu² at the end of the search; at floor: within 1 %; ERT: simulations to {target:g} x floor")
    say()
    say(claims.answer(comparison))
    told = claims.sentences(comparison)
    for text in [*told[:SAID], *comparison.notes]:
        say(f"- {text}")
    if len(told) > SAID:
        say(f"- and {len(told) - SAID} more sentences in comparison.html")
    say()


def track(job: Job, comparison: Any, folder: Path | None, paths: list[Path]) -> None:
    """Add the page to the sweep's run; where that is not known, log a run of its own."""
    node = job.config["tracking"]
    if not node["enabled"]:
        return
    from tractexp import tracking
    from tractexp.sweep.parent import parent_of
    from tractexp.tracking.attach import attach

    parent = parent_of(folder) if folder is not None else None
    data = comparison.gathered.variants[0].runs[0].data
    if parent is not None and attach(parent, job.store, paths):
        say(f"logged on the run of the sweep; to see it: {job.look}")
        return
    run = tracking.Run(
        experiment=node["experiment"] or f"compare {data}",
        name=f"comparison of {len(comparison.summaries)} variants",
        parameters=tracking.flatten({"task": job.config["task"]}),
        metrics={
            tracking.metric_name(f"median {s.name}"): s.objective.median
            for s in comparison.summaries
            if s.runs > s.failures
        },
        tags={"task": "compare", "data": data},
        artifacts=paths,
    )
    job.send(run)
