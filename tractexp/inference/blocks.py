"""Blocks of a tenth of a second: what a model leaves in one tells little of what it leaves in the
next.

A residual that is no noise is correlated, in a way that no noise model knows. Blocks longer than
its memory are nearly independent, and to leave out one of them at a time tells how far an estimate
hangs on each: the delete-a-block jackknife. Source: Kunsch 1989 (blocks of a series); MacKinnon,
Nielsen and Webb 2023 (clusters of a regression).
"""

import itertools
from collections.abc import Sequence

import numpy as np

from tractexp.inference.interval import compute_interval_factor
from tractexp.model.drive import Drive
from tractexp.record import Event

LENGTH = 0.1  # s, longer than the memory of what third-order motors leave
FEWEST_BLOCKS = 3  # blocks for each parameter: of records with fewer, blocks are shorter
LEAST_SQUARES_DIFFERENCE = 0.02  # of a sum of squares, 1 % of an error: less is no difference


def cut_blocks(
    events: Sequence[Event], drive: Drive, parameters: int = 1, *, from_dip: bool = False
) -> list[slice]:
    """Blocks of the drive's samples, counted from the start of each dip.

    Parameters
    ----------
    events : sequence of Event
        The events of the drive.
    drive : Drive
        Their samples, one event after the other.
    parameters : int
        Number of free parameters. Blocks are `LENGTH` [s] long, or shorter where a record would
        have fewer than `FEWEST_BLOCKS` of them for each parameter.
    from_dip : bool
        Whether samples before the dip are left out.

    Returns
    -------
    list of slice
        In the order of the samples; each lies within one event.
    """
    parts = drive.parts
    starts = [part.start + event.start for part, event in zip(parts, events, strict=True)]
    first = starts if from_dip else [part.start for part in parts]
    seconds = sum(
        (p.stop - a) * e.record.step for p, a, e in zip(parts, first, events, strict=True)
    )
    length = min(LENGTH, seconds / (FEWEST_BLOCKS * max(parameters, 1)))
    pieces = []
    for part, begin, start, event in zip(parts, first, starts, events, strict=True):
        n = max(1, round(length / event.record.step))
        edges = [
            begin,
            *range(start - (start - begin - 1) // n * n, start, n),
            *range(start, part.stop - n // 2, n),
        ]
        edges = sorted({*edges, part.stop})
        pieces += [slice(a, b) for a, b in itertools.pairwise(edges)]
    return pieces


def exceeds(squares: np.ndarray, others: np.ndarray, blocks: Sequence[slice]) -> bool:
    """Whether squares exceed others by more than chance explains.

    The differences are paired by sample and summed over blocks. Their sum has to be more than twice
    its scatter, and more than `LEAST_SQUARES_DIFFERENCE` of the others.

    Parameters
    ----------
    squares, others : (N,)
        Squares of two residuals at the same samples.
    blocks : sequence of slice
        Blocks of the samples, nearly independent of each other.

    Returns
    -------
    bool

    Examples
    --------
    >>> blocks = [slice(0, 2), slice(2, 4)]
    >>> exceeds(np.array([2.0, 2.0, 2.0, 2.0]), np.ones(4), blocks)
    True
    >>> bool(exceeds(np.array([9.0, 9.0, 0.0, 0.0]), np.ones(4), blocks))
    False
    """
    difference = np.array([float(np.sum(squares[b] - others[b])) for b in blocks])
    count = len(difference)
    total = float(difference.sum())
    scatter = np.sqrt(count / max(count - 1, 1) * np.sum((difference - difference.mean()) ** 2))
    return total > 2 * scatter and total > LEAST_SQUARES_DIFFERENCE * sum(
        float(others[b].sum()) for b in blocks
    )


def reach(without: np.ndarray, whole: float) -> float:
    """Half of the 95 % interval of a figure, by the delete-a-block jackknife.

    Parameters
    ----------
    without : (b,)
        The figure without each of the blocks.
    whole : float
        The figure of all of them.

    Returns
    -------
    float
        In the unit of the figure; infinite for fewer than two blocks, which tell nothing of chance.

    Examples
    --------
    >>> round(reach(np.array([0.9, 1.0, 1.1]), 1.0), 3)
    0.497
    >>> reach(np.array([1.0]), 1.0)
    inf
    """
    count = len(without)
    if count < 2:
        return np.inf
    return compute_interval_factor(count - 1) * float(
        np.sqrt((count - 1) / count * np.sum((without - whole) ** 2))
    )
