"""Weak priors: what machines usually are, as rows of the least squares beside those of the records.

What a wrong model leaves is no noise, and its samples are not independent. Taken for independent,
two thousand of them would break any prior for the last percent of an error that has other reasons.
So a block of samples, as long as the residual remembers (`blocks`), counts as much as one row of
the prior.
"""

from collections.abc import Sequence

import numpy as np

from tractexp.inference.blocks import blocks_of
from tractexp.inference.problem import Problem
from tractexp.model.drive import Drive
from tractexp.record import Event


def departures(problem: Problem, values: np.ndarray) -> np.ndarray:
    """How far free values (n, d) are from what the model's motor usually is, (n, k), in standard
    deviations.
    """
    by_name = dict(zip(problem.model.names, problem.full(values).T, strict=True))
    motor = problem.model.motor
    with np.errstate(divide="ignore", invalid="ignore"):  # of what no machine has
        rows = [
            np.log(quantity / median) / np.log(factor)
            for quantity, median, factor in motor.usual(
                **{p.name: by_name[p.name] for p in motor.parameters}
            )
        ]
    return np.stack(rows, axis=1) if rows else np.empty((len(np.atleast_2d(values)), 0))


def weigh_prior(events: Sequence[Event], drive: Drive, free: int) -> float:
    """The weight of a prior's rows beside residuals in units of what is left, with which a block of
    samples counts as one of them; `free` is the number of free parameters.
    """
    samples = int(np.count_nonzero(drive.weights > 0))
    return float(np.sqrt(samples / len(blocks_of(events, drive, free))))


def held_in_words(problem: Problem, values: np.ndarray) -> str:
    """That free values (d,) were held by a prior, and how far off it they are, in a sentence."""
    (off,) = np.abs(departures(problem, values[None]))
    far = (
        f", and is {off.max():.2g} standard deviations off where it is farthest"
        if len(off)
        else " (which says nothing)"
    )
    return f"the motor is held to what machines usually are (model.priors){far}"
