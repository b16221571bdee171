"""The noise of records, estimated from what a fit leaves where little happens.

P and Q are correlated with each other and in time (`tractexp.noise`), a load wanders, and what is
left of the voltage's noise enters the model and leaves it in P and Q at once.
"""

import functools
from collections.abc import Sequence

import numpy as np

from tractexp.inference.problem import Problem
from tractexp.model.drive import Drive
from tractexp.noise.model import Noise
from tractexp.noise.random_walk import find_load_walk
from tractexp.noise.voltage import SmoothedEvent

# of a residual's variance: where columns explain more, it tells nothing of the noise
LEAST_VARIANCE = 0.2
ROUNDS_OF_NOISE = 2  # and fit in turn
MOST_SAMPLES = 2_000_000  # of voltages with an error that are simulated at once


def compute_input_modes(
    problem: Problem, smoothed: Sequence[SmoothedEvent], values: np.ndarray
) -> np.ndarray | None:
    """The errors of the record, as what is compared shows them.

    Parameters
    ----------
    problem : Problem
        Driven by smoothed voltages.
    smoothed : sequence of SmoothedEvent
        Its events, and what may still be wrong with their voltages.
    values : (d,)
        Free values of the problem.

    Returns
    -------
    (k, C, N) array [pu] or None
        One standard deviation each: of the voltage's noise, or what the domain says. None where
        there is none.
    """
    if (errors := problem.domain.input_errors(problem, values)) is not None:
        return errors
    most = max(len(s.errors) for s in smoothed)
    if not most:
        return None
    together = max(1, MOST_SAMPLES // problem.drive.samples)
    shapes = [None, *range(most)]
    parts = [
        _simulate_voltage_errors(problem, smoothed, values, shapes[k : k + together])
        for k in range(0, len(shapes), together)
    ]
    power = np.concatenate(parts)
    return np.nan_to_num(power[1:] - power[0])


def _simulate_voltage_errors(
    problem: Problem,
    smoothed: Sequence[SmoothedEvent],
    values: np.ndarray,
    shapes: Sequence[int | None],
) -> np.ndarray:
    """Power (shapes, 2, N) under the smoothed voltages, each with one of its errors; all in one
    simulation.
    """
    count = len(shapes)
    events = [s.event if k is None else s.off_by(k) for k in shapes for s in smoothed]
    drive = Drive.from_events([problem.domain.excitation(event, problem.model) for event in events])
    own = np.tile(problem.by_event(values), (count, 1, 1))
    response = problem.model.simulate(drive, own, np.tile(problem.step.substeps, count))
    return response.outputs[:, 0].reshape(drive.channels, count, -1).swapaxes(0, 1)


def restore_variance(residuals: np.ndarray, leverage: np.ndarray) -> np.ndarray:
    """Residuals (..., R) of which columns have taken the share `leverage` (R,), each divided by
    what is left of its variance, so that the noise does not come out too small.
    """
    return residuals / np.sqrt(np.maximum(1 - leverage, LEAST_VARIANCE))


def estimate_noise(
    records: Problem,
    residual: np.ndarray,
    valid: np.ndarray,
    quiet: Sequence[slice],
    model: tuple[Problem, np.ndarray],
    input_errors: np.ndarray | None,
    left: np.ndarray | None,
    columns: np.ndarray | None,
) -> Noise:
    """The noise of a residual, from the quiet stretches of the records.

    Parameters
    ----------
    records : Problem
        The events.
    residual : (C, N) [pu]
        Whose noise is estimated.
    valid : (C, N) bools
        Which samples count.
    quiet : sequence of slice
        Where little happens.
    model : (Problem, (d,))
        With its free values it tells how noise of the voltage is passed on.
    input_errors : (k, C, N) [pu] or None
        What errors of the record do.
    left : (C, N) [pu] or None
        What a fit leaves; it tells more of how the load wanders.
    columns : (k, C, N) [pu] or None
        What could explain that.

    Returns
    -------
    Noise

    Raises
    ------
    UserError
        Where too few samples are quiet.
    """
    walk = functools.partial(
        find_load_walk, records.events, records.drive, records.power, left, columns, valid
    )
    return records.domain.noise(residual, valid, quiet, *model, walk, input_errors)
