"""The paper's load, a third-order motor beside an exponential static part: numbers in, P and Q out,
for methods that search by themselves.
"""

from collections.abc import Sequence

import numpy as np
from cases import Event

import tractexp
from tractexp.configuration.plugin import build
from tractexp.identification.fit import respond
from tractexp.inference.problem import Problem
from tractexp.model.model import compose
from tractexp.record import Event as Dip

FAILED = 1e6  # pu², of a load without a steady state


def read_dip(event: Event) -> Dip:
    """The event as the product reads it; unknown power is that before the dip."""
    before = event.power_before
    P, Q = (np.nan_to_num(x, nan=y) for x, y in ((event.P, before.real), (event.Q, before.imag)))
    columns = {"t": event.t, "U": event.U, "P": P, "Q": Q}
    if event.f is not None:
        columns["f"] = event.f
    return tractexp.read(**columns, name=event.name, frequency=event.frequency)[0]


class ThirdOrderLoad:
    """Errors of candidate parameters on some events, and what parameters make of another."""

    def __init__(self, events: Sequence[Event]) -> None:
        motor = build("model/motor", {"name": "electromechanical"})
        static = build("model/static", {"name": "exponential"})
        self.problem = Problem(compose(motor, static), [read_dip(event) for event in events])
        self.lower, self.upper = self.problem.lower, self.problem.upper

    def measure_errors(self, values: np.ndarray) -> np.ndarray:
        """Mean squared error (n,) of P and Q [pu²] of candidates (n, d)."""
        return np.minimum(self.problem.objective(np.atleast_2d(values)), FAILED)

    def find_residuals(self, values: np.ndarray) -> np.ndarray:
        """Calculated less measured P and Q (2 N,) [pu] of one candidate (d,)."""
        problem = self.problem
        full = problem.full(values[None])
        calculated = problem.model.simulate(problem.drive, full, problem.step.substeps).outputs
        left = calculated[:, 0] - problem.drive.measurements
        return np.nan_to_num(left, nan=1.0).ravel()

    def predict(self, values: np.ndarray, event: Event) -> tuple[np.ndarray, np.ndarray]:
        """P and Q (N,) [pu] that the load with these parameters draws."""
        fit = respond(self.problem.model, self.problem.full(values[None])[0], read_dip(event), "")
        return fit.P, fit.Q
