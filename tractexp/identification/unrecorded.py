"""What inputs that nobody recorded could do to the parameters.

A motor's slip is a few percent, and a frequency that swings by 0.2 Hz is 0.4 % of the nominal one:
a tenth of the slip. Where no frequency was recorded the model takes it to be nominal, and what the
swing does to the power moves the parameters; so does a negative sequence that the model takes to be
none. How far is computed for courses of the input as networks have them, to first order. A course
that the fit would show is none: what of it no parameter takes up is no louder than what the fit
leaves.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tractexp.identification.uncertainty import Uncertainty, compute_threshold
from tractexp.identification.unrecorded_course import find_course
from tractexp.identification.unrecorded_input import UnrecordedInput
from tractexp.identification.verdict import (
    IDENTIFIED_SHARE,
    UNIDENTIFIED,
    ParameterVerdict,
    choose_scale,
)
from tractexp.inference.information import Information


def add_unrecorded(uncertainty: Uncertainty, inputs: Sequence[UnrecordedInput]) -> Uncertainty:
    """The judgement with what inputs could do where none was recorded.

    Parameters
    ----------
    uncertainty : Uncertainty
        The judgement so far.
    inputs : sequence of UnrecordedInput
        How far each may stray; one of size 0 adds nothing.

    Returns
    -------
    Uncertainty
        Its `unrecorded` has what `result.json` has of each channel: the `size` in `words`; `moves`,
        by how much that moves each parameter, in its unit; `beyond`, the parameters that it moves
        beyond their intervals; the `course` that explains most of what the fit leaves, as of
        `find_course`; and the `remedy`. An identified parameter that it moves too far is weakly
        identified.
    """
    told = {one.channel: _tell_input(uncertainty, one) for one in inputs if one.size > 0}
    beside = replace(uncertainty, unrecorded={name: one for name, one in told.items() if one})
    judged = uncertainty
    unrecorded = {}
    for channel, missing in beside.unrecorded.items():
        objections = dict(_find_moved(judged, beside, channel))
        unrecorded[channel] = {**missing, "beyond": list(objections)}
        judged = replace(judged, verdicts=judged.verdicts | objections)
    return replace(beside, unrecorded=unrecorded, verdicts=judged.verdicts)


def _tell_input(uncertainty: Uncertainty, missing: UnrecordedInput) -> dict[str, Any]:
    """What an input does, `beyond` apart; {} where it was recorded, or moves nothing."""
    if not missing.is_unknown(uncertainty.likelihood.problem):
        return {}
    width = uncertainty.upper - uncertainty.lower
    # what no record sees to first order moves from bound to bound at most
    moved = np.minimum(np.abs(_find_moves(uncertainty, missing)), width)
    if not moved.any():
        return {}
    return {
        "size": missing.size,
        "words": missing.words,
        "moves": dict(zip(uncertainty.names, moved.max(axis=0).tolist(), strict=True)),
        "course": find_course(uncertainty, missing),
        "remedy": missing.remedy,
        "unless": f"task.{missing.setting}=0 {missing.known}",
    }


def _find_moves(uncertainty: Uncertainty, missing: UnrecordedInput) -> np.ndarray:
    """The moves (courses, d) of the parameters, in their units, by each course of the input."""
    likelihood = uncertainty.likelihood.of_records
    unit = uncertainty.unit
    problem = likelihood.problem
    left, sensitivities = uncertainty.sensitivities
    acted_on = missing.act_on(problem)
    driven = []
    for courses in zip(*map(missing.list_courses, problem.events), strict=True):
        other = replace(likelihood, problem=missing.drive(acted_on, courses))
        driven.append(other.rows(unit[None])[0])
    # a course that nothing can be simulated with was none
    changes = np.array([rows - left for rows in driven if np.isfinite(rows).all()])
    if not len(changes):
        return np.zeros((1, len(uncertainty.names)))
    taken_up = sensitivities.times(sensitivities.fit(-changes))
    seen = np.sum((changes + taken_up) ** 2, axis=1)
    hidden = (
        compute_threshold() if uncertainty.exact else max(float(left @ left), compute_threshold())
    )
    shares = np.sqrt(np.minimum(1.0, hidden / np.maximum(seen, 1e-300)))
    width = problem.upper - problem.lower
    seen_by = Information(uncertainty.names, uncertainty.values, width, sensitivities.without_own)
    return shares[:, None] * seen_by.find_steps(-changes)


def _find_moved(
    own: Uncertainty, beside: Uncertainty, channel: str
) -> Iterator[tuple[str, ParameterVerdict]]:
    """Verdicts of the parameters that an input moves by more than their interval is wide, or until
    that is wide.
    """
    missing = beside.unrecorded[channel]
    moves = missing["moves"]
    for j, (name, (low, high)) in enumerate(zip(own.names, own.intervals.tolist(), strict=True)):
        value = float(own.values[j])
        verdict = own.verdicts[name]
        half = float(np.ptp(beside.intervals[j])) / 2
        wide = max(half, moves[name]) > IDENTIFIED_SHARE * choose_scale(
            value, own.lower[j], own.upper[j]
        )
        known = verdict.word != UNIDENTIFIED
        if known and (wide or moves[name] > high - low):
            why = f"{channel} was not recorded, and {missing['words']} moves it by"
            yield name, verdict.add_objection(f"{why} {moves[name]:.2g}")
