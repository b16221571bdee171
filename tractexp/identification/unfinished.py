"""What a record that ends in its dip cannot tell of each parameter.

The load's answer to the fall is fitted; its answer to the recovery is not there. How narrow the
intervals would be with it is computed for a dip as deep and as long as what was recorded.
"""

from dataclasses import replace

import numpy as np

from tractexp.errors import UserError
from tractexp.identification.plan import DipShape, forecast_intervals
from tractexp.identification.uncertainty import Uncertainty
from tractexp.identification.verdict import (
    IDENTIFIED_SHARE,
    UNIDENTIFIED,
    WEAK,
    choose_scale,
    format_half_width,
)
from tractexp.record import Event


def add_unfinished(uncertainty: Uncertainty) -> Uncertainty:
    """The judgement with what the recovery would tell, where every record ends in its dip: of each
    parameter that is not identified, and would be with it.
    """
    problem = uncertainty.likelihood.problem
    all_end_inside = all(event.unfinished for event in problem.events)
    if problem.per_event or not all_end_inside:
        return uncertainty
    deepest = max(problem.events, key=lambda event: event.depth)
    halves = _forecast_recovery(uncertainty, deepest)
    verdicts = dict(uncertainty.verdicts)
    for j, name in enumerate(uncertainty.names):
        value = uncertainty.values[j]
        low = uncertainty.lower[j]
        high = uncertainty.upper[j]
        would_be_known = halves[j] <= IDENTIFIED_SHARE * choose_scale(value, low, high)
        if would_be_known and verdicts[name].word in (WEAK, UNIDENTIFIED):
            told = format_half_width(value, halves[j], low, high)
            why = f"the record ends in the dip: with the recovery it would be known to {told}"
            verdicts[name] = verdicts[name].add_objection(why)
    return replace(uncertainty, verdicts=verdicts)


def _forecast_recovery(uncertainty: Uncertainty, event: Event) -> np.ndarray:
    """Half intervals (d,) that the event would give if its recovery were recorded as well; inf
    where that cannot be planned.
    """
    problem = uncertainty.likelihood.problem
    try:
        shape = DipShape.from_event(event)
        planned = forecast_intervals(problem, uncertainty.values, shape)
        return planned.half
    except UserError:  # this model or these values cannot be planned with
        return np.full(len(uncertainty.names), np.inf)
