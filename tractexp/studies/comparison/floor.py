"""The floor of a comparison: the lowest objective that least squares reach, from the runs' ends and
all over the box.

The best of the runs is no floor: where all searches stop short of the bottom, or in the wrong
valley, it is too high.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.identification.search import REFUSED
from tractexp.inference.least_squares import MOST_NUMBERS, descend
from tractexp.inference.problem import Problem
from tractexp.parameter import best_distinct, spread_evenly
from tractexp.studies.comparison.runs import SearchRun
from tractexp.text.wording import count_noun

FLOOR_SHARE = 0.01  # what ends within this share of the floor has reached it
# starts: the best of a scatter that differ by so much of a range somewhere
SCATTER, STARTS, APART = 400, 60, 0.3
# iterations of a descent, and the share of the objective that a step must gain
BRIEF, ROUGH = 60, 1e-3
WHOLE, FINE = 200, 1e-9  # of the last descent, from the lowest
DESCENTS_AT_ONCE = 64  # descents at once, where their residuals are no more than MOST_NUMBERS
TINY = 1e-300  # pu²: a fit without any error is scaled by it
SAME_PROBLEM_TOLERANCE = 1e-2  # relative: objectives this close are those of the same problem


@dataclass(frozen=True)
class Floor:
    """The objective that the noise leaves, and where that number comes from."""

    value: float
    source: str


@dataclass(frozen=True, eq=False)
class Polished:
    """The lowest point found, and for each run whose parameters are known what least squares reach
    from its end.
    """

    objective: float  # pu²
    parameters: dict[str, float]
    bounds: dict[str, tuple[float, float]]
    units: dict[str, str]
    starts: int  # spread over the box
    reached: dict[SearchRun, float]  # pu²

    def in_valley(self, run: SearchRun) -> bool | None:
        """Whether the run ended in the valley of the lowest point; None where that is not known."""
        return (
            self.reached[run] <= (1 + FLOOR_SHARE) * self.objective if run in self.reached else None
        )


def polish(
    problem: Problem, runs: Sequence[SearchRun], counting: Callable[[int], Callable[[], None]]
) -> Polished | None:
    """Descend on the objective of Eq. (8) from the end of every run, and from starts that fill the
    box evenly.

    `counting(n)` is told how many groups of descents there are, and returns what is called at the
    end of each. None where the objectives of the runs are not those of this problem: the records
    have changed since.
    """
    space = problem.space
    complete = [run for run in runs if run.is_finished and set(space.names) <= set(run.parameters)]
    ends = np.array([[run.parameters[name] for name in space.names] for run in complete]).reshape(
        -1, space.dimension
    )
    if not problem.per_event and not _is_same_problem(problem, ends, complete):
        return None
    units = np.concatenate([space.to_unit(ends), _spread_points(problem)])
    best = max(min(run.objective for run in runs if run.is_finished), TINY)
    groups = np.array_split(units, -(-len(units) // _count_parallel_descents(problem)))
    ended, values, count = [], [], counting(len(groups))
    for group in groups:
        unit, objectives = _descend(problem, group, best, BRIEF, ROUGH)
        ended.append(unit)
        values.append(objectives)
        count()
    unit, objectives = np.concatenate(ended), np.concatenate(values)
    lowest, (least,) = _descend(
        problem, unit[[objectives.argmin()]], max(objectives.min(), TINY), WHOLE, FINE
    )
    units_of = {p.name: p.unit for p in problem.parameters}
    parameters = dict(zip(space.names, map(float, space.from_unit(lowest)[0]), strict=True))
    limits = np.column_stack((space.lower, space.upper)).tolist()
    bounds = {name: (low, high) for name, (low, high) in zip(space.names, limits, strict=True)}
    return Polished(
        float(least),
        parameters,
        bounds,
        {n: units_of[n.partition("[")[0]] for n in space.names},
        len(units) - len(complete),
        dict(zip(complete, map(float, objectives[: len(complete)]), strict=True)),
    )


def find_floor(
    runs: Sequence[SearchRun], value: float | None, polished: Polished | None, why_not: str = ""
) -> Floor:
    """The floor as `value`, or what polishing found, or the best of all runs where there was no
    polishing, and why.
    """
    if value is not None:
        return Floor(value, "as given by task.floor")
    best = min((run for run in runs if run.is_finished), key=lambda run: run.objective)
    if polished is not None:
        n = len(polished.reached)
        ends = f"where {count_noun(n, 'run')} ended and from " if n else ""
        source = (
            f"the lowest that least squares reach from {ends}{polished.starts} starts all over the"
            " bounds"
        )
        return Floor(min(polished.objective, best.objective), source)
    because = f"; nothing lower was looked for, because {why_not}" if why_not else ""
    return Floor(best.objective, f"the best of all runs compared, by {best.optimizer}{because}")


def _is_same_problem(problem: Problem, ends: np.ndarray, runs: Sequence[SearchRun]) -> bool:
    """Whether a problem gives the objectives that runs recorded at their ends."""
    recorded = np.array([run.objective for run in runs])
    return (
        bool(np.allclose(problem.objective(ends), recorded, rtol=SAME_PROBLEM_TOLERANCE, atol=0))
        if len(runs)
        else True
    )


def _spread_points(problem: Problem) -> np.ndarray:
    """The best (k, d) of points that fill the unit cube evenly, but denser near its bounds, where
    times are short.
    """
    unit = np.sin(np.pi * spread_evenly(SCATTER, problem.space.dimension) / 2) ** 2
    objectives = problem.objective(problem.space.from_unit(unit))
    able = objectives < REFUSED
    return unit[able][best_distinct(unit[able], objectives[able], APART, STARTS)]


def _count_parallel_descents(problem: Problem) -> int:
    """How many descents are held at once: each tries several steps, with a residual for P and Q of
    every sample.
    """
    return int(np.clip(MOST_NUMBERS // (8 * problem.drive.samples), 1, DESCENTS_AT_ONCE))


def _descend(
    problem: Problem, start: np.ndarray, scale: float, iterations: int, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Where descents from unit points (n, d) end, and their objectives (n,); `tolerance` is a share
    of `scale`.
    """

    def rows(unit: np.ndarray, lanes: np.ndarray) -> np.ndarray:
        return problem.residuals(problem.space.from_unit(unit)) / np.sqrt(scale)

    ended = descend(rows, start, iterations=iterations, tolerance=tolerance)
    return ended.unit, ended.deviance * scale
