"""Optimizers on the functions of BBOB, whose optima are known."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tractexp.api.arguments import Choice, public
from tractexp.api.job import Job
from tractexp.api.task import Task
from tractexp.blocks import Report, Table
from tractexp.cache import provenance
from tractexp.configuration.plugin import build, get, plugin
from tractexp.errors import UserError, check_distinct, check_range
from tractexp.outcome import Written
from tractexp.storage import files
from tractexp.text.progress import Progress, count_parts

if TYPE_CHECKING:
    from tractexp.api.given import Several
    from tractexp.studies.bbob.runs import BbobRuns
    from tractexp.tracking import TrackedRun

FUNCTIONS, INSTANCES, DIMENSIONS = tuple(range(1, 25)), (1, 2, 3), (5,)
MULTIPLIER = 3000
TARGETS = tuple(10.0**k for k in range(2, -9, -1))


@dataclass(frozen=True, eq=False, repr=False)
class BenchmarkResult(Written):
    """All runs on BBOB, and what they come to. `optimizers` holds the settings of each, by its
    name.
    """

    kind = "benchmark"
    page = "benchmark.html"

    bbob: "BbobRuns"
    optimizers: Mapping[str, Mapping[str, Any]]

    @property
    def sentences(self) -> list[str]:
        """Sentences to quote."""
        from tractexp.studies.bbob.page import list_sentences

        return list_sentences(self.bbob)

    def table(self) -> Table:
        """The share of targets that each optimizer reaches, by dimension."""
        from tractexp.studies.bbob.page import scale, span

        bbob = self.bbob
        rows = [
            [
                name,
                d,
                *(bbob.share(name, d, fs) for fs in (bbob.plan.functions, *bbob.groups().values())),
                bbob.count_solved(name, d),
            ]
            for d in bbob.plan.dimensions
            for name in bbob.optimizers
        ]
        columns = ["optimizer", "dimension", "all", *map(span, bbob.groups().values()), "solved"]
        return Table(columns, rows, f"share of targets met, functions solved: {scale(bbob)}")

    def summary(self) -> Report:
        """The answer for each dimension, and the table."""
        from tractexp.studies.bbob import page

        sentences = [page.answer(self.bbob, d) for d in self.bbob.plan.dimensions]
        return (
            Report()
            .add(self.table())
            .text(*sentences, *(f"- {sentence}" for sentence in self.sentences))
        )

    def report(self) -> Report:
        """The page: running times, targets reached, functions."""
        from tractexp.studies.bbob import page

        return page.report(self.bbob)

    def write_results(self, folder: Path) -> list[Path]:
        """Write `benchmark.json`."""
        from tractexp.studies.bbob.page import build_content

        return [
            files.write_json(folder / "benchmark.json", build_content(self.bbob, self.optimizers))
        ]

    def to_dict(self) -> dict[str, Any]:
        """Runs and settings as plain data."""
        from tractexp.studies.bbob.page import build_content

        return {**build_content(self.bbob, self.optimizers), "titles": self.bbob.titles}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """The benchmark that `to_dict` gave."""
        from tractexp.studies.bbob.runs import BbobPlan, BbobRun, BbobRuns

        def run(row: Mapping[str, Any]) -> BbobRun:
            return BbobRun(
                **{**row, "hits": tuple(np.inf if n is None else n for n in row["hits"])}
            )

        plan = BbobPlan(*(_make_tuple(content[item.name]) for item in dataclasses.fields(BbobPlan)))
        titles = {int(function): title for function, title in content["titles"].items()}
        bbob = BbobRuns(
            plan, tuple(content["optimizers"]), titles, [run(row) for row in content["runs"]]
        )
        return cls(bbob, content["optimizers"])


@public
def benchmark(
    optimizers: "Several | None" = None,
    *,
    functions: Sequence[int] = FUNCTIONS,
    instances: Sequence[int] = INSTANCES,
    dimensions: Sequence[int] = DIMENSIONS,
    multiplier: int = MULTIPLIER,
    targets: Sequence[float] = TARGETS,
    seed: int = 0,
    cores: int | None = None,
    progress: Progress = None,
) -> BenchmarkResult:
    """Run optimizers on the noiseless functions of BBOB; the same seed gives the same runs on any
    number of cores.

    Parameters
    ----------
    optimizers : one as in `tractexp.identify`, a list, or {label: optimizer}
    functions : ints, 1 to 24
        Of the suite.
    instances : ints
        Shifts and rotations of each function.
    dimensions : ints, 2 to 100
    multiplier : int
        Evaluations that each run may make per dimension.
    targets : floats
        Distances to the optimum whose running times are told.
    seed : int
    cores : int
        Processes; None: all.
    progress : None, False or callable
        None shows how many runs have ended, False does not; a callable is told of each.

    Returns
    -------
    BenchmarkResult
        Expected running times and the distribution of the targets reached; `sentences` and
        `report()`.

    Raises
    ------
    UserError
        For wrong names or values, an optimizer that needs residuals, and without the extra
        [benchmark].

    Notes
    -----
    Source: Hansen and others 2021, COCO: a platform for comparing continuous optimizers.
    """
    from tractexp.studies.bbob.runs import BbobPlan, import_package, perform

    check(functions, instances, dimensions, multiplier, targets, cores)
    check_range("seed", seed, 0)
    chosen = Choice.several("optimizer", optimizers)
    built = {one.name: one.build("optimizer") for one in chosen}
    for name, optimizer in built.items():
        if optimizer.polish:
            raise UserError(
                f"optimizer {name} polishes by least squares, which need residuals that a BBOB"
                " function does not have; set optimizer.polish=false"
            )
    import_package()
    ordered = tuple(sorted(targets, reverse=True))
    plan = BbobPlan(
        tuple(functions), tuple(dimensions), tuple(instances), multiplier, ordered, seed
    )
    with count_parts("runs", len(plan.cases) * len(built), progress) as count:
        bbob = perform(built, plan, cores, count)
    return BenchmarkResult(bbob, {one.name: one.node for one in chosen})


def check(
    functions: Sequence[int],
    instances: Sequence[int],
    dimensions: Sequence[int],
    multiplier: int,
    targets: Sequence[float],
    cores: int | None,
) -> None:
    """Raise `UserError` for settings out of range."""
    numbers = {
        "functions": (functions, 1, 24),
        "instances": (instances, 1, 10_000),
        "dimensions": (dimensions, 2, 100),
        "targets": (targets, 1e-12, 1e12),
    }
    for name, (values, low, high) in numbers.items():
        check_distinct(f"task.{name}", values)
        for value in values:
            check_range(f"task.{name}", value, low, high)
    check_range("task.multiplier", multiplier, 1)
    check_range("task.cores", cores, 1)


def _make_tuple(value: Any) -> Any:
    """A list as a tuple; anything else as it is."""
    return tuple(value) if isinstance(value, list) else value


@plugin
class Benchmark(Task, call=benchmark, given=("optimizers",)):
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
        """Raise `UserError` for settings out of range."""
        check(
            self.functions,
            self.instances,
            self.dimensions,
            self.multiplier,
            self.targets,
            self.cores,
        )
        if self.against:
            check_distinct("task.against", self.against)
        for name in self.against:
            get("optimizer", name)

    def perform(self, job: Job, **instead: Any) -> BenchmarkResult:
        """Run the run's optimizers; in one process where the run is one of many."""
        cores = self.cores or (1 if job.of_many else None)
        return super().perform(
            job, optimizers=self.optimizers(job), cores=cores, progress=None, **instead
        )

    def optimizers(self, job: Job) -> dict[str, Any]:
        """The optimizer of the job, and those it is set against as they are by default, by name."""
        chosen = job.choices["optimizer"]
        optimizers: dict[str, Any] = {chosen: job.chosen}
        for name in self.against:
            if build("optimizer", {"name": name}) != job.optimizer:
                optimizers[f"{name} by default" if name == chosen else name] = {"name": name}
        return optimizers

    def track(self, job: Job, result: BenchmarkResult, paths: list[Path]) -> "TrackedRun | None":
        """The experiment is named after the benchmark: it has no data of the user's."""
        node = job.config["tracking"]
        if not node["enabled"]:
            return None
        from tractexp import tracking

        metrics = {
            tracking.name_metric(f"share {name} {d}d"): result.bbob.share(
                name, d, result.bbob.plan.functions
            )
            for name in result.bbob.optimizers
            for d in result.bbob.plan.dimensions
        }
        optimizer, seed = job.choices["optimizer"], str(job.seed)
        return tracking.TrackedRun(
            experiment=node["experiment"] or "benchmark bbob",
            name=f"{optimizer} on BBOB",
            parameters=tracking.flatten(
                {key: job.config[key] for key in ("task", "optimizer", "seed")}
            ),
            metrics=metrics,
            tags={
                "task": "benchmark",
                "optimizer": optimizer,
                "seed": seed,
                "git_commit": provenance.find_commit(),
            },
            artifacts=paths,
            parent=job.sweep,
        )
