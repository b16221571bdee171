"""Table 1 in measured numbers: one load, three orders of its motor, the same records."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.configuration.plugin import build
from tractexp.identification.estimate import estimate
from tractexp.identification.fit import Fit, respond
from tractexp.identification.result import build_parts
from tractexp.identification.search import search
from tractexp.identification.uncertainty import Uncertainty
from tractexp.identification.verdict import IDENTIFIED
from tractexp.inference.problem import Problem
from tractexp.model.model import compose
from tractexp.model.operations import Cost, Operations, count
from tractexp.record import Event

# simulated together when the time is taken: some milliseconds, less than a turn of a busy core
TIMED_CANDIDATES = 256
TIMED_REPEATS = 60  # of which the fastest counts


@dataclass(frozen=True, eq=False)
class Order:
    """One motor fitted to the records. `fits` are those of the fitted events, then of the held-out
    ones.
    """

    motor: str
    values: dict[str, float]
    objective: float
    fits: tuple[Fit, ...]
    uncertainty: Uncertainty
    nanoseconds: float  # per simulated sample and candidate
    substeps: int
    cost: Cost  # counted in the kernel

    @property
    def step(self) -> Operations:
        """The operations of one Runge-Kutta step of a candidate."""
        return self.cost.step

    @property
    def per_sample(self) -> Operations:
        """The operations of a sample of a candidate with all its steps, the errors summed."""
        return self.cost.per_sample(self.substeps)

    @property
    def free(self) -> int:
        """How many parameters are free."""
        return len(self.uncertainty.names)

    @property
    def finite(self) -> int:
        """Parameters whose 95 % interval is finite and within the bounds."""
        low, high = (
            self.uncertainty.values - self.uncertainty.half,
            self.uncertainty.values + self.uncertainty.half,
        )
        return int(
            np.count_nonzero((low > self.uncertainty.lower) & (high < self.uncertainty.upper))
        )

    @property
    def identified_count(self) -> int:
        """How many of them are identified."""
        return sum(verdict.word == IDENTIFIED for verdict in self.uncertainty.verdicts.values())

    @property
    def condition(self) -> float:
        """The condition number of the information matrix, parameters in units of their ranges."""
        return float(np.linalg.cond(self.uncertainty.information.J) ** 2)

    def spread(self, role: str) -> tuple[float, float]:
        """Root mean square over the events of a role of epsilon_p and of epsilon_q, fractions."""
        errors = np.array([(f.epsilon_p, f.epsilon_q) for f in self.fits if f.role == role])
        P, Q = np.sqrt(np.mean(errors**2, axis=0)) if len(errors) else (np.nan, np.nan)
        return float(P), float(Q)


def fit(
    node: Mapping[str, Any],
    motor: str,
    train: Sequence[Event],
    held_out: Sequence[Event],
    seed: int,
) -> Order:
    """Fit a model configuration with its motor replaced, by least squares from many starts."""
    model = compose(*build_parts({**node, "motor": {"name": motor}}))
    bounds, fixed = (
        {n: v for n, v in node[key].items() if n in model.names} for key in ("bounds", "fixed")
    )
    problem = Problem(model, train, bounds, fixed, node["substeps"])
    result = search(problem, build("optimizer", {"name": "multistart_least_squares"}), seed)
    values = problem.full(result.values)[0]
    fits = [respond(model, values, event, "train") for event in train]
    fits += [respond(model, values, event, "validate") for event in held_out]
    substeps = int(problem.step.substeps.max())
    parameters = dict(zip(model.names, values.tolist(), strict=True))
    uncertainty, cost = estimate(problem, result.values).uncertainty, count(model.source)
    return Order(
        motor,
        parameters,
        result.objective,
        tuple(fits),
        uncertainty,
        measure_duration(problem),
        substeps,
        cost,
    )


def measure_duration(problem: Problem) -> float:
    """Nanoseconds per sample of one candidate's simulation, objective included: the fastest of some
    repeats.
    """
    rng = np.random.default_rng(0)
    values = problem.space.from_unit(rng.random((TIMED_CANDIDATES, problem.space.dimension)))
    spent = []
    for _ in range(TIMED_REPEATS):
        started = time.perf_counter()
        problem.objective(values)
        spent.append(time.perf_counter() - started)
    return 1e9 * min(spent) / TIMED_CANDIDATES / problem.drive.samples
