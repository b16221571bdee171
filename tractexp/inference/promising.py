"""Which of many starts of a set of effects are worth a descent, by one simulation each.

A descent of a few iterations costs a simulation for every free parameter in each of them. One
simulation at the start tells what its thresholds and times change; how far a multiple of that, with
what the base model and the faults of the measurement can take in one linear step, lowers the
deviance ranks the starts as the first iterations would.
"""

from collections.abc import Sequence

import numpy as np

from tractexp.inference.context import Context
from tractexp.inference.differences import replace_diverged
from tractexp.noise import Noise
from tractexp.noise.span import project_out

LEAST_DEVIANCE_SHARE = 1e-9  # of the deviance: a change below that is none


def select_promising_starts(
    context: Context,
    noise: Noise,
    names: Sequence[str],
    units: np.ndarray,
    nuisances: Sequence[int],
    most: int,
) -> np.ndarray:
    """The starts of one set of effects that promise most, by one simulation each.

    Parameters
    ----------
    context : Context
        The records and models.
    noise : Noise
        Under which they are fitted.
    names : names
        The effects.
    units : (n, D)
        Coordinates of the starts.
    nuisances : columns
        Coordinates that give way.
    most : int
        How many are chosen.

    Returns
    -------
    (at most `most`, D) array
        In their order.
    """
    if len(units) <= most:
        return units
    grounds = np.array([context.coordinates.remove_effects(unit, names) for unit in units])
    expected = np.empty(len(units))
    for ground in np.unique(grounds, axis=0):
        mine = (grounds == ground).all(axis=1)
        expected[mine] = _expect_deviance(context, noise, names, ground, units[mine], nuisances)
    return units[np.sort(np.argsort(expected, kind="stable")[:most])]


def _expect_deviance(
    context: Context,
    noise: Noise,
    names: Sequence[str],
    ground: np.ndarray,
    units: np.ndarray,
    nuisances: Sequence[int],
) -> np.ndarray:
    """The deviance (n,) of a linear step from each start, which differ from `ground` (D,) by their
    effects alone.
    """
    raw, rows = context.linearize(ground, noise, nuisances, ())
    Q = np.linalg.qr(rows[1:].T)[0]
    r = rows[0] - Q @ (rows[0] @ Q)
    white = context.whiten(noise, replace_diverged(context.residuals(units, names) - raw))
    changes = np.pad(white, ((0, 0), (0, len(r) - white.shape[1])))
    changes = project_out(changes, Q.T)
    power = np.einsum("nr,nr->n", changes, changes)
    return r @ r - (changes @ r) ** 2 / np.maximum(power, LEAST_DEVIANCE_SHARE * (r @ r) + 1e-300)
