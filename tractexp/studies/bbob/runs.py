"""Optimizers on BBOB, 24 functions with known optima that nobody here wrote. Needs the extra
[benchmark].

Source: Hansen, Finck, Ros and Auger 2009 (the functions), as implemented by the package `ioh`;
running times to targets and independent restarts as in Hansen et al. 2021 (COCO).
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.errors import UserError, name_setting
from tractexp.identification.optimizer import Optimizer
from tractexp.identification.search import Limits, search
from tractexp.process.workers import Workers
from tractexp.studies.comparison.statistics import compute_expected_running_time

GROUPS = {
    "separable": range(1, 6),
    "moderate": range(6, 10),
    "ill-conditioned": range(10, 15),
    "many valleys": range(15, 20),
    "weak structure": range(20, 25),
}
FUNCTIONS = range(1, 25)


def import_package() -> Any:
    """The package `ioh`; raises `UserError` where it is not installed."""
    try:
        import ioh
    except ImportError as error:
        raise UserError(
            f"{name_setting('task=benchmark')} needs the package 'ioh', which is not installed: pip"
            " install 'tractexp[benchmark]'"
        ) from error
    return ioh


class Bbob:
    """One instance of one function as a problem of the search loop, on the box [-5, 5].

    Notes the number of evaluations at which each target, given as a distance to the optimum (k,),
    was first met: `hits` (k,), inf before.
    """

    def __init__(self, function: int, dimension: int, instance: int, targets: Sequence[float]):
        """A function of BBOB in one instance, with the targets that are counted."""
        ioh = import_package()
        self.problem: Any = ioh.get_problem(function, instance, dimension, ioh.ProblemClass.BBOB)
        self.name: str = self.problem.meta_data.name
        self.lower, self.upper = np.array(self.problem.bounds.lb), np.array(self.problem.bounds.ub)
        self.optimum = float(self.problem.optimum.y)
        self.goals = self.optimum + np.asarray(targets, dtype=float)
        self.hits = np.full(len(self.goals), np.inf)
        self.evaluations, self.best = 0, np.inf

    def objective(self, values: np.ndarray) -> np.ndarray:
        """Points (n, d) -> the function's values (n,)."""
        f = np.array(self.problem(values))
        lowest = float(f.min())
        if lowest < self.best:
            self.best = lowest
            new = np.isinf(self.hits) & (lowest <= self.goals)
            self.hits[new] = self.evaluations + 1 + (f[:, None] <= self.goals[new]).argmax(axis=0)
        self.evaluations += len(f)
        return f

    def residuals(self, values: np.ndarray) -> np.ndarray:
        """Raise `UserError`: a function of BBOB is no sum of squares."""
        raise UserError(
            "a BBOB function is no sum of squares, so least squares have no residuals to work on;"
            " choose another optimizer, without optimizer.polish"
        )

    @property
    def is_solved(self) -> bool:
        """Whether the last target is met."""
        return bool(np.isfinite(self.hits).all())


@dataclass(frozen=True)
class BbobPlan:
    """The runs to make: every optimizer on each function, dimension and instance."""

    functions: tuple[int, ...]
    dimensions: tuple[int, ...]
    instances: tuple[int, ...]
    multiplier: int  # evaluations per dimension that a run may make
    targets: tuple[float, ...]  # distances to the optimum, the largest first
    seed: int

    @property
    def cases(self) -> list[tuple[int, int, int]]:
        """(function, dimension, instance), the dimensions that take longest first."""
        order = sorted(self.dimensions, reverse=True)
        return [(f, d, i) for d in order for f in self.functions for i in self.instances]


@dataclass(frozen=True)
class BbobRun:
    """One optimizer on one instance of one function, with independent restarts until the budget was
    spent.
    """

    optimizer: str
    function: int
    dimension: int
    instance: int
    evaluations: int
    searches: int
    distance: float  # of the best value to the optimum
    hits: tuple[float, ...]  # evaluations to each target, inf where it was not met


def compute_seed(seed: int, *counts: int) -> int:
    """The seed of one search: the same for all optimizers, another for each case and restart."""
    return int(np.random.SeedSequence((seed, *counts)).generate_state(1, np.uint64)[0])


def run(name: str, optimizer: Optimizer, case: tuple[int, int, int], plan: BbobPlan) -> BbobRun:
    """Search, and search again from new random numbers, until the last target is met or the budget
    spent.
    """
    function, dimension, instance = case
    problem = Bbob(function, dimension, instance, plan.targets)
    budget, searches = plan.multiplier * dimension, 0
    while problem.evaluations < budget and not problem.is_solved:
        limits = Limits(simulations=budget - problem.evaluations, target=float(problem.goals.min()))
        search(problem, optimizer, compute_seed(plan.seed, *case, searches), limits)
        searches += 1
    distance = problem.best - problem.optimum
    return BbobRun(
        name, *case, problem.evaluations, searches, distance, tuple(problem.hits.tolist())
    )


def _run_case(job: tuple[str, Optimizer, tuple[int, int, int], BbobPlan]) -> BbobRun:
    """One run of an optimizer on a case of a plan."""
    return run(*job)


def perform(
    optimizers: Mapping[str, Optimizer],
    plan: BbobPlan,
    cores: int | None = None,
    count: Callable[[], None] = lambda: None,
) -> "BbobRuns":
    """Run all of it on `cores` processes (None: all there are); the runs do not depend on how many.

    `count()` is called as each run ends.
    """
    titles = {
        f: Bbob(f, plan.dimensions[0], plan.instances[0], plan.targets).name for f in plan.functions
    }
    jobs = [(name, it, case, plan) for case in plan.cases for name, it in optimizers.items()]
    runs = {}
    for _, r in Workers(cores or -1).run_items(_run_case, jobs, len(jobs)):
        count()
        runs[r.optimizer, r.dimension, r.function, r.instance] = r
    ordered = [
        runs[name, d, f, i]
        for name in optimizers
        for d in plan.dimensions
        for f in plan.functions
        for i in plan.instances
    ]
    return BbobRuns(plan, tuple(optimizers), titles, ordered)


@dataclass(frozen=True)
class BbobRuns:
    """All runs, and what they come to."""

    plan: BbobPlan
    optimizers: tuple[str, ...]
    titles: Mapping[int, str]  # of the functions
    runs: Sequence[BbobRun]

    def select_runs(
        self, optimizer: str, dimension: int, functions: Iterable[int]
    ) -> list[BbobRun]:
        """The runs of an optimizer in one dimension on some functions."""
        among = set(functions)
        return [
            r
            for r in self.runs
            if (r.optimizer, r.dimension) == (optimizer, dimension) and r.function in among
        ]

    def groups(self) -> dict[str, list[int]]:
        """The functions of each of COCO's five groups, groups without any left out."""
        chosen = {
            name: [f for f in self.plan.functions if f in group] for name, group in GROUPS.items()
        }
        return {name: functions for name, functions in chosen.items() if functions}

    def hits(self, optimizer: str, dimension: int, functions: Iterable[int]) -> np.ndarray:
        """Evaluations to every target in every run, (runs * targets,), sorted, inf where not met:
        an ECDF's steps.
        """
        return np.sort(
            [n for r in self.select_runs(optimizer, dimension, functions) for n in r.hits]
        )

    def share(self, optimizer: str, dimension: int, functions: Iterable[int]) -> float:
        """The share of all targets that was met."""
        return float(np.isfinite(self.hits(optimizer, dimension, functions)).mean())

    def count_solved(self, optimizer: str, dimension: int) -> int:
        """The number of functions whose last target was met on every instance."""
        runs = {f: self.select_runs(optimizer, dimension, [f]) for f in self.plan.functions}
        return sum(all(np.isfinite(r.hits[-1]) for r in group) for group in runs.values())

    def ert(self, optimizer: str, dimension: int, function: int, target: int) -> tuple[float, int]:
        """Expected running time in evaluations to the target of that index, and the runs that met
        it.
        """
        runs = self.select_runs(optimizer, dimension, [function])
        spent = np.array([r.hits[target] for r in runs])
        reached = np.isfinite(spent)
        whole = np.array([r.evaluations for r in runs], dtype=float)
        return compute_expected_running_time(np.where(reached, spent, whole), reached), int(
            reached.sum()
        )
