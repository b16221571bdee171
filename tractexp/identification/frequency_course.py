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
from tractexp.inference.least_squares import descend
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.model_error import model_error
from tractexp.inference.prior import weigh_prior
from tractexp.inference.problem import Problem
from tractexp.inference.separable import SeparableColumns
from tractexp.record import Event

if TYPE_CHECKING:
    from tractexp.identification.uncertainty import Uncertainty

# Hz: how far the frequency of a network strays around a fault, where nobody recorded it
FREQUENCY_SWING = 0.2
# Hz: swings of one machine against others, and of areas against each other (Kundur 1994, ch. 12)
SWINGS = (0.3, 0.7, 1.5)
FALL = 1.0  # s: within which the frequency follows a lost balance of power
MOST_COURSE_STEPS = 12  # of the fit of a course
LEAST_COURSE_GAIN = 1e-3  # of the deviance: a step that gains less ends the fit
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
    likelihood = uncertainty.likelihood.of_records
    problem = likelihood.problem
    unit, deviations = _fit_course(likelihood, uncertainty, swing)
    values = likelihood.values(unit)
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


def _fit_course(
    likelihood: Likelihood, uncertainty: "Uncertainty", swing: float
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Coordinates (D,) of the parameters, and the deviations (N,) [Hz] of each event.

    Beside the parameters the sizes of what a course is made of are free, from -1 to 1 times the
    swing; a size acts on the rows of its own event, and is held near 0 by a row of its own.
    """
    problem = likelihood.problem
    free = likelihood.free
    courses = [swing * _list_courses(event) for event in problem.events]
    numbers = np.arange(len(courses) * len(courses[0])).reshape(len(courses), -1)
    weight = weigh_prior(problem.events, problem.drive, free)

    def spell(point: np.ndarray) -> list[np.ndarray]:
        sizes = 2 * point[free + numbers] - 1
        return [own @ shapes for own, shapes in zip(sizes, courses, strict=True)]

    def play_course(point: np.ndarray) -> np.ndarray:
        driven = drive_by_frequency(problem, spell(point))
        return replace(likelihood, problem=driven).rows(point[None, :free])[0]

    def rows(points: np.ndarray, _: np.ndarray) -> np.ndarray:
        held = weight * (2 * points[:, free:] - 1)
        return np.concatenate([np.array([play_course(point) for point in points]), held], axis=1)

    recorded = SeparableColumns.of_power(problem.drive, None).rows
    own_rows = tuple(
        np.r_[mine, problem.drive.measurements.size + own]
        for mine, own in zip(recorded, numbers, strict=True)
    )
    apart = SeparableColumns(free + numbers, own_rows)
    start = np.r_[uncertainty.unit, np.full(numbers.size, 0.5)]
    tolerance = LEAST_COURSE_GAIN * uncertainty.deviance
    end = descend(rows, start[None], None, MOST_COURSE_STEPS, tolerance, apart).unit[0]
    return end[:free], spell(end)
