"""Compare the runs of a sweep, or of any filter over MLflow."""

from dataclasses import field
from pathlib import Path
from typing import Any

from tractexp import files
from tractexp.errors import UserError
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
    apart: list[str] = field(default_factory=list)  # limits that make comparisons of their own: [budget]
    bbob: int = 0  # instances of each function of BBOB on which the variants are run as well
    cores: int | None = None  # processes for these; null: all cores

    def check(self) -> None:
        from tractexp.api.compare import check

        check(self.sweep, self.filter, self.targets, self.ties, self.floor, self.apart, self.bbob)

    def run(self, job: Job) -> None:
        from tractexp.api.compare import compare

        node = job.config["tracking"]
        told = ("filter", "data", "targets", "ties", "floor", "reference", "apart", "bbob", "cores")
        settings = {key: getattr(self, key) for key in told}
        made = call(compare, self.sweep, uri=node["uri"], experiment=node["experiment"], **settings)
        paths = made.write_results(job.folder)
        report(made)
        paths += made.write_drawings(job.folder)
        beside = made.folder if made.folder != job.folder else None
        listed([files.copy(path, beside / path.name) for path in paths if beside] + paths)
        track(job, made, paths)


def report(made: Any) -> None:
    """Print the tables and the sentences."""
    if "problems" in made.content:
        _several(made)
    else:
        _one(made.comparison, made.source)


def _several(made: Any) -> None:
    """What several problems come to under each of the terms."""
    say(f"{made.source}: {', '.join(made.comparison.comparisons)}")
    for overall in made.comparison.overall:
        say()
        best = list(overall.figures.items())[:SAID]
        cells = [[name, *(f"{x:.0%}" if overall.share else f"{x:.3g}" for x in values)] for name, values in best]
        title = f"{overall.terms}, {overall.where}: {overall.measure}"
        table(["variant", *overall.columns], cells, title)
    for text in [*made.sentences, *made.content["notes"]]:
        say(f"- {text}")
    say()


def _one(comparison: Any, source: str) -> None:
    """The table and the sentences of one problem."""
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


def track(job: Job, made: Any, paths: list[Path]) -> None:
    """Add the page to the sweep's run; where that is not known, log a run of its own."""
    node = job.config["tracking"]
    if not node["enabled"]:
        return
    from tractexp import tracking
    from tractexp.tracking.run import attach
    from tractexp.tracking.sweepfile import parent_of, waits

    if made.folder is not None and waits(made.folder):
        return  # the page is sent with the run of the sweep
    parent = parent_of(made.folder) if made.folder is not None else None
    comparisons = made.comparisons
    known = {run.data for c in comparisons.values() for variant in c.gathered.variants for run in variant.runs}
    data = known.pop() if len(known) == 1 else f"{len(known)} records"
    try:
        if parent is not None and attach(parent, job.store, paths):
            say(f"logged on the run of the sweep; to see it: {job.look}")
            return
    except UserError as error:
        say(f"not logged: {error}")
        return
    run = tracking.Run(
        experiment=node["experiment"] or f"compare {data}",
        name=f"comparison of {len(next(iter(comparisons.values())).summaries)} variants",
        parameters=tracking.flatten({"task": job.config["task"]}),
        metrics={
            tracking.metric_name(f"median {s.name} {label}".strip()): s.objective.median
            for label, comparison in comparisons.items()
            for s in comparison.summaries
            if s.runs > s.failures
        },
        tags={"task": "compare", "data": data},
        artifacts=paths,
    )
    job.send(run)
