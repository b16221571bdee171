"""How a fit does on dips that it has not seen."""

from collections.abc import Sequence

import numpy as np

from tractexp.record import Event


def compare_depths(events: Sequence[Event], fitted: Sequence[Event]) -> list[str]:
    """Whether each dip is within the depths that were fitted.

    Parameters
    ----------
    events : sequence of Event
        Dips that a fit has not seen.
    fitted : sequence of Event
        Those it was fitted to.

    Returns
    -------
    list of str
        "interpolation" for a dip no deeper than the deepest that was fitted, else "extrapolation".
    """
    deepest = max(event.depth for event in fitted)
    return ["interpolation" if event.depth <= deepest else "extrapolation" for event in events]


def compute_mean_residual(measured: np.ndarray, calculated: np.ndarray) -> float:
    """Eq. (21) of the paper: the mean of |measured - calculated| [pu], both (N,), without gaps
    (nan).

    Examples
    --------
    >>> compute_mean_residual(np.array([1.0, np.nan, 0.5]), np.array([0.75, 0.75, 0.5]))
    0.125
    """
    return float(np.nanmean(np.abs(measured - calculated)))
