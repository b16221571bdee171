"""Whether a frequency that nobody recorded explains what a model leaves.

A course of the frequency is fitted to each event beside the parameters: smooth, and bounded by what
networks do. Where it explains most of what is left it is a candidate of the measurement, never an
effect of the load: no other dip has the same course, so that it predicts none.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.identification.fit import play
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.model_error import model_error
from tractexp.inference.prior import weigh_prior
from tractexp.inference.problem import Problem
from tractexp.record import Event

if TYPE_CHECKING:
    from tractexp.identification.uncertainty import Uncertainty

# Hz: how far the frequency of a network strays around a fault, where nobody recorded it
FREQUENCY_SWING = 0.2
# Hz: swings of one machine against others, and of areas against each other (Kundur 1994, ch. 12)
SWINGS = (0.3, 0.7, 1.5)
FALL = 1.0  # s: within which the frequency follows a lost balance of power
MOST_COURSE_STEPS = 12  # of the fit of a course
COURSE_DIFFERENCE = 0.02  # of what is usual: the step of differences
LEAST_EXPLAINED_BY_COURSE = 0.5  # of the model's error: a course that takes away less is not told


def list_falls(event: Event) -> list[np.ndarray]:
    """The course (N,) of a frequency that follows a lost balance of power from the dip on."""
    return [1 - np.exp(-_since_dip(event) / FALL)]


def list_swings(event: Event) -> list[np.ndarray]:
    """Courses (N,) of frequencies that swing from the dip on."""
    return [np.sin(2 * np.pi * rate * _since_dip(event)) for rate in SWINGS]


def _list_courses(event: Event) -> np.ndarray:
    """All that a course is made of, (k, N)."""
    late = [1 - np.cos(2 * np.pi * rate * _since_dip(event)) for rate in SWINGS]
    return np.stack([*list_falls(event), *list_swings(event), *late])


def _since_dip(event: Event) -> np.ndarray:
    return np.maximum(event.record.t - event.t_start, 0.0)


def drive_by_frequency(problem: Problem, deviations: Sequence[np.ndarray]) -> Problem:
    """The problem whose events have a frequency that deviates so (N,) [Hz] from the nominal one."""
    events = []
    for event, deviation in zip(problem.events, deviations, strict=True):
        nominal = event.record.base.frequency
        record = replace(event.record, f=nominal + deviation)
        events.append(replace(event, record=record, f0=nominal))
    return problem.driven_by(events)


def is_frequency_unknown(problem: Problem) -> bool:
    """Whether some event of a problem says nothing of the frequency, and may have had another."""
    shipped = any(event.record.is_shipped for event in problem.events)
    return problem.domain.lacks_frequency(problem.events) and not shipped


def find_course(uncertainty: "Uncertainty", swing: float) -> dict[str, Any]:
    """The course that explains what the estimate leaves, as `result.json` has it; {} where only
    noise is left, or where none within `swing` [Hz] explains most of it.

    It says how far it `strays` from nominal [Hz], the model's `error` with it and `error_without`
    [%], and the `parameters` beside it.
    """
    if uncertainty.exact:
        return {}
    fit = _CourseFit(uncertainty, swing)
    unit, sizes = fit.descend()
    likelihood, problem = fit.likelihood, fit.likelihood.problem
    values, deviations = likelihood.values(unit), fit.spell(sizes)
    without = model_error(play(problem, uncertainty.values)).value
    error = model_error(play(drive_by_frequency(problem, deviations), values)).value
    if not error <= (1 - LEAST_EXPLAINED_BY_COURSE) * without:
        return {}
    strays = max(float(np.abs(deviation).max()) for deviation in deviations)
    return {
        "strays": strays,
        "error": 100 * error,
        "error_without": 100 * without,
        "parameters": dict(zip(uncertainty.names, values.tolist(), strict=True)),
        "sentence": (
            f"a frequency that nobody recorded, {strays:.2g} Hz from nominal at most, would leave"
            f" {100 * error:.2g} % of the response where {100 * without:.2g} % are left: a"
            " candidate of the measurement, and no effect of the load"
        ),
    }


class _CourseFit:
    """Parameters and, of each event, the sizes (E, k) of what its course is made of."""

    def __init__(self, uncertainty: "Uncertainty", swing: float):
        self.likelihood = uncertainty.likelihood.of_records
        self.start = uncertainty.unit
        problem = self.likelihood.problem
        self.courses = [swing * _list_courses(event) for event in problem.events]
        self.weight = weigh_prior(problem.events, problem.drive, self.likelihood.free)

    def descend(self) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (D,) of the parameters, and sizes (E, k)."""
        from scipy.optimize import least_squares

        free = len(self.start)
        sizes = np.zeros((len(self.courses), len(self.courses[0])))
        start = np.concatenate([np.clip(self.start, 1e-9, 1 - 1e-9), sizes.ravel()])
        low = np.concatenate([np.zeros(free), -np.ones(sizes.size)])
        ended = least_squares(
            lambda x: self._rows(x[:free], x[free:].reshape(sizes.shape)),
            start,
            lambda x: self._jacobian(x[:free], x[free:].reshape(sizes.shape)),  # pyright: ignore
            bounds=(low, np.ones(len(start))),
            ftol=1e-3,
            xtol=1e-4,
            max_nfev=MOST_COURSE_STEPS,
        )
        return ended.x[:free], ended.x[free:].reshape(sizes.shape)

    def spell(self, sizes: np.ndarray) -> list[np.ndarray]:
        """The deviations (N,) [Hz] of each event."""
        return [own @ courses for own, courses in zip(sizes, self.courses, strict=True)]

    def _rows(self, unit: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        rows = self._driven(sizes).rows(unit[None])[0]
        return np.concatenate([np.nan_to_num(rows, nan=1e6), self.weight * sizes.ravel()])

    def _jacobian(self, unit: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """Derivatives (R + E k, D + E k): a size acts on the rows of its own event alone."""
        drive = self.likelihood.problem.drive
        rows, sensitivities = self._driven(sizes).jacobian(unit)
        free, samples = len(unit), len(rows)
        J = np.zeros((samples + sizes.size, free + sizes.size))
        J[:samples, :free] = sensitivities.shared_columns
        J[samples:, free:] = self.weight * np.eye(sizes.size)
        at = np.arange(drive.channels * drive.samples).reshape(drive.channels, drive.samples)
        places = [at[:, drive.part(e)].ravel() for e in range(drive.events)]
        for k in range(sizes.shape[1]):
            moved = sizes.copy()
            moved[:, k] += COURSE_DIFFERENCE
            change = (self._driven(moved).rows(unit[None])[0] - rows) / COURSE_DIFFERENCE
            for e, own in enumerate(places):
                J[own, free + e * sizes.shape[1] + k] = change[own]
        return np.nan_to_num(J)

    def _driven(self, sizes: np.ndarray) -> Likelihood:
        problem = drive_by_frequency(self.likelihood.problem, self.spell(sizes))
        return replace(self.likelihood, problem=problem)
