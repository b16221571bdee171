"""What an input that nobody recorded could do to the parameters.

A motor's slip is a few percent, and a frequency that swings by 0.2 Hz is 0.4 % of the nominal one:
a tenth of the slip. Where no frequency was recorded the model takes it to be nominal, and what the
swing does to the power moves the parameters. How far is computed for courses of the frequency as
networks have them after a fault, to first order. A course that the fit would show is none: what of
it no parameter takes up is no louder than what the fit leaves.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from tractexp.identification.frequency_course import (
    drive_by_frequency,
    find_course,
    is_frequency_unknown,
    list_falls,
    list_swings,
)
from tractexp.identification.uncertainty import Uncertainty, threshold
from tractexp.identification.verdict import IDENTIFIED_SHARE, UNIDENTIFIED, ParameterVerdict, size
from tractexp.inference.information import Information
from tractexp.inference.problem import Problem


def with_unrecorded(uncertainty: Uncertainty, swing: float) -> Uncertainty:
    """The judgement with what a swing of the frequency could do, where none was recorded.

    Parameters
    ----------
    uncertainty : Uncertainty
        The judgement so far.
    swing : float [Hz]
        How far the frequency may swing; 0: nothing is added.

    Returns
    -------
    Uncertainty
        Its `unrecorded` has what `result.json` has of it: the `channel`, the `swing`; `moves`, by
        how much that moves each parameter, in its unit; `beyond`, the parameters that it moves
        beyond their intervals; and the `course` that explains most of what the fit leaves, as of
        `find_course`. An identified parameter that the swing moves too far is weakly identified.
    """
    problem = uncertainty.likelihood.problem
    if swing <= 0 or not is_frequency_unknown(problem):
        return uncertainty
    moved = np.abs(_find_moves(uncertainty, swing))
    if not moved.any():
        return uncertainty
    moves = dict(zip(uncertainty.names, moved.max(axis=0).tolist(), strict=True))
    told = {"channel": "f", "swing": swing, "moves": moves}
    beside = replace(uncertainty, unrecorded=told)
    objections = dict(_find_moved(uncertainty, beside))
    consequences = {"beyond": list(objections), "course": find_course(uncertainty, swing)}
    return replace(
        beside, unrecorded=told | consequences, verdicts=uncertainty.verdicts | objections
    )


def _find_moves(uncertainty: Uncertainty, swing: float) -> np.ndarray:
    """The moves (courses, d) of the parameters, in their units, by each course of the frequency."""
    likelihood = uncertainty.likelihood.of_records
    unit = uncertainty.unit
    problem = likelihood.problem
    left, sensitivities = uncertainty.sensitivities
    driven = [
        replace(likelihood, problem=driven_problem).rows(unit[None])[0]
        for driven_problem in _drive_by_courses(problem, swing)
    ]
    changes = np.array([rows for rows in driven if np.isfinite(rows).all()]) - left
    if not len(changes):
        return np.zeros((1, len(uncertainty.names)))
    taken_up = sensitivities.times(sensitivities.fit(-changes))
    seen = np.sum((changes + taken_up) ** 2, axis=1)
    hidden = threshold() if uncertainty.exact else max(float(left @ left), threshold())
    shares = np.sqrt(np.minimum(1.0, hidden / np.maximum(seen, 1e-300)))
    width = problem.upper - problem.lower
    seen_by = Information(uncertainty.names, uncertainty.values, width, sensitivities.without_own)
    return shares[:, None] * seen_by.find_steps(-changes)


def _drive_by_courses(problem: Problem, swing: float) -> Iterator[Problem]:
    """The problem with each course of the frequency: one that falls from the dip on, and swings."""
    shapes = [[*list_falls(event), *list_swings(event)] for event in problem.events]
    for of_events in zip(*shapes, strict=True):
        yield drive_by_frequency(problem, [swing * shape for shape in of_events])


def _find_moved(own: Uncertainty, beside: Uncertainty) -> Iterator[tuple[str, ParameterVerdict]]:
    """Verdicts of the parameters that the swing moves beyond their interval, or until that is
    wide.
    """
    swing = beside.unrecorded["swing"]
    moves = beside.unrecorded["moves"]
    for j, (name, (low, high)) in enumerate(zip(own.names, own.intervals.tolist(), strict=True)):
        value = float(own.values[j])
        verdict = own.verdicts[name]
        half = float(np.ptp(beside.intervals[j])) / 2
        wide = max(half, moves[name]) > IDENTIFIED_SHARE * size(value, own.lower[j], own.upper[j])
        known = verdict.word != UNIDENTIFIED
        if known and (wide or moves[name] > (high - low) / 2):
            why = f"f was not recorded, and a swing of {swing:g} Hz moves it by {moves[name]:.2g}"
            yield name, verdict.add_objection(why)
