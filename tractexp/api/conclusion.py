"""What a search led to: the estimate with its intervals, its grade and what to do next."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tractexp.api.fit_spec import FitSpec
from tractexp.configuration.choices import set_holding
from tractexp.configuration.run_command import suggest_run
from tractexp.identification.adequacy import Adequacy
from tractexp.identification.conclude import refuse_failed
from tractexp.identification.result import Result
from tractexp.identification.search import SearchResult
from tractexp.storage import files
from tractexp.text.progress import Progress, make_counter
from tractexp.text.wording import join_words

if TYPE_CHECKING:
    from tractexp.identification.estimate import EstimationResult
    from tractexp.identification.fit import Fit
    from tractexp.identification.uncertainty import Uncertainty


class FitDetails(NamedTuple):
    """Fits, estimate and uncertainty behind a result: heavy, and computed again from a
    loaded one.
    """

    fits: "list[Fit]"
    estimation: "EstimationResult"
    uncertainty: "Uncertainty"  # with the intervals that profiles gave
    # of several events: `compare_events`
    agreement: Mapping[str, Any] | None
    adequacy: Adequacy


def conclude_identification(
    setup: FitSpec, end: SearchResult, progress: Progress = False
) -> tuple[Result, FitDetails]:
    """The estimate that a search led to, and what stands behind it."""
    from tractexp.identification.agreement import compare_events
    from tractexp.identification.grade import grade_estimate, grade_model

    problem, shown = setup.problem, setup.model.shown
    refuse_failed(problem, end)
    graded = grade_model(problem, setup.validate, end.values, shown)
    uncertainty = _complete_uncertainty(setup, graded.uncertainty, progress)
    if not np.array_equal(uncertainty.values, graded.values):  # a profile led to a better optimum
        moved = replace(graded.estimation, uncertainty=uncertainty)
        graded = grade_estimate(problem, moved, setup.validate, shown)
    agreement = compare_events(uncertainty) if len(problem.events) > 1 else None
    details = FitDetails(
        list(graded.fits), graded.estimation, uncertainty, agreement, graded.adequacy
    )
    result = replace(
        setup.build_result(end, graded.values, details.fits),
        shown_effects=dict(shown),
        race=[*setup.model.race],
        adequacy=graded.adequacy.to_dict(),
        next_dip=graded.next_dip,
    )
    return _add_findings(setup, result, details), details


def _complete_uncertainty(
    setup: FitSpec, uncertainty: "Uncertainty", progress: Progress
) -> "Uncertainty":
    """The uncertainty with what profiles, rival structures and the records' limits add to it."""
    from tractexp.identification.load_drift import add_load_drift
    from tractexp.identification.physical import say_ranges
    from tractexp.identification.profile import check_by_profiles
    from tractexp.identification.rivals import add_rivals
    from tractexp.identification.unfinished import add_unfinished
    from tractexp.identification.unrecorded import add_unrecorded

    if setup.check_intervals:
        points = make_counter("points at most on the profiles", progress)
        uncertainty = check_by_profiles(uncertainty, points)
        structures = make_counter("structures fitted beside", progress)
        uncertainty = add_rivals(uncertainty, structures)
    uncertainty = add_unrecorded(uncertainty, setup.unrecorded_inputs)
    uncertainty = add_unfinished(add_load_drift(uncertainty))
    return say_ranges(uncertainty, setup.model.held)


def _add_findings(setup: FitSpec, result: Result, details: FitDetails) -> Result:
    """The result with its uncertainty, what was found beside the estimate, and advice."""
    from tractexp.identification.network_comparison import compare_with_network
    from tractexp.identification.physical import find_free_optimum
    from tractexp.identification.share import find_share_bound
    from tractexp.identification.unsteady_start import find_unsteady_start

    uncertainty, fits = details.uncertainty, details.fits
    agreement = details.agreement or {"gains": {}, "odd_events": [], "notes": []}
    played = {fit.event.record.name for fit in fits}
    validate = [event for event in setup.validate if event.record.name in played]
    free = find_free_optimum(uncertainty, setup.model.held, fits, validate)
    start = find_unsteady_start(uncertainty)
    fields = uncertainty.fields()
    told = fields["uncertainty"]
    told |= {key: files.make_plain(agreement[key]) for key in ("gains", "odd_events")}
    told["notes"] += [*agreement["notes"], *map(str, filter(None, (free, start)))]
    return replace(
        result,
        **fields,
        linear_network=compare_with_network(fits, result.model_error),
        starts=details.estimation.starts,
        rival_structures=[rival.to_dict() for rival in uncertainty.rivals],
        free_optimum=free.to_dict() if free else {},
        share_bound=find_share_bound(uncertainty),
        unrecorded=dict(uncertainty.unrecorded),
        unsteady_start=start.to_dict() if start else {},
        advice=_advise(setup, result, details),
    )


def _advise(setup: FitSpec, result: Result, details: FitDetails) -> list[str]:
    """What to do next, the most pressing first."""
    from tractexp.identification.advice import advise

    data = set_holding(tuple(event.record.where for event in setup.problem.events))
    odd = details.agreement["odd_events"] if details.agreement else ()
    return [
        *advise(details.uncertainty, details.adequacy, odd, data=data),
        *_suggest_machine_ranges(setup, result),
        *_suggest_recording(details.uncertainty),
    ]


def _suggest_recording(uncertainty: "Uncertainty") -> Iterator[str]:
    """To record what moves parameters beyond their intervals, or would explain most of what is
    left.
    """
    for missing in uncertainty.unrecorded.values():
        beyond, course = join_words(missing["beyond"]), missing["course"]
        moved = beyond and f"without it {missing['words']} moves {beyond}"
        if why := course.get("sentence", moved):
            yield f"{missing['remedy']}: {why} ({missing['unless']})"


def _suggest_machine_ranges(setup: FitSpec, result: Result) -> list[str]:
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
