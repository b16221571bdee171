"""Optimizers on functions that nobody here wrote."""

from dataclasses import field
from pathlib import Path
from typing import Any

from tractexp import provenance
from tractexp.api.benchmark import DIMENSIONS, FUNCTIONS, INSTANCES, MULTIPLIER, TARGETS, benchmark, check
from tractexp.errors import check_distinct
from tractexp.plugin import build, get, plugin
from tractexp.tasks.console import listed, say, table
from tractexp.tasks.task import Job, Task, call


@plugin
class Benchmark(Task):
    """Run the optimizer and those it is set against on BBOB: ERT and ECDF, one page, JSON."""

    reads = ("optimizer",)
    instead = {
        "budget": "set task.multiplier instead",
        "time_limit": "set task.multiplier instead",
        "target": "set task.targets instead",
    }

    functions: list[int] = field(default_factory=lambda: list(FUNCTIONS))
    instances: list[int] = field(default_factory=lambda: list(INSTANCES))
    dimensions: list[int] = field(default_factory=lambda: list(DIMENSIONS))
    multiplier: int = MULTIPLIER  # evaluations per dimension in each run
    targets: list[float] = field(default_factory=lambda: list(TARGETS))  # f - f_opt
    against: list[str] = field(default_factory=list)  # optimizers with their own defaults
    cores: int | None = None  # processes; null: all cores, one for a job of a sweep

    def check(self) -> None:
        check(self.functions, self.instances, self.dimensions, self.multiplier, self.targets, self.cores)
        if self.against:
            check_distinct("task.against", self.against)
        for name in self.against:
            get("optimizer", name)

    def run(self, job: Job) -> None:
        plan = {key: getattr(self, key) for key in ("functions", "instances", "dimensions", "multiplier", "targets")}
        cores = self.cores or (1 if job.in_sweep else None)
        made = call(benchmark, self.optimizers(job), **plan, seed=job.seed, cores=cores)
        paths = made.write_results(job.folder)
        show(made.made)
        paths += made.write_drawings(job.folder)
        listed(paths)
        track(job, made.made, paths)

    def optimizers(self, job: Job) -> dict[str, Any]:
        """The optimizer of the job, and those it is set against as they are by default, by name."""
        chosen = job.choices["optimizer"]
        made = {chosen: job.chosen}
        for name in self.against:
            if build("optimizer", {"name": name}) != job.optimizer:
                made[f"{name} by default" if name == chosen else name] = {"name": name}
        return made


def show(made: Any) -> None:
    """Print the shares and the sentences."""
    from tractexp.report import benchmark as report

    say(report.scale(made))
    for dimension in made.plan.dimensions:
        _, rows = report.shares(made, dimension)
        columns = ["optimizer", "all", *(span(group) for group in made.groups().values()), "solved"]
        table(columns, rows, f"dimension {dimension}: share of targets met, functions solved")
    for dimension in made.plan.dimensions:
        say(report.answer(made, dimension))
    for sentence in report.sentences(made):
        say(f"- {sentence}")
    say()


def span(functions: list[int]) -> str:
    """The functions of a group in short: f1-5."""
    first, last = min(functions), max(functions)
    return f"f{first}" if first == last else f"f{first}-{last}"


def track(job: Job, made: Any, paths: list[Path]) -> None:
    """Log a run whose experiment is named after the benchmark: it has no data of the user's."""
    node = job.config["tracking"]
    if not node["enabled"]:
        return
    from tractexp import tracking

    metrics = {
        tracking.metric_name(f"share {name} {d}d"): made.share(name, d, made.plan.functions)
        for name in made.optimizers for d in made.plan.dimensions
    }  # fmt: skip
    optimizer = job.choices["optimizer"]
    run = tracking.Run(
        experiment=node["experiment"] or "benchmark bbob",
        name=f"{optimizer} on BBOB",
        parameters=tracking.flatten({key: job.config[key] for key in ("task", "optimizer", "seed")}),
        metrics=metrics,
        tags={"task": "benchmark", "optimizer": optimizer, "seed": str(job.seed), "git_commit": provenance.commit()},
        artifacts=paths,
        parent=job.sweep,
    )
    job.send(run)
