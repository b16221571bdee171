"""What it costs to hold a machine to what machines are, and what it would be without.

Of waveforms the free optimum is often no machine: C at 0.3 magnetizes with twelve times the rated
current, and a negative inductance beside it takes that away again. The pair is a linear network in
disguise. So records from the field are fitted within the ranges that the parameters declare
(`Parameter.physical`), and where one of these holds the estimate, the free optimum is told beside
it as a diagnosis.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tractexp.errors import UserError
from tractexp.identification.fit import Fit, play
from tractexp.identification.uncertainty import Uncertainty
from tractexp.identification.verdict import (
    BOUND,
    END_OF_RANGE,
    ParameterVerdict,
)
from tractexp.inference.bounds import BOUND_DISTANCE
from tractexp.inference.model_error import compute_model_error
from tractexp.parameter import spread_evenly
from tractexp.record import Event

FREE_STARTS = 4  # of the free fit, beside the estimate


@dataclass(frozen=True)
class FreeOptimum:
    """The fit whose machine is held to no range, beside the one that is held.

    Attributes
    ----------
    parameters : {name: value}
        Those that leave their range, in their units.
    error, held_error : float
        The model's error on the fitted events, as a share of the response: free, and held.
    predicted, held_predicted : float or None
        Those errors on the events held out, where there are some.
    """

    parameters: dict[str, float]
    error: float
    held_error: float
    predicted: float | None = None
    held_predicted: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """As `result.json` has it."""
        return {**vars(self), "sentence": str(self)}

    def __str__(self) -> str:
        away = ", ".join(f"{name} {value:.3g}" for name, value in self.parameters.items())
        dips = ""
        if self.predicted is not None and self.held_predicted is not None:
            dips = f", of the held-out dips {self.held_predicted:.0%} for {self.predicted:.0%}"
        return (
            f"held to what machines are, the model leaves {self.held_error:.0%} of the response"
            f" where free it leaves {self.error:.0%}{dips}; free it would have {away}, which is no"
            " machine (model.physical=false fits so)"
        )


def find_free_optimum(
    uncertainty: Uncertainty,
    held: Mapping[str, Sequence[float]],
    fits: Sequence[Fit],
    validate: Sequence[Event],
) -> FreeOptimum | None:
    """The optimum without the ranges of machines.

    Parameters
    ----------
    uncertainty : Uncertainty
        The estimate within them.
    held : {name: (lower, upper)}
        The ranges, in each parameter's unit.
    fits : sequence of Fit
        What the held model calculates, the fitted events first.
    validate : sequence of Event
        The events held out.

    Returns
    -------
    FreeOptimum or None
        None where no range holds the estimate, or where a free fit stays within all of them.
    """
    if not _list_at_range_ends(uncertainty, held):
        return None
    problem = uncertainty.likelihood.problem
    own = {p.name: p.bounds for p in problem.parameters if p.name not in held}
    try:
        free = problem.vary(problem.model, own)
    except UserError:
        return None
    known = free.space.to_unit(uncertainty.values)
    starts = np.vstack([known, spread_evenly(FREE_STARTS, len(known))])
    likelihood, ended = uncertainty.descend_in(free, starts)
    if not ended.deviance.min() < uncertainty.deviance:
        return None
    values = likelihood.values(ended.best)
    away = _find_outside(dict(zip(free.space.names, values.tolist(), strict=True)), held)
    try:
        played = play(free, values, validate)
    except UserError:  # beside these values some event has no steady state
        return None
    return _compare(played, fits, len(free.events), away) if away else None


def say_ranges(uncertainty: Uncertainty, held: Mapping[str, Sequence[float]]) -> Uncertainty:
    """The judgement in which a parameter at the end of what machines have is called so.

    Nobody is told to widen that range, as with other bounds.
    """
    told = {
        name: ParameterVerdict(END_OF_RANGE, f"{value:.4g}")
        for name, value in zip(uncertainty.names, uncertainty.values.tolist(), strict=True)
        if name in _list_at_range_ends(uncertainty, held)
        and uncertainty.verdicts[name].word == BOUND
    }
    return replace(uncertainty, verdicts=uncertainty.verdicts | told)


def _compare(
    free: Sequence[Fit], held: Sequence[Fit], fitted: int, away: dict[str, float]
) -> FreeOptimum:
    errors = [compute_model_error(fits[:fitted]).value for fits in (free, held)]
    predicted = [None, None]
    if len(held) > fitted:
        predicted = [compute_model_error(fits[fitted:]).value for fits in (free, held)]
    return FreeOptimum(away, errors[0], errors[1], predicted[0], predicted[1])


def _list_at_range_ends(uncertainty: Uncertainty, held: Mapping[str, Sequence[float]]) -> list[str]:
    """Parameters that stand at an end of the range that they are held to."""
    width = uncertainty.upper - uncertainty.lower
    near = np.minimum(
        uncertainty.values - uncertainty.lower, uncertainty.upper - uncertainty.values
    )
    at = near < BOUND_DISTANCE * width
    return [
        name
        for name, bound in zip(uncertainty.names, at, strict=True)
        if bound and name.partition("[")[0] in held
    ]


def _find_outside(
    values: Mapping[str, float], held: Mapping[str, Sequence[float]]
) -> dict[str, float]:
    """Those of the values that lie outside the ranges of their parameters."""
    ranges = {
        name: held[name.partition("[")[0]] for name in values if name.partition("[")[0] in held
    }
    return {
        name: values[name]
        for name, (low, high) in ranges.items()
        if not low * (1 - BOUND_DISTANCE) <= values[name] <= high * (1 + BOUND_DISTANCE)
    }
