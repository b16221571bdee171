"""What a record that ends in its dip cannot tell of each parameter.

The load's answer to the fall is fitted; its answer to the recovery is not there. How narrow the
intervals would be with it is computed for a dip as deep and as long as what was recorded.
"""

from dataclasses import replace

import numpy as np

from tractexp.errors import UserError
from tractexp.identification.plan import DipShape, forecast
from tractexp.identification.uncertainty import Uncertainty
from tractexp.identification.verdict import (
    IDENTIFIED_SHARE,
    UNIDENTIFIED,
    WEAK,
    format_half_width,
    size,
)
from tractexp.record import Event


def with_unfinished(uncertainty: Uncertainty) -> Uncertainty:
    """The judgement with what the recovery would tell, where every record ends in its dip: of each
    parameter that is not identified, and would be with it.
    """
    problem = uncertainty.likelihood.problem
    if problem.per_event or not all(event.unfinished for event in problem.events):
        return uncertainty
    half = _forecast_recovery(uncertainty, max(problem.events, key=lambda event: event.depth))
    verdicts = dict(uncertainty.verdicts)
    for j, name in enumerate(uncertainty.names):
        value, bounds = uncertainty.values[j], (uncertainty.lower[j], uncertainty.upper[j])
        known = half[j] <= IDENTIFIED_SHARE * size(value, *bounds)
        if known and verdicts[name].word in (WEAK, UNIDENTIFIED):
            told = format_half_width(value, half[j], *bounds)
            why = f"the record ends in the dip: with the recovery it would be known to {told}"
            verdicts[name] = verdicts[name].add_objection(why)
    return replace(uncertainty, verdicts=verdicts)


def _forecast_recovery(uncertainty: Uncertainty, event: Event) -> np.ndarray:
    """Half intervals (d,) that the event would give if its recovery were recorded as well; inf
    where that cannot be planned.
    """
    try:
        shape = DipShape.from_event(event)
        return forecast(uncertainty.likelihood.problem, uncertainty.values, shape).half
    except UserError:  # this model or these values cannot be planned with
        return np.full(len(uncertainty.names), np.inf)
