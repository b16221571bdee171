"""Whether an input that nobody recorded explains what a model leaves.

A course of the input is fitted to each event beside the parameters: of shapes and sizes that
networks give it. Where it explains most of what is left it is a candidate of the measurement, never
an effect of the load: no other dip has the same course, so that it predicts none.
"""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.identification.fit import play
from tractexp.identification.unrecorded_input import UnrecordedInput
from tractexp.inference.least_squares import descend
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.model_error import compute_model_error
from tractexp.inference.prior import weigh_prior
from tractexp.inference.separable import SeparableColumns

if TYPE_CHECKING:
    from tractexp.identification.uncertainty import Uncertainty

MOST_COURSE_STEPS = 12  # of the fit of a course
LEAST_COURSE_GAIN = 1e-3  # of the deviance: a step that gains less ends the fit
LEAST_EXPLAINED_BY_COURSE = 0.5  # of the model's error: a course that takes away less is not told


def find_course(uncertainty: "Uncertainty", missing: UnrecordedInput) -> dict[str, Any]:
    """The course that explains what the estimate leaves, as `result.json` has it; {} where only
    noise is left, or where none of its size explains most of it.

    It says how far it `strays` from rest [Hz or pu], the model's `error` with it and
    `error_without` [%], and the `parameters` beside it.
    """
    if uncertainty.exact:
        return {}
    likelihood = uncertainty.likelihood.of_records
    problem = missing.act_on(likelihood.problem)
    likelihood = replace(likelihood, problem=problem)
    unit, courses = _fit_course(likelihood, uncertainty, missing)
    values = likelihood.values(unit)
    without = compute_model_error(play(uncertainty.likelihood.problem, uncertainty.values)).value
    error = compute_model_error(play(missing.drive(problem, courses), values)).value
    if not error <= (1 - LEAST_EXPLAINED_BY_COURSE) * without:
        return {}
    strays = max(float(np.abs(course).max()) for course in courses)
    return {
        "strays": strays,
        "error": 100 * error,
        "error_without": 100 * without,
        "parameters": dict(zip(uncertainty.names, values.tolist(), strict=True)),
        "sentence": (
            f"{missing.describe_course(strays)} would leave {100 * error:.2g} % of the response"
            f" where {100 * without:.2g} % are left: a candidate of the measurement, and no effect"
            " of the load"
        ),
    }


def _fit_course(
    likelihood: Likelihood, uncertainty: "Uncertainty", missing: UnrecordedInput
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Coordinates (D,) of the parameters, and the course (N,) of each event, apart from rest.

    Beside the parameters the sizes of what a course is made of are free, from `missing.least` to 1;
    a size acts on the rows of its own event, and is held near 0 by a row of its own.
    """
    problem = likelihood.problem
    free = likelihood.free
    parts = [missing.list_parts(event) for event in problem.events]
    numbers = np.arange(len(parts) * len(parts[0])).reshape(len(parts), -1)
    weight = weigh_prior(problem.events, problem.drive, free)

    def size(points: np.ndarray) -> np.ndarray:
        return missing.least + (1 - missing.least) * points[..., free:]

    def spell(point: np.ndarray) -> list[np.ndarray]:
        sizes = size(point)[numbers]
        return [own @ shapes for own, shapes in zip(sizes, parts, strict=True)]

    def play_course(point: np.ndarray) -> np.ndarray:
        driven = missing.drive(problem, spell(point))
        return replace(likelihood, problem=driven).rows(point[None, :free])[0]

    def rows(points: np.ndarray, _: np.ndarray) -> np.ndarray:
        played = np.array([play_course(point) for point in points])
        return np.concatenate([played, weight * size(points)], axis=1)

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
