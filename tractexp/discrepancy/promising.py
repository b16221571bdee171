"""Which of many starts of a set of effects are worth a descent, by one simulation each.

A descent of a few iterations costs a simulation for every free parameter in each of them. One simulation at the start
tells what its thresholds and times change; how far a multiple of that, with what the base model and the faults of the
measurement can take in one linear step, lowers the deviance ranks the starts as the first iterations would.
"""

from collections.abc import Sequence

import numpy as np

from tractexp.discrepancy.bench import Bench
from tractexp.noise import Noise

STEP = 1e-4  # of a coordinate's range
LEAST = 1e-9  # of the deviance: a change below that is none


def promising(
    bench: Bench, noise: Noise, names: Sequence[str], units: np.ndarray, nuisances: Sequence[int], prior: Sequence[int],
    most: int,
) -> np.ndarray:  # fmt: skip
    """The starts (n, D) of one set of effects that promise most, at most so many, in their order.

    `nuisances` are the coordinates that give way, `prior` those that have one.
    """
    if len(units) <= most:
        return units
    grounds = np.array([bench.coordinates.without(unit, names) for unit in units])
    expected = np.empty(len(units))
    for ground in np.unique(grounds, axis=0):
        mine = (grounds == ground).all(axis=1)
        expected[mine] = _expected(bench, noise, names, ground, units[mine], nuisances, prior)
    return units[np.sort(np.argsort(expected, kind="stable")[:most])]


def _expected(
    bench: Bench, noise: Noise, names: Sequence[str], ground: np.ndarray, units: np.ndarray,
    nuisances: Sequence[int], prior: Sequence[int],
) -> np.ndarray:  # fmt: skip
    """The deviance (n,) of a linear step from each start, which differ from `ground` (D,) by their effects alone."""
    steps = np.where(ground[list(nuisances)] < 0.5, STEP, -STEP)
    moved = np.tile(ground, (len(nuisances), 1))
    moved[np.arange(len(nuisances)), list(nuisances)] += steps
    rows = bench.rows(
        np.concatenate([ground[None], moved, units]), noise, prior, [()] * (1 + len(moved)) + [names] * len(units)
    )
    r, slopes, changes = rows[0], rows[1 : 1 + len(moved)] - rows[0], rows[1 + len(moved) :] - rows[0]
    Q = np.linalg.qr(np.nan_to_num(slopes / steps[:, None]).T)[0]
    r = r - Q @ (r @ Q)
    changes = np.nan_to_num(changes)
    changes -= (changes @ Q) @ Q.T
    power = np.einsum("nr,nr->n", changes, changes)
    return r @ r - (changes @ r) ** 2 / np.maximum(power, LEAST * (r @ r) + 1e-300)
