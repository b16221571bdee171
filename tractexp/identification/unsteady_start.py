"""A load that was not steady before its dip, as a machine that still accelerates.

Where the record before a dip shows one, speed and flux at its first sample are free numbers of the
event beside the parameters, and what the load draws once it is at rest. Told is what that explains
and which parameters go with it, where it leaves less before the dips than straight drifts do.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.identification.fit import Fit, play
from tractexp.identification.load_drift import find_load_drifts
from tractexp.identification.uncertainty import Uncertainty
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.model_error import compute_model_error
from tractexp.inference.multistart import explore_minima
from tractexp.inference.problem import Problem
from tractexp.model.parts import OWN, Effect
from tractexp.parameter import Parameter
from tractexp.record import Event

if TYPE_CHECKING:
    import sympy

    from tractexp.model.equations import Equations

START_SOURCE = "between standstill and somewhat above synchronous speed"
START_UNSEEN = 4  # samples within which the start is set: they are not compared
START_SETTLED = 0.1  # of the record: its end, where a machine has come to rest


class UnsteadyStart(Effect):
    """Speed and flux of the motor that differ at the record's first sample from those at rest.

    Within two samples the states are moved by the offsets, and from there on they are free. At 0
    the base model.
    """

    name = "unsteady_start"
    parameters = (
        Parameter(0.0, (-0.6, 0.05), "1", "speed", START_SOURCE, null=0.0, name="start_speed"),
        Parameter(0.0, (-1.2, 0.4), "pu", "flux", START_SOURCE, null=0.0, name="start_flux_d"),
        Parameter(0.0, (-1.0, 1.0), "pu", "flux", START_SOURCE, null=0.0, name="start_flux_q"),
    )

    def __repr__(self) -> str:
        """ "UnsteadyStart()": all are alike, and are stored under this name."""
        return "UnsteadyStart()"

    def edit(  # type: ignore[override]
        self,
        eq: "Equations",
        start_speed: "sympy.Expr",
        start_flux_d: "sympy.Expr",
        start_flux_q: "sympy.Expr",
    ) -> None:
        """Add the offsets to what moves speed and flux in the first two samples."""
        import sympy  # where no kernel is stored yet: it takes as long as NumPy and SciPy together

        push = sympy.Max(0, 1 - sympy.Abs(eq.t / eq.step - 1)) / eq.step
        offsets = {
            "speed": start_speed * eq.omega_n,
            "flux": start_flux_d + sympy.I * start_flux_q,
        }
        for state in eq.states.values():
            if state.writer == OWN and state.role in offsets:
                state.derivative += push * offsets[state.role]


@dataclass(frozen=True)
class StartFit:
    """How events began that were not steady: the speed of each at its first sample, a share of
    nominal from that at rest, the model's error [%] with and without it, and the parameters beside
    it.
    """

    speeds: dict[str, float]
    error: float
    error_without: float
    parameters: dict[str, float]

    def to_dict(self) -> dict[str, Any]:
        """As `result.json` has it."""
        return {**vars(self), "sentence": str(self)}

    def __str__(self) -> str:
        speeds = ", ".join(f"{name} {100 * speed:+.2g} %" for name, speed in self.speeds.items())
        values = ", ".join(f"{name} {value:.4g}" for name, value in self.parameters.items())
        return (
            f"the motor was not at rest when the record began (speed from that at rest: {speeds}):"
            f" so {self.error:.2g} % of the response is left, {self.error_without:.2g} % of a"
            f" steady start, and the parameters are {values}"
        )


def find_unsteady_start(uncertainty: Uncertainty) -> StartFit | None:
    """The start that explains what the load does before its dips; None where the records show none,
    and where straight drifts of P and Q explain it as well.
    """
    problem = uncertainty.likelihood.problem
    if not any(drift.any() for drift in find_load_drifts(uncertainty)):
        return None
    free = _free_starts(problem)
    if free is None:
        return None
    likelihood = Likelihood.of_objective(free, _measure_left(uncertainty)).with_initial_power
    unit = likelihood.descent(explore_minima(likelihood).unit).best
    left = likelihood.residuals(unit[None])[0]
    if not _count_squares(free, left) < _count_squares_of_lines(uncertainty):
        return None
    told = _tell(uncertainty, likelihood, unit)
    return told if told.error <= told.error_without else None


def _free_starts(problem: Problem) -> Problem | None:
    """The problem with the starts of its events free; None for a load without a motor whose speed
    and flux move.
    """
    model = problem.model
    own_states = [s for s in model.equations.states.values() if s.writer == OWN]
    if not {"speed", "flux"} <= {s.role for s in own_states if s.derivative != 0}:
        return None
    started = model.extend([UnsteadyStart()])
    own = [parameter.name for parameter in UnsteadyStart.parameters]
    return Problem(
        started,
        [_expect_rest(event) for event in problem.events],
        {parameter.name: parameter.bounds for parameter in problem.parameters},
        problem.fixed,
        int(problem.step.substeps.max()),
        [*problem.per_event, *own],
        problem.loss,
    )


def _expect_rest(event: Event) -> Event:
    """The event at rest as it is at the record's end, its first samples gaps."""
    record = event.record
    last = round((1 - START_SETTLED) * record.samples)
    rest = {f"{name}0": float(np.nanmean(getattr(record, name)[last:])) for name in "PQ"}
    seen = np.arange(record.samples) >= START_UNSEEN
    P, Q = (np.where(seen, row, np.nan) for row in (record.P, record.Q))
    return replace(event, record=replace(record, P=P, Q=Q), **rest)


def _measure_left(uncertainty: Uncertainty) -> float:
    """The objective [pu²] of the estimate."""
    return float(uncertainty.likelihood.problem.objective(uncertainty.values[None])[0])


def _list_before(problem: Problem, left: np.ndarray) -> list[np.ndarray]:
    """What is left (2, n) [pu] of each event before its dip, of (2, N)."""
    rows = []
    for e, event in enumerate(problem.events):
        first = max(event.steady.start, START_UNSEEN)
        rows.append(left[:, problem.drive.part(e)][:, first : event.steady.stop])
    return rows


def _count_squares(problem: Problem, left: np.ndarray) -> float:
    """The sum of squares [pu²] of what is left (2, N) before the dips."""
    return sum(float(np.sum(rows**2)) for rows in _list_before(problem, left))


def _count_squares_of_lines(uncertainty: Uncertainty) -> float:
    """The same of the estimate, where P and Q of each event may drift along straight lines."""
    likelihood = uncertainty.likelihood.of_records
    left = likelihood.residuals(uncertainty.unit[None])[0]
    squares = 0.0
    for rows in _list_before(likelihood.problem, left):
        t = np.arange(rows.shape[1])
        lines = np.polynomial.polynomial.polyfit(t, rows.T, 1)
        squares += float(np.sum((rows - np.polynomial.polynomial.polyval(t, lines)) ** 2))
    return squares


def _tell(uncertainty: Uncertainty, likelihood: Likelihood, unit: np.ndarray) -> StartFit:
    """What the start at coordinates (D,) explains."""
    problem, steady = likelihood.problem, uncertainty.likelihood.problem
    values = likelihood.values(unit)
    own = problem.by_event(values)[:, 0]
    at = problem.model.names.index("start_speed")
    names = [event.record.name for event in problem.events]
    found = dict(zip(problem.space.names, values.tolist(), strict=True))
    return StartFit(
        dict(zip(names, own[:, at].tolist(), strict=True)),
        100 * compute_model_error(_play_started(likelihood, unit)).value,
        100 * compute_model_error(play(steady, uncertainty.values)).value,
        {name: found[name] for name in uncertainty.names},
    )


def _play_started(likelihood: Likelihood, unit: np.ndarray) -> list[Fit]:
    """The events from the starts at coordinates (D,) on."""
    problem = likelihood.problem
    power = likelihood.free_set.box.from_unit(unit)[likelihood.free_set.before].reshape(-1, 2)
    events = [
        replace(event, P0=float(P), Q0=float(Q))
        for event, (P, Q) in zip(problem.events, power, strict=True)
    ]
    return play(problem.driven_by(events), likelihood.values(unit))
