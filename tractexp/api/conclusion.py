"""What a search led to: the estimate with its intervals, its grade and what to do next."""

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tractexp.api.fit_spec import FitSpec
from tractexp.configuration.choices import set_holding
from tractexp.configuration.run_command import suggest_run
from tractexp.identification.adequacy import Adequacy
from tractexp.identification.result import Result, conclude, refuse_failed
from tractexp.identification.search import SearchResult
from tractexp.text.progress import Progress, counter
from tractexp.text.wording import join_words

if TYPE_CHECKING:
    from tractexp.identification.agreement import EventAgreement
    from tractexp.identification.estimate import EstimationResult
    from tractexp.identification.result import Fit
    from tractexp.identification.uncertainty import Uncertainty


class FitDetails(NamedTuple):
    """Fits, estimate and uncertainty behind a result: heavy, and computed again from a
    loaded one.
    """

    fits: "list[Fit]"
    estimation: "EstimationResult"
    uncertainty: "Uncertainty"  # with the intervals that profiles gave
    agreement: "EventAgreement | None"
    adequacy: Adequacy


def conclude_identification(
    setup: FitSpec, end: SearchResult, progress: Progress = False
) -> tuple[Result, FitDetails]:
    """The estimate that a search led to, and what stands behind it."""
    from tractexp.identification.advice import advise
    from tractexp.identification.agreement import compare_events
    from tractexp.identification.grade import grade_estimate, grade_model
    from tractexp.identification.load_drift import with_load_drift
    from tractexp.identification.physical import find_free_optimum, say_ranges
    from tractexp.identification.profile import check_by_profiles
    from tractexp.identification.rivals import with_rivals
    from tractexp.identification.share import find_share_bound
    from tractexp.identification.unfinished import with_unfinished
    from tractexp.identification.unrecorded import with_unrecorded
    from tractexp.identification.yardstick import yardstick

    problem = setup.problem
    refuse_failed(problem, end)
    shown = setup.model.shown
    graded = grade_model(problem, setup.validate, end.values, shown)
    uncertainty = graded.uncertainty
    if setup.check_intervals:
        profiled = check_by_profiles(
            uncertainty, counter("points at most on the profiles", progress)
        )
        uncertainty = with_rivals(profiled, counter("structures fitted beside", progress))
    uncertainty = with_unrecorded(uncertainty, setup.frequency_swing)
    uncertainty = with_unfinished(with_load_drift(uncertainty))
    uncertainty = say_ranges(uncertainty, setup.model.held)
    if not np.array_equal(uncertainty.values, graded.values):  # a profile led to a better optimum
        moved = replace(graded.estimation, uncertainty=uncertainty)
        graded = grade_estimate(problem, moved, setup.validate, shown)
    fits, adequacy = list(graded.fits), graded.adequacy
    result = conclude(
        problem, end, graded.values, fits, setup.seed, setup.model.node, setup.optimizer.name
    )
    result = replace(result, shown_effects=dict(shown), race=[*setup.model.race])
    together = compare_events(uncertainty) if len(problem.events) > 1 else None
    fields = uncertainty.fields()
    fields["uncertainty"] |= together.fields() if together else {"gains": {}, "odd_events": []}
    fields["uncertainty"]["notes"] += together.notes if together else []
    share = find_share_bound(uncertainty)
    played = {fit.event.record.name for fit in fits}
    validate = [event for event in setup.validate if event.record.name in played]
    free = find_free_optimum(uncertainty, setup.model.held, fits, validate)
    fields["uncertainty"]["notes"] += [str(free)] if free else []
    starts = [s.to_dict(problem.space.names) for s in graded.estimation.starts]
    structures = [rival.to_dict() for rival in uncertainty.rivals]
    data = set_holding(tuple(event.record.where for event in problem.events))
    unrecorded = uncertainty.unrecorded
    odd = together.odd if together else ()
    advice = [
        *advise(uncertainty, adequacy, odd, data=data),
        *_hold_to_machines(setup, result),
        *_with_frequency(uncertainty),
    ]
    beside = yardstick(fits, result.model_error)
    result = replace(
        result,
        **fields,
        adequacy=adequacy.to_dict(),
        linear_network=beside,
        next_dip=graded.next_dip,
        starts=starts,
        rival_structures=structures,
        free_optimum=free.to_dict() if free else {},
        share_bound=share.to_dict() if share else {},
        unrecorded=unrecorded.to_dict() if unrecorded else {},
        advice=advice,
    )
    return result, FitDetails(fits, graded.estimation, uncertainty, together, adequacy)


def _with_frequency(uncertainty: "Uncertainty") -> list[str]:
    """To record what moves parameters beyond their intervals, or would explain most of what is
    left; [] where nothing does.
    """
    missing = uncertainty.unrecorded
    if missing is None or not (missing.beyond or missing.course):
        return []
    still = "(task.frequency_swing=0 where it stood still)"
    if missing.course:
        return [f"record f or U_angle: {missing.course} {still}"]
    return [
        f"record f or U_angle: without it a swing of {missing.swing:g} Hz moves"
        f" {join_words(missing.beyond)} {still}"
    ]


def _hold_to_machines(setup: FitSpec, result: Result) -> list[str]:
    """The command that holds a motor that no load has to what machines are, or races structures
    where it is held; [] where the motor is one, or by priors.
    """
    from tractexp.exchange.operating_point import OperatingPoint

    point, model = OperatingPoint.from_result(result), setup.model
    if model.priors or not (point and point.doubt):
        return []
    if model.held:
        race = f"race structures for one that is a load: {suggest_run('model=auto')}"
        return [] if model.race else [race]
    if not any(parameter.physical for parameter in model.model.parameters):
        return []
    return [f"hold the motor to what machines are: {suggest_run('model.physical=true')}"]
