"""Which structure a load has: base models raced by what they predict and were not fitted to.

Of several dips each is predicted by a fit to the others. Of one dip the samples from its start on
are cut into stretches in which the load answers equally much, and each is predicted by a fit to the
rest: a static law follows the fault and misses the recovery, a motor too few knows neither. The
simplest structure that predicts nearly as well as the best is chosen. It is chosen by the fitted
dips alone: those held out judge it.
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tractexp.errors import UserError
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.multistart import search_box, select_distinct
from tractexp.inference.problem import Problem
from tractexp.model.model import Model
from tractexp.noise.color import SMALLEST_DEVIATION
from tractexp.record import Event

STRETCHES = 5  # of a single dip
AS_GOOD = 1.05  # times the least error: a simpler structure within it wins
Structure = tuple[Model, Mapping[str, Sequence[float]]]  # a model, and what bounds it
WORSE_FITTED = "fitted it already leaves more than the best predicts"


@dataclass(frozen=True)
class Entry:
    """How a structure did in the race.

    Attributes
    ----------
    name : str
        Of the structure.
    parameters : int
        Number of its free parameters.
    fitted, predicted : float
        What it leaves of the load's response where it is fitted and where it predicts, as
        fractions; inf where it cannot be simulated.
    why : str
        Why it cannot; "" where it can.
    """

    name: str
    parameters: int
    fitted: float
    predicted: float
    why: str = ""

    def to_dict(self) -> dict[str, Any]:
        """As `result.json` has it; errors that do not exist are None."""
        return {
            key: None if isinstance(value, float) and not np.isfinite(value) else value
            for key, value in vars(self).items()
        }


def race_structures(
    candidates: Mapping[str, Structure],
    events: Sequence[Event],
    fixed: Mapping[str, float] | None = None,
) -> list[Entry]:
    """The entries of the candidates by name, the winner first, the others by what they predict.
    Raises `UserError` where none can be fitted.
    """
    entries, fitted = list[Entry](), list[_Fitted]()
    for name, candidate in candidates.items():
        found = _fit(name, candidate, events, fixed or {})
        (entries if isinstance(found, Entry) else fitted).append(found)  # type: ignore[arg-type]
    best = np.inf
    for one in sorted(fitted, key=lambda one: one.error):
        # what does not follow the records where it is fitted does not predict them
        entry = one.tell(WORSE_FITTED) if one.error > AS_GOOD * best else one.predict()
        best = min(best, entry.predicted)
        entries.append(entry)
    entries.sort(key=lambda entry: (entry.predicted, entry.fitted))
    if not np.isfinite(entries[0].predicted):
        raise UserError(f"none of the structures can be fitted: {entries[0].why}")
    near = [e for e in entries if e.predicted <= AS_GOOD * entries[0].predicted]
    winner = min(near, key=lambda entry: (entry.parameters, entry.predicted))
    return [winner, *(entry for entry in entries if entry is not winner)]


@dataclass(frozen=True, eq=False)
class _Fitted:
    """A structure fitted to all dips: where its descents ended (n, D), what it leaves of the
    response `size` [pu²] where it is `compared` (C, N), as a fraction.
    """

    name: str
    likelihood: Likelihood
    ends: np.ndarray
    compared: np.ndarray
    size: float
    error: float

    def tell(self, why: str = "", predicted: float = np.inf) -> Entry:
        return Entry(self.name, self.likelihood.free, self.error, predicted, why)

    def predict(self) -> Entry:
        """The entry, with what it leaves of dips or stretches that it is not fitted to."""
        likelihood, squares = self.likelihood, 0.0
        for held in _list_folds(likelihood.problem, self.compared):
            rest = replace(likelihood, valid=likelihood.valid & ~held)
            left = likelihood.residuals(rest.descent(self.ends).best[None])[0]
            squares += float(np.sum(np.where(held & self.compared, left, 0.0) ** 2))
        return self.tell(predicted=_share(squares, self.size))


def _fit(
    name: str, candidate: Structure, events: Sequence[Event], fixed: Mapping[str, float]
) -> _Fitted | Entry:
    """A structure fitted to all dips; its entry where it cannot be."""
    model, bounds = candidate
    own = {parameter: value for parameter, value in fixed.items() if parameter in model.names}
    try:
        problem = Problem(model, events, bounds, own)
    except UserError as error:
        return Entry(name, len(model.names), np.inf, np.inf, str(error))
    likelihood, ends = search_box(problem)
    if not np.isfinite(ends.deviance.min(initial=np.inf)):
        why = "nothing in its bounds can be simulated"
        return Entry(name, problem.space.dimension, np.inf, np.inf, why)
    compared = _mark_compared(problem)
    size = _measure_response(problem, compared)
    left = likelihood.residuals(ends.best[None])[0]
    error = _share(float(np.sum(np.where(compared, left, 0.0) ** 2)), size)
    starts = select_distinct(ends, likelihood.free)
    return _Fitted(name, likelihood, starts, compared, size, error)


def _share(squares: float, size: float) -> float:
    return float(np.sqrt(np.nan_to_num(squares / size, nan=np.inf)))


def _mark_compared(problem: Problem) -> np.ndarray:
    """Which samples (C, N) are compared: those from each dip on."""
    counted = problem.drive.weights > 0
    for e, event in enumerate(problem.events):
        counted[:, problem.drive.part(e).start :][:, : event.start] = False
    return counted


def _subtract_means(problem: Problem) -> np.ndarray:
    """The measured channels (C, N), each less its mean before the dip in every event: the load's
    response.
    """
    measured = np.array(problem.drive.measurements)
    for e, event in enumerate(problem.events):
        part = measured[:, problem.drive.part(e)]
        part -= part[:, event.steady].mean(axis=1, keepdims=True)
    return measured


def _measure_response(problem: Problem, counted: np.ndarray) -> float:
    """The load's response from each dip on: the sum of its squares [pu²]."""
    return max(float(np.sum(_subtract_means(problem)[counted] ** 2)), SMALLEST_DEVIATION**2)


def _list_folds(problem: Problem, counted: np.ndarray) -> Iterator[np.ndarray]:
    """What is left out in turn, masks (1, N): each event, or stretches of the only one in which the
    load answers equally much.
    """
    samples, drive = np.arange(problem.drive.samples), problem.drive
    if drive.events > 1:
        for e in range(drive.events):
            part = drive.part(e)
            yield ((samples >= part.start) & (samples < part.stop))[None]
        return
    answer = np.cumsum(np.sum(np.where(counted, _subtract_means(problem), 0.0) ** 2, axis=0))
    ends = np.searchsorted(answer, answer[-1] * np.arange(1, STRETCHES) / STRETCHES)
    first = int(np.argmax(counted.any(axis=0)))
    edges = [first, *ends.tolist(), len(samples)]
    for begin, end in itertools.pairwise(edges):
        yield ((samples >= begin) & (samples < end))[None]
