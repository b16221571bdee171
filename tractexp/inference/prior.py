"""Weak priors: what machines usually are, as rows of the least squares beside those of the records.

What a wrong model leaves is no noise, and its samples are not independent. Taken for independent,
two thousand of them would break any prior for the last percent of an error that has other reasons.
So a block of samples, as long as the residual remembers (`blocks`), counts as much as one row of
the prior.
"""

from collections.abc import Sequence

import numpy as np

from tractexp.inference.blocks import cut_blocks
from tractexp.inference.problem import Problem
from tractexp.model.drive import Drive
from tractexp.record import Event


def compute_departures(problem: Problem, values: np.ndarray) -> np.ndarray:
    """How far candidates are from what the model's motor usually is.

    Each usual quantity has a median and a factor, the spread of its logarithm: a departure is
    log(quantity / median) / log(factor).

    Parameters
    ----------
    problem : Problem
        Whose model has the motor.
    values : (n, d)
        Free values of n candidates.

    Returns
    -------
    (n, k) array
        In standard deviations, of k quantities; k is 0 for a motor of which nothing is known.
    """
    by_name = dict(zip(problem.model.names, problem.full(values).T, strict=True))
    motor = problem.model.motor
    with np.errstate(divide="ignore", invalid="ignore"):  # of what no machine has
        rows = [
            np.log(quantity / median) / np.log(factor)
            for quantity, median, factor in motor.list_usual(
                {p.name: by_name[p.name] for p in motor.parameters}
            )
        ]
    return np.stack(rows, axis=1) if rows else np.empty((len(np.atleast_2d(values)), 0))


def compute_prior_rows(problem: Problem, values: np.ndarray, weight: float) -> np.ndarray:
    """The residuals (n, k) of the motor's prior at free values (n, d): weighted departures; k is 0
    where the weight is.
    """
    return weight * compute_departures(problem, values) if weight else np.empty((len(values), 0))


def weigh_prior(events: Sequence[Event], drive: Drive, free: int) -> float:
    """The weight of a prior's rows beside residuals in units of what is left.

    Parameters
    ----------
    events : sequence of Event
        The events of the drive.
    drive : Drive
        Their samples; those of weight 0 do not count.
    free : int
        Number of free parameters.

    Returns
    -------
    float
        The root of the samples of a block: a block of samples then counts as one row of the prior.
    """
    samples = int(np.count_nonzero(drive.weights > 0))
    return float(np.sqrt(samples / len(cut_blocks(events, drive, free))))


def describe_prior(problem: Problem, values: np.ndarray) -> str:
    """A sentence that the free values (d,) were held by a prior, and how far off it they are."""
    (off,) = np.abs(compute_departures(problem, values[None]))
    far = (
        f", and is {off.max():.2g} standard deviations off where it is farthest"
        if len(off)
        else " (which says nothing)"
    )
    return f"the motor is held to what machines usually are (model.priors){far}"
