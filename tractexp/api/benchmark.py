"""Optimizers on functions with known optima that nobody here wrote."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tractexp.api.arguments import Choice, public
from tractexp.api.pages import Drawing, Written
from tractexp.errors import UserError, check_distinct, check_range
from tractexp.outcome import Table
from tractexp.progress import counting

if TYPE_CHECKING:
    from tractexp.comparison.bbob import Benchmark

FUNCTIONS, INSTANCES, DIMENSIONS = tuple(range(1, 25)), (1, 2, 3), (5,)
MULTIPLIER = 3000
TARGETS = tuple(10.0**k for k in range(2, -9, -1))


@dataclass(frozen=True, eq=False, repr=False)
class Benchmarked(Written):
    """All runs on BBOB, and what they come to. `optimizers` holds the settings of each, by its name."""

    kind = "benchmark"

    made: "Benchmark"
    optimizers: Mapping[str, Mapping[str, Any]]

    @property
    def sentences(self) -> list[str]:
        """What may be quoted."""
        from tractexp.report.benchmark import sentences

        return sentences(self.made)

    def table(self) -> Table:
        from tractexp.report.benchmark import scale

        made = self.made
        rows = [
            [name, d, *(made.share(name, d, fs) for fs in (made.plan.functions, *made.groups().values())),
             made.solved(name, d)]
            for d in made.plan.dimensions for name in made.optimizers
        ]  # fmt: skip
        columns = ["optimizer", "dimension", "all", *made.groups(), "solved"]
        return Table(columns, rows, f"share of targets met, functions solved: {scale(made)}", self.sentences)

    def _results(self, folder: Path) -> list[Path]:
        from tractexp.report import benchmark as report

        return [report.write_json(self.made, self.optimizers, folder / "benchmark.json")]

    def _drawings(self) -> Mapping[str, Drawing]:
        from tractexp.report import benchmark as report

        return {"benchmark.html": lambda path: report.write_page(self.made, path)}

    def to_dict(self) -> dict[str, Any]:
        from tractexp.report.benchmark import content

        return {**content(self.made, self.optimizers), "titles": self.made.titles}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        from tractexp.comparison.bbob import Benchmark, Plan, Run

        def run(told: Mapping[str, Any]) -> Run:
            return Run(**{**told, "hits": tuple(np.inf if n is None else n for n in told["hits"])})

        plan = Plan(*(_tuple(content[item.name]) for item in dataclasses.fields(Plan)))
        titles = {int(function): title for function, title in content["titles"].items()}
        made = Benchmark(plan, tuple(content["optimizers"]), titles, [run(told) for told in content["runs"]])
        return cls(made, content["optimizers"])


@public
def benchmark(
    optimizers: Any = None,
    *,
    functions: Sequence[int] = FUNCTIONS,
    instances: Sequence[int] = INSTANCES,
    dimensions: Sequence[int] = DIMENSIONS,
    multiplier: int = MULTIPLIER,
    targets: Sequence[float] = TARGETS,
    seed: int = 0,
    cores: int | None = None,
    progress: Any = None,
) -> Benchmarked:
    """Run optimizers on the noiseless functions of BBOB; the same seed gives the same runs on any number of cores.

    `optimizers` is one as `tractexp.identify` takes it, a list of such, or a mapping of the names to call them by to
    such. Each run may make `multiplier` evaluations per dimension; `targets` are distances to the optimum; `cores` None
    means all. `progress`: None shows how many runs have ended, False does not; a callable is told of each.

    Raises `UserError` for wrong names or values, an optimizer that needs residuals, and without the extra [benchmark].
    """
    from tractexp.comparison.bbob import Plan, package, perform

    check(functions, instances, dimensions, multiplier, targets, cores)
    check_range("seed", seed, 0)
    chosen = Choice.several("optimizer", optimizers)
    tried = {one.name: one.build("optimizer") for one in chosen}
    for name, optimizer in tried.items():
        if optimizer.polish:
            raise UserError(
                f"optimizer {name} polishes by least squares, which need residuals that a BBOB function does not"
                " have; set optimizer.polish=false"
            )
    package()
    ordered = tuple(sorted(targets, reverse=True))
    plan = Plan(tuple(functions), tuple(dimensions), tuple(instances), multiplier, ordered, seed)
    with counting("runs", len(plan.cases) * len(tried), progress) as count:
        made = perform(tried, plan, cores, count)
    return Benchmarked(made, {one.name: one.node for one in chosen})


def check(
    functions: Sequence[int], instances: Sequence[int], dimensions: Sequence[int], multiplier: int,
    targets: Sequence[float], cores: int | None,
) -> None:  # fmt: skip
    """Raise `UserError` for settings out of range."""
    numbers = {
        "functions": (functions, 1, 24), "instances": (instances, 1, 10_000), "dimensions": (dimensions, 2, 100),
        "targets": (targets, 1e-12, 1e12),
    }  # fmt: skip
    for name, (values, low, high) in numbers.items():
        check_distinct(f"task.{name}", values)
        for value in values:
            check_range(f"task.{name}", value, low, high)
    check_range("task.multiplier", multiplier, 1)
    if cores is not None:
        check_range("task.cores", cores, 1)


def _tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
