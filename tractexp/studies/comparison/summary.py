"""How good and how fast each variant is: quartiles, the share at the noise floor, expected running
times.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.studies.comparison.floor import FLOOR_SHARE, Floor, Polished
from tractexp.studies.comparison.runs import SearchRun, Variant
from tractexp.studies.comparison.statistics import compute_expected_running_time

COSTS = ("simulations", "seconds")
ECDF_TARGETS = 1 + 10.0 ** np.arange(3.0, -2.01, -0.2)  # multiples of the floor: 1001 down to 1.01


@dataclass(frozen=True)
class Spread:
    """A sample in five numbers; nan where there is none."""

    best: float
    lower: float  # first quartile
    median: float
    upper: float  # third quartile
    worst: float

    @classmethod
    def from_values(cls, values: Sequence[float]) -> "Spread":
        """Best, quartiles and worst of some values; nan of none."""
        if not len(values):
            return cls(*[float("nan")] * 5)
        return cls(*map(float, np.quantile(values, (0, 0.25, 0.5, 0.75, 1))))


@dataclass(frozen=True)
class Summary:
    """One variant in figures. Spreads are over its finished runs, shares and ERT over all."""

    name: str
    runs: int
    failures: int
    objective: Spread
    epsilon_p: Spread
    epsilon_q: Spread
    simulations: Spread
    at_floor: float  # share of runs within 1 % of the floor
    # share of finished runs that ended in the floor's valley; None where that is not known
    in_valley: float | None
    ert: dict[str, list[float]]  # {"simulations": [one for each target], "seconds": [...]}


def summarize(
    variant: Variant, floor: Floor, targets: Sequence[float], polished: Polished | None = None
) -> Summary:
    """`targets` are multiples of the floor."""
    done = variant.finished_runs
    spreads = {
        key: Spread.from_values([getattr(run, key) for run in done])
        for key in ("objective", "epsilon_p", "epsilon_q")
    }
    reached = [run.objective <= (1 + FLOOR_SHARE) * floor.value for run in variant.runs]
    ert = {
        cost: [compute_running_time(variant, target * floor.value, cost) for target in targets]
        for cost in COSTS
    }
    simulations = Spread.from_values([run.simulations[-1] for run in done])
    failures = len(variant.runs) - len(done)

    return Summary(
        variant.name,
        len(variant.runs),
        failures,
        **spreads,
        simulations=simulations,
        at_floor=float(np.mean(reached)),
        in_valley=_share_in_valley(done, polished),
        ert=ert,
    )


def _share_in_valley(runs: Sequence[SearchRun], polished: Polished | None) -> float | None:
    """The share of runs that ended in the floor's valley; None where that is known of none."""
    inside = [] if polished is None else list(map(polished.in_valley, runs))
    known = [there for there in inside if there is not None]
    return float(np.mean(known)) if known else None


def compute_running_time(variant: Variant, target: float, cost: str) -> float:
    """ERT of a variant to an objective, in simulations or seconds."""
    spent = np.array([run.spent(target, cost) for run in variant.runs])
    reached = np.isfinite(spent)
    whole = np.array([_measure_whole_cost(variant, run, cost) for run in variant.runs])
    return compute_expected_running_time(np.where(reached, spent, whole), reached)


def _measure_whole_cost(variant: Variant, run: SearchRun, cost: str) -> float:
    """All that a run spent; a run that failed spent its budget, or what the others of its variant
    did.
    """
    if run.is_finished:
        return float(getattr(run, cost)[-1])
    if cost == "simulations" and variant.settings.get("budget"):
        return float(variant.settings["budget"])
    return float(np.median([getattr(other, cost)[-1] for other in variant.finished_runs] or [0.0]))


def list_runtimes(variant: Variant, floor: Floor) -> np.ndarray:
    """Simulations to each target of the ECDF in each run, (runs * targets,), sorted, inf where not
    reached.
    """
    return np.sort(
        [run.spent(m * floor.value, "simulations") for run in variant.runs for m in ECDF_TARGETS]
    )


@dataclass(frozen=True, eq=False)
class Band:
    """Quartiles over the runs of the best objective so far; all (n,)."""

    x: np.ndarray
    lower: np.ndarray
    median: np.ndarray
    upper: np.ndarray

    @property
    def top(self) -> float:
        """The upper end of an axis: the upper quartile after a fiftieth of the search. The very
        start is off the page.
        """
        return float(
            self.upper[np.searchsorted(self.x, self.x[0] + 0.02 * (self.x[-1] - self.x[0]))]
        )


def compute_band(variant: Variant, by: str, points: int = 300) -> Band:
    """The fitness curves of a variant's finished runs by "iterations" or "simulations".

    A run that ended earlier keeps its last objective. By simulations, the band starts where every
    run has one.
    """
    done = variant.finished_runs
    steps = [
        run.simulations if by == "simulations" else np.arange(len(run.history)) for run in done
    ]
    first = max(step[0] for step in steps)
    last = max(step[-1] for step in steps)
    spaced = np.geomspace if by == "simulations" else np.linspace  # as they are drawn
    x = np.unique(spaced(first, last, points).round())
    at = [
        run.history[np.searchsorted(step, x, side="right") - 1]
        for run, step in zip(done, steps, strict=True)
    ]
    return Band(x, *np.quantile(at, (0.25, 0.5, 0.75), axis=0))
