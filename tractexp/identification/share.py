"""The motors' part of the active power, over all its range: what a dip tells of it is often a lower
bound.

A motor that is loaded less draws less of P and answers the dip alike: reactances and inertia take
the factor up. Where the profile stays flat to the upper end, the estimate is one of many, and what
is told is where it begins to rise.
"""

from typing import Any

import numpy as np

from tractexp.errors import UserError
from tractexp.identification.profile_lanes import descend_others
from tractexp.identification.uncertainty import Uncertainty
from tractexp.inference.bounds import BOUND_DISTANCE
from tractexp.inference.sized_problem import find_torque

SHARES_HELD = 9  # over the range of the torque, all else fitted again at each


def find_share_bound(uncertainty: Uncertainty) -> dict[str, Any]:
    """The share of the motors, where the records bound it from below alone: `share_bound` of
    `result.json`.

    Parameters
    ----------
    uncertainty : Uncertainty
        The estimate, with a profile of the motor's torque.

    Returns
    -------
    dict
        `low`, the least share of the motors in P that the records allow; `high`, the end of the
        range, up to which they tell no difference; `profile` [{share, error}], the fit's error over
        the least at shares all over the range; and the `sentence`. {} where the records bound the
        share on both sides or on none, and where no profile was drawn.
    """
    problem = uncertainty.likelihood.problem
    try:
        torque = find_torque(problem.model).name
    except UserError:
        return {}
    if torque not in uncertainty.profiled:
        return {}
    c = uncertainty.names.index(torque)
    lower = uncertainty.lower[c]
    upper = uncertainty.upper[c]
    low, high = uncertainty.intervals[c]
    near = BOUND_DISTANCE * (upper - lower)
    if high < upper - near or low <= lower + near:
        return {}
    drawn = float(np.mean([event.P0 for event in problem.events]))
    if not drawn > 0:
        return {}
    least = float(low) / drawn
    most = float(upper) / drawn
    return {
        "low": least,
        "high": most,
        "profile": _draw_profile(uncertainty, c, drawn),
        "sentence": (
            f"the motors draw at least {least:.0%} of P: from there to {most:.0%}, the end of the"
            " range, these dips tell no difference"
        ),
    }


def _draw_profile(uncertainty: Uncertainty, c: int, drawn: float) -> list[dict[str, float]]:
    """The share and the error over the least, with coordinate c held at values all over its range,
    for a load of `drawn` [pu].
    """
    held = (np.arange(SHARES_HELD) + 0.5) / SHARES_HELD
    starts = np.tile(uncertainty.unit, (SHARES_HELD, 1))
    starts[:, c] = held
    columns = np.full(SHARES_HELD, c)
    ended = descend_others(uncertainty, starts, columns, tolerance=0.05)
    low = uncertainty.lower[c]
    high = uncertainty.upper[c]
    shares = (low + held * (high - low)) / drawn
    least = min(uncertainty.deviance, float(ended.deviance.min()))
    errors = np.sqrt(ended.deviance / least)
    seen = np.isfinite(errors)
    pairs = zip(shares[seen].tolist(), errors[seen].tolist(), strict=True)
    return [{"share": share, "error": error} for share, error in pairs]
