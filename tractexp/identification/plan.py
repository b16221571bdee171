"""Before the recording: what a dip would tell, how deep it must be, and which events of an archive
are worth fitting.

The information matrix needs no measurement, only the voltage, the noise and a guess of the
parameters.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.domain import PHASORS, Domain, find_domain
from tractexp.errors import TASK, UserError, check_range, list_allowed
from tractexp.inference.information import UNIFORM_PRECISION, Information
from tractexp.inference.interval import compute_interval_factor
from tractexp.inference.likelihood import Likelihood, estimate_noise_before
from tractexp.inference.model_error import weigh_error
from tractexp.inference.problem import Problem
from tractexp.model.drive import Drive
from tractexp.noise import Noise
from tractexp.noise.color import forgetting_noise
from tractexp.record import Event

BEFORE, AFTER = 0.3, 1.5  # s recorded before and after a planned dip
# whitened sensitivities beyond which a calculation has left all numbers that mean anything
LARGEST_SENSITIVITY = 1e100
DEPTHS = np.arange(0.05, 0.951, 0.025)
INERTIA = "H"  # H = M omega_s / 2 has the relative precision of M


@dataclass(frozen=True)
class DipShape:
    """A dip that might be recorded, from 1 pu, with trapezoidal edges. Noise [pu] forgets within
    `memory` [s].

    Of waveforms it is a dip of the positive sequence in which the voltage's phase jumps by `jump`
    [degrees], with a negative sequence of `unbalance` times its depth (0: balanced; 1: a fault
    between two phases, Bollen 2000, types C and D), and the noise is that of the currents alpha
    (noise_P) and beta (noise_Q).
    """

    depth: float
    duration: float  # s
    rate: float  # Hz
    noise_P: float
    noise_Q: float
    P0: float = 1.0
    Q0: float = 0.5
    frequency: float = 50.0
    memory: float = 0.0
    domain: Domain = PHASORS
    jump: float = 0.0
    unbalance: float = 0.0
    error: float = 0.0  # what the model misses of the response, beside the noise

    @classmethod
    def from_event(cls, event: Event, noise: Noise | None = None) -> "DipShape":
        """The shape of a recorded event, with the noise that a fit found there, or that before the
        dip.
        """
        noise = noise or Noise((estimate_noise_before(event),))
        domain = find_domain(event)
        (noise_P, noise_Q, *_), memory = noise.levels, noise.memory(event.record.step)
        return cls(
            event.depth,
            event.duration,
            event.rate,
            noise_P,
            noise_Q,
            event.P0,
            event.Q0,
            event.record.base.frequency,
            memory,
            domain,
            **domain.shape(event),
        )

    @property
    def noise(self) -> Noise:
        """Noise of what is compared at this rate: a first-order autoregression."""
        a = math.exp(-1 / (self.rate * self.memory)) if self.memory > 0 else 0.0
        P, Q = (forgetting_noise(level, a) for level in (self.noise_P, self.noise_Q))
        return Noise(((P, Q, P)[: len(self.domain.channels)],))

    def check(self, where: str = "task") -> None:
        """Raise `UserError` for what cannot be recorded."""
        check_range(f"{where}.depth", self.depth, 0.03, 0.95)
        check_range(f"{where}.duration", self.duration, 2 / self.rate, 10.0)
        check_range(f"{where}.rate", self.rate, self.domain.slowest(self.frequency), 20_000.0)
        check_range(f"{where}.jump", self.jump, -90.0, 90.0)
        check_range(f"{where}.unbalance", self.unbalance, 0.0, 1.0)
        if not min(self.noise_P, self.noise_Q) > 0:
            raise UserError(
                "the records show no noise before the dip, and without noise every interval is"
                " zero; give it as"
                f" {where}.noise, a fraction of P before the dip"
            )

    @property
    def still(self) -> "DipShape":
        """The same record without the dip."""
        return replace(self, depth=0.0, jump=0.0, unbalance=0.0)

    def event(self) -> Event:
        """The event as if it had been recorded."""
        step = 1 / self.rate
        t = np.arange(math.ceil((BEFORE + self.duration + AFTER) * self.rate)) * step
        edge = self.domain.edge
        fall, back = (np.clip((t - s) / edge, 0.0, 1.0) for s in (BEFORE, BEFORE + self.duration))
        start, end = (int(np.searchsorted(t, s)) for s in (BEFORE, BEFORE + self.duration + edge))
        name = f"{100 * self.depth:.0f} % for {1000 * self.duration:.0f} ms"
        return self.domain.plan_event(self, name, t, fall - back, start, end)


@dataclass(frozen=True, eq=False)
class IntervalForecast:
    """What recording a dip would tell of the parameters.

    Attributes
    ----------
    shape : DipShape
        The dip.
    names : names
        The d parameters.
    values : (d,)
        Their values, in their units.
    half : (d,)
        Half of the 95 % intervals to be expected.
    """

    shape: DipShape
    names: tuple[str, ...]
    values: np.ndarray
    half: np.ndarray

    @property
    def relative(self) -> np.ndarray:
        """(d,) half intervals as a share of the value; inf where not identifiable."""
        return self.half / np.maximum(np.abs(self.values), 1e-12)


def replace_events(problem: Problem, events: Sequence[Event]) -> Problem:
    """The same free parameters, bounds and fixed values on other events."""
    bounds = {p.name: p.bounds for p in problem.parameters}
    longest = problem.domain.longest_step(problem.events, problem.step.substeps)
    substeps = max(1, math.ceil(max(e.record.step for e in events) / longest - 1e-6))
    return Problem(problem.model, events, bounds, problem.fixed, substeps)


def forecast_intervals(
    problem: Problem,
    values: np.ndarray,
    shape: DipShape,
    earlier: Information | None = None,
    noise: Noise | None = None,
) -> IntervalForecast:
    """The intervals that `shape` would give at free `values` (d,), added to what is `earlier`
    already.

    `noise` replaces the shape's. Raises `UserError` where the values have no steady state, and for
    a model that reads more than a planned dip has.
    """
    if reads := problem.model.reads:
        readers = ", ".join(
            f"{part.group} '{part.name}' reads {channel}" for channel, part in reads.items()
        )
        raise UserError(
            f"a planned dip is a voltage alone, but of this model the {readers}: nothing can be"
            " planned with it"
        )
    planned = replace_events(problem, [shape.event()])
    informations = compute_event_informations(planned, values, noise or shape.noise)
    if shape.error:
        more = _weigh_model_error(planned, values, shape)
        informations = [replace(i, J=i.J / math.sqrt(1 + more)) for i in informations]
    total = add_information([*([earlier] if earlier else []), *informations])
    return IntervalForecast(
        shape, total.names, total.values, compute_interval_factor() * total.standard_errors
    )


def _weigh_model_error(planned: Problem, values: np.ndarray, shape: DipShape) -> float:
    """By how many times the noise's variance the model's error adds to it in a planned dip."""
    model = planned.model
    full = planned.full(values)
    still = Drive.from_events([planned.domain.excitation(shape.still.event(), model)])
    dip, rest = (
        model.simulate(drive, full, planned.step.substeps).outputs[:, 0]
        for drive in (planned.drive, still)
    )
    response = float(np.nanmean((dip - rest) ** 2))
    variance = (shape.noise_P**2 + shape.noise_Q**2) / 2
    return weigh_error(shape.error, response, variance, 1 / shape.rate)


def compute_event_informations(
    problem: Problem, values: np.ndarray, noise: Noise | None = None
) -> list[Information]:
    """The information of each event of a problem at free `values` (d,), its own P0 and Q0 unknown.

    Raises `UserError` where these values have no steady state before the first event.
    """
    if refusal := problem.model.refusal(problem.full(values)[0], problem.drive):
        raise UserError(f"nothing can be planned at these parameters: {refusal}")
    likelihood = Likelihood.from_problem(problem, noise)
    _, J = likelihood.jacobian(likelihood.to_unit(values)[0])
    width = problem.upper - problem.lower
    # a dip in which the motor stalls tells nothing
    diverges = not np.abs(J.columns).max() < LARGEST_SENSITIVITY
    rows = np.zeros_like(J.columns[: J.k].T) if diverges else J.without_own
    return [
        Information(problem.space.names, np.asarray(values), width, rows[own]) for own in J.rows
    ]


def add_information(informations: Sequence[Information]) -> Information:
    """The information of several independent records together."""
    return replace(informations[0], J=np.concatenate([i.J for i in informations]))


@dataclass(frozen=True, eq=False)
class Needed:
    """How deep a dip must be to tell a parameter.

    Attributes
    ----------
    parameter : str
        Its name.
    within : float
        The share of its value within which it is to be known.
    depth : float or None
        The depth needed; None where no dip is deep enough.
    depths, relative : arrays
        Depths that were tried, and half intervals over the value there.
    """

    parameter: str
    within: float
    depth: float | None
    depths: np.ndarray  # (n,) tried
    relative: np.ndarray  # (n,) half interval over value there

    def __str__(self) -> str:
        """ "a dip of 40 % gives H within 5 %", or that none of this kind does, and what the best
        gives.
        """
        best = int(np.argmin(self.relative))
        if self.depth is None:
            return (
                f"no dip of this kind gives {self.parameter} within {100 * self.within:g} %: the"
                " best, of"
                f" {100 * self.depths[best]:.0f} %, gives ± {100 * self.relative[best]:.2g} %"
            )
        return (
            f"a dip of {100 * self.depth:.0f} % gives {self.parameter} within {100 * self.within:g}"
            " %"
        )


def find_column(names: Sequence[str], parameter: str) -> int:
    """The column of a parameter, `H` standing for `M`; raises `UserError` for one that
    is not free.
    """
    name = "M" if parameter == INERTIA and "M" in names else parameter
    if name not in names:
        raise UserError(
            f"{TASK.parameter}={parameter} is not a free"
            f" parameter{list_allowed(parameter, [*names, INERTIA])}"
        )
    return list(names).index(name)


def forecast_over_depth(
    problem: Problem,
    values: np.ndarray,
    shape: DipShape,
    earlier: Information | None = None,
    noise: Noise | None = None,
) -> list[IntervalForecast]:
    """Forecasts for dips of every depth, otherwise of this `shape`."""
    return [
        forecast_intervals(problem, values, replace(shape, depth=float(d)), earlier, noise)
        for d in DEPTHS
    ]


def find_depth_needed(
    forecasts: Sequence[IntervalForecast], parameter: str, within: float
) -> Needed:
    """The shallowest of these dips whose 95 % interval is ± `within` of the parameter's value."""
    j = find_column(forecasts[0].names, parameter)
    depths, relative = np.array([(f.shape.depth, f.relative[j]) for f in forecasts]).T
    enough = np.flatnonzero(relative <= within)
    depth = None
    if len(enough):
        k = int(enough[0])
        depth = float(depths[k])
        if k and np.isfinite(relative[k - 1]):
            a, b = np.log(relative[k - 1 : k + 1])
            depth = float(
                depths[k - 1] + (np.log(within) - a) / (b - a) * (depths[k] - depths[k - 1])
            )
    return Needed(parameter, within, depth, depths, relative)


@dataclass(frozen=True)
class ChosenEvent:
    """One event of the best set, in the order of choice: by how much the intervals shrink with it,
    on average.
    """

    event: int
    name: str
    gain: float  # 1 - geometric mean of (width with it / width before); 1 for the first
    half: tuple[float, ...]  # half intervals of all parameters once it is added


def choose_best_events(
    problem: Problem, values: np.ndarray, least: float, most: int | None = None
) -> list[ChosenEvent]:
    """The events that tell most together at free `values` (d,), as `choose_best` does."""
    return choose_best(
        compute_event_informations(problem, values),
        [event.record.name for event in problem.events],
        least,
        most,
    )


def choose_best(
    informations: Sequence[Information], names: Sequence[str], least: float, most: int | None = None
) -> list[ChosenEvent]:
    """The events that tell most together, greedily by the determinant of the information
    (D-optimal).

    Ends before the event whose gain is below `least`, or after `most`. The parameters' bounds count
    as what is known beforehand, so that a set that leaves a parameter open still has a volume.
    """
    prior = np.eye(len(informations[0].names)) * UNIFORM_PRECISION
    matrices = [i.J.T @ i.J for i in informations]
    volume = lambda chosen: np.linalg.slogdet(prior + sum(matrices[e] for e in chosen))[1]  # noqa: E731
    chosen: list[int] = []
    choices: list[ChosenEvent] = []
    while len(chosen) < min(most or len(matrices), len(matrices)):
        rest = [e for e in range(len(matrices)) if e not in chosen]
        volumes = [volume([*chosen, e]) for e in rest]
        best = rest[int(np.argmax(volumes))]
        gain = 1 - math.exp((volume(chosen) - max(volumes)) / (2 * len(prior)))
        if chosen and gain < least:
            break
        chosen.append(best)
        half = (
            compute_interval_factor()
            * add_information([informations[e] for e in chosen]).standard_errors
        )
        choices.append(
            ChosenEvent(best, names[best], gain if len(chosen) > 1 else 1.0, tuple(half.tolist()))
        )
    return choices


def compute_own_information(problem: Problem, values: np.ndarray) -> Information:
    """The information of a problem's only event at free `values` (d,), in as few rows as there are
    parameters.

    Of an archive, event by event: their Jacobian together, with P0 and Q0 of each, would not fit
    into memory.
    """
    (information,) = compute_event_informations(problem, values)
    return replace(information, J=np.linalg.qr(information.J, mode="r"))
