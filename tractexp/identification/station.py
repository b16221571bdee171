"""All dips of one load: the constants of its machines, which all share, and the share of the motors
in each.

The torques are taken out of the normal equations event by event (`SeparableColumns`), so that time
grows with the number of dips and no faster. How far the constants scatter is told by leaving out
one dip at a time. A dip that the others' model misses by far is left out, and told.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime

import numpy as np

from tractexp.errors import UserError
from tractexp.identification.composition import Composition, estimate_composition
from tractexp.identification.fit import TRAIN, VALIDATE, Fit, explain_refusal, respond
from tractexp.inference.blocks import cut_blocks
from tractexp.inference.differences import compute_central_differences
from tractexp.inference.least_squares import descend
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.model_error import compute_model_error
from tractexp.inference.multistart import search_box
from tractexp.inference.prediction_band import PredictionBand, measure_band
from tractexp.inference.sized_problem import SizedProblem
from tractexp.model.model import Model
from tractexp.record import Event, measure_promise

MOST_BEGUN = 4  # dips that the first fit, from all over the box, is made to
# dips that constants are fitted to, those of the greatest depth over noise
MOST_FITTED_DIPS = 300
TRIED_TORQUES = 9  # in the range of the torque, at which each dip is tried first
FEWEST_JUDGED_DIPS = 5  # of which one can be odd
# an odd dip is missed by so much of its response, by so many times the median error, and lies so
# many deviations above it
LEAST_ODD, ODD_RATIO, ODD_DEVIATIONS = 0.03, 2.0, 6.0
MOST_ROUNDS = 3  # of leaving odd dips out and fitting again
GROWTH = 1.5  # by which dips become more until constants are fitted again, as the years go
SMALLEST_SQUARE = 1e-30  # of what tells nothing


@dataclass(frozen=True, eq=False)
class StationDip:
    """One dip of a load, per unit of what the load drew before it, and when it was."""

    event: Event
    when: datetime | None = None

    @property
    def promise(self) -> float:
        """How much it may tell: its depth over its noise."""
        return measure_promise(self.event.depth, self.event.noise_share)


@dataclass(frozen=True, eq=False)
class LoadSpec:
    """The model of a load, what is known of its parameters, and the name of the load."""

    name: str
    model: Model
    bounds: Mapping[str, Sequence[float]]
    fixed: Mapping[str, float]
    substeps: int | None = None
    _steps: dict[Event, int] = field(default_factory=dict, init=False, repr=False)

    def pose(self, events: Sequence[Event]) -> SizedProblem:
        """The problem of some of its dips, each of which has the same Runge-Kutta steps in all."""
        steps = [self._count_steps(event) for event in events]
        return SizedProblem(self.model, events, self.bounds, self.fixed, steps)

    def _count_steps(self, event: Event) -> int:
        """The steps per sample of a dip, chosen where it is first met."""
        if event not in self._steps:
            alone = SizedProblem(self.model, [event], self.bounds, self.fixed, self.substeps)
            self._steps[event] = int(alone.step.substeps[0])
        return self._steps[event]


@dataclass(frozen=True, eq=False)
class SharedFit:
    """Constants fitted to dips. `torques` (E,) [pu] are those of the motors in all dips, with
    standard errors; `odd` {position of a dip: why it was left out}.
    """

    problem: SizedProblem
    values: np.ndarray
    dips: Sequence[StationDip]
    torques: np.ndarray
    errors: np.ndarray
    fits: Sequence[Fit]
    odd: Mapping[int, str] = field(default_factory=dict)

    @property
    def constants(self) -> np.ndarray:
        """(k,), of motors that draw the problem's reference."""
        return self.values[self.problem.constants]

    @property
    def shares(self) -> np.ndarray:
        """The motors' parts (E,) of the active power before the dips."""
        return self.torques / self.powers

    @property
    def share_errors(self) -> np.ndarray:
        """Their standard errors (E,)."""
        return self.errors / self.powers

    @property
    def powers(self) -> np.ndarray:
        """P (E,) [pu] before the dips."""
        return np.array([dip.event.P0 for dip in self.dips])

    @property
    def regular(self) -> list[int]:
        """Positions of the dips that are not odd."""
        return [k for k in range(len(self.dips)) if k not in self.odd]

    def estimate_composition(self) -> Composition:
        """How the share differs from dip to dip."""
        kept = self.regular
        times = [self.dips[k].when for k in kept]
        return estimate_composition(self.shares[kept], self.share_errors[kept], times)

    def spell_parameters(self, torque: float) -> np.ndarray:
        """All parameters (d,) of the model where the motors draw so much [pu]."""
        return spell_parameters(self.problem, self.constants, torque)


def spell_parameters(problem: SizedProblem, constants: np.ndarray, torque: float) -> np.ndarray:
    """All parameters (d,) of the model by its constants (k,), where motors draw so much [pu]."""
    values = np.empty(problem.space.dimension)
    values[problem.constants] = constants
    values[problem.shares] = torque
    return problem.full(values)[0]


def fit_dips(
    spec: LoadSpec, dips: Sequence[StationDip], start: np.ndarray | None = None
) -> SharedFit:
    """The fit to all dips, odd ones left out; `start` are constants (k,) to begin at.

    Raises `UserError` where nothing in the bounds can be simulated.
    """
    odd: dict[int, str] = {}
    fit = _fit_regular(spec, dips, odd, start)
    for _ in range(MOST_ROUNDS):
        found = _find_odd(fit, odd)
        if found.keys() <= odd.keys():
            break
        odd |= found
        fit = _fit_regular(spec, dips, odd, fit.constants)
    return replace(fit, odd=odd)


def _fit_regular(
    spec: LoadSpec, dips: Sequence[StationDip], odd: Collection[int], start: np.ndarray | None
) -> SharedFit:
    """Constants fitted to the dips that are not odd, and the torques of all."""
    regular = [dip for k, dip in enumerate(dips) if k not in odd]
    told = sorted(regular, key=lambda dip: -dip.promise)[:MOST_FITTED_DIPS]
    return _fit_torques(spec, dips, _fit_constants(spec, told, start))


def _fit_constants(
    spec: LoadSpec, dips: Sequence[StationDip], start: np.ndarray | None
) -> np.ndarray:
    """The constants (k,) that dips share; without a start those are searched that tell most."""
    if start is None:
        first = sorted(dips, key=lambda dip: -dip.promise)[:MOST_BEGUN]
        start = _search_constants(spec.pose([dip.event for dip in first]))
    problem = spec.pose([dip.event for dip in dips])
    likelihood, unit = _place(problem, start)
    ended = descend(
        likelihood.rows,
        unit[None],
        apart=problem.separable,
    )
    return likelihood.values(ended.unit[0])[problem.constants]


def _search_constants(problem: SizedProblem) -> np.ndarray:
    """The constants (k,) of the best fit to few dips, from all over the box."""
    _, ends = search_box(problem)
    if not np.isfinite(ends.deviance.min(initial=np.inf)):
        raise UserError(
            f"{problem.events[0].record.name}: nothing in the bounds of the model can be simulated;"
            " widen model.bounds or choose another model"
        )
    return problem.space.from_unit(ends.best)[problem.constants]


def _place(problem: SizedProblem, constants: np.ndarray) -> tuple[Likelihood, np.ndarray]:
    """Least squares of a problem and coordinates (D,) in it: constants (k,), and of each dip the
    best of some torques.
    """
    at = problem.constants
    low, span = problem.lower[at], (problem.upper - problem.lower)[at]
    tried = (np.arange(TRIED_TORQUES) + 0.5) / TRIED_TORQUES
    units = np.empty((TRIED_TORQUES, problem.space.dimension))
    units[:] = tried[:, None]
    units[:, at] = np.clip((constants - low) / span, 0.0, 1.0)
    likelihood = Likelihood.of_objective(problem, 1.0)
    rows = likelihood.rows(units)
    squares = np.stack([np.sum(rows[:, mine] ** 2, axis=1) for mine in problem.separable.rows])
    squares = np.where(np.isfinite(squares), squares, np.inf)
    unit = units[0].copy()
    unit[problem.shares] = tried[squares.argmin(axis=1)]
    objective = float(np.sum(squares.min(axis=1)))
    if not np.isfinite(objective):
        objective = 1.0
    return Likelihood.of_objective(problem, objective / problem.drive.samples), unit


def _fit_torques(spec: LoadSpec, dips: Sequence[StationDip], constants: np.ndarray) -> SharedFit:
    """The torque of each of the dips with the constants (k,) held, as many at once as constants
    are fitted to.
    """
    starts = range(0, len(dips), MOST_FITTED_DIPS)
    parts = [
        _fit_some_torques(spec, dips[first : first + MOST_FITTED_DIPS], constants)
        for first in starts
    ]
    return replace(
        parts[-1],
        dips=dips,
        torques=np.concatenate([part.torques for part in parts]),
        errors=np.concatenate([part.errors for part in parts]),
        fits=[fit for part in parts for fit in part.fits],
    )


def _fit_some_torques(
    spec: LoadSpec, dips: Sequence[StationDip], constants: np.ndarray
) -> SharedFit:
    """The same of dips that are fitted at once."""
    problem = spec.pose([dip.event for dip in dips])
    likelihood, unit = _place(problem, constants)
    frozen = np.ones((1, len(unit)), dtype=bool)
    frozen[:, problem.shares] = False
    ended = descend(
        likelihood.rows,
        unit[None],
        frozen,
        apart=problem.separable,
    )
    values = likelihood.values(ended.unit[0])
    fits = []
    for own, event in zip(problem.by_event(values)[:, 0], problem.events, strict=True):
        fits.append(respond(problem.model, own, event, TRAIN))
    errors = _scatter_torques(likelihood, problem, ended.unit[0])
    return SharedFit(
        problem,
        values,
        dips,
        values[problem.shares],
        errors,
        fits,
    )


def _scatter_torques(likelihood: Likelihood, problem: SizedProblem, unit: np.ndarray) -> np.ndarray:
    """Standard errors (E,) [pu] of the torques: by how much they move where blocks of their dip are
    left out.
    """
    rows, J = differentiate(likelihood, problem, unit)
    drive, torque = problem.drive, J[-1]
    acting = np.sum((torque * rows).reshape(drive.channels, -1), axis=0)
    weight = np.sum((torque**2).reshape(drive.channels, -1), axis=0)
    squares = np.zeros(drive.events)
    counts = np.zeros(drive.events)
    whole = np.add.reduceat(weight, drive.first[:-1])
    for block in cut_blocks(problem.events, problem.drive):
        e = find_event(problem, block)
        left = max(whole[e] - weight[block].sum(), SMALLEST_SQUARE)
        squares[e] += (acting[block].sum() / left) ** 2
        counts[e] += 1
    squares *= (counts - 1) / np.maximum(counts, 1)
    width = problem.upper - problem.lower
    errors = np.minimum(np.sqrt(squares), 1.0)
    return width[problem.shares] * errors


def find_event(problem: SizedProblem, block: slice) -> int:
    """The event that a block of samples is of."""
    return int(np.searchsorted(problem.drive.first, block.start, "right")) - 1


def _find_odd(fit: SharedFit, known: Mapping[int, str]) -> dict[int, str]:
    """Dips that the model of the others misses by far, and why they are left out."""
    errors = np.array([compute_model_error([one]).value for one in fit.fits])
    kept = [k for k in range(len(errors)) if k not in known and np.isfinite(errors[k])]
    if len(kept) < FEWEST_JUDGED_DIPS:
        return {}
    middle = float(np.median(errors[kept]))
    deviation = 1.4826 * float(np.median(np.abs(errors[kept] - middle)))
    limit = max(
        LEAST_ODD,
        ODD_RATIO * middle,
        middle + ODD_DEVIATIONS * deviation,
    )
    return {
        k: f"the model of the other dips leaves {error:.0%} of its response, and {middle:.1%} of"
        " theirs"
        for k, error in enumerate(errors.tolist())
        if not error <= limit
    }


def differentiate(
    likelihood: Likelihood, problem: SizedProblem, unit: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Rows (R,) at coordinates (D,), and derivatives (k + 1, R): to the constants, then to the
    torque of each row's dip.
    """
    lane = np.zeros(1, dtype=int)
    rows, J = compute_central_differences(
        likelihood.rows,
        unit[None],
        lane,
        problem.separable,
    )
    return rows[0], J[0]


@dataclass(frozen=True, eq=False)
class Predicted:
    """A dip as those before it predict it: the share that was expected, the model's error, and on
    how many dips that stands; `fit` None where it has no steady state so.
    """

    position: int
    share: float
    error: float
    known: int
    fit: Fit | None


def predict_in_turn(
    spec: LoadSpec, dips: Sequence[StationDip], odd: Mapping[int, str]
) -> list[Predicted]:
    """Each dip, in order of time, but for the first, by a model of dips before it.

    Constants are fitted again whenever there are half as many dips more: so the whole costs some
    times the fit to all. Nothing of a dip or of a later one is in what predicts it, but that odd
    ones do not predict.
    """
    regular = [k for k in range(len(dips)) if k not in odd]
    predicted: list[Predicted] = []
    start, known = None, 1
    while known <= len(regular):
        following = max(known + 1, int(GROWTH * known))
        begin = regular[known - 1] + 1
        end = len(dips) if following > len(regular) else regular[following - 1] + 1
        if begin < end:
            fit = fit_dips(spec, [dips[k] for k in regular[:known]], start)
            start = fit.constants
            composition = fit.estimate_composition()
            predicted += [_predict(fit, composition, dips[k], k) for k in range(begin, end)]
        known = following
    return predicted


def _predict(fit: SharedFit, composition: Composition, dip: StationDip, position: int) -> Predicted:
    """A dip by the constants of a fit and the share that is expected at its time."""
    (share,), _ = composition.predict([dip.when])
    at = fit.problem.shares[0]
    low, high = fit.problem.lower[at], fit.problem.upper[at]
    torque = float(np.clip(share * dip.event.P0, low, high))
    values = fit.spell_parameters(torque)
    known = len(fit.regular)
    if explain_refusal(fit.problem.model, values, dip.event):
        return Predicted(
            position,
            float(share),
            float("inf"),
            known,
            None,
        )
    played = respond(fit.problem.model, values, dip.event, VALIDATE)
    error = compute_model_error([played]).value
    return Predicted(
        position,
        float(share),
        error,
        known,
        played,
    )


def find_band(predicted: Sequence[Predicted], odd: Mapping[int, str]) -> PredictionBand | None:
    """The band of the next dip, by what was missed of those that were predicted; None where none
    was.
    """
    fits = find_later(predicted, odd)
    return measure_band(fits) if fits else None


def find_later(predicted: Sequence[Predicted], odd: Mapping[int, str]) -> list[Fit]:
    """The later half of the dips that were predicted, by the most dips: odd ones, and those without
    a steady state, apart.
    """
    regular = [one for one in predicted if one.position not in odd]
    fits = [one.fit for one in regular if one.fit is not None]
    return fits[len(fits) // 2 :]
