"""Work on all cores: lanes of one call side by side, and independent items each by themselves."""

import functools
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np

from tractexp.kernel.layout import LANES
from tractexp.progress import Counting, uncounted

FEWEST = 16  # lanes that are worth a call
Item = TypeVar("Item")
Result = TypeVar("Result")


def cores() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def side_by_side(function: Callable[[np.ndarray], np.ndarray], lanes: np.ndarray) -> np.ndarray:
    """`function` of lanes (n, ...), on all cores: they do not know of each other, so the bits are the same."""
    return _in_parts(function, lanes, min(cores(), -(-len(lanes) // FEWEST)))


def in_same_parts(function: Callable[[np.ndarray], np.ndarray], lanes: np.ndarray) -> np.ndarray:
    """As `side_by_side`, of a function whose last bits depend on how many lanes it is given, as matrix products do.

    How lanes are parted does not depend on the number of cores, so that no result does.
    """
    return _in_parts(function, lanes, max(-(-len(lanes) // LANES), min(2, -(-len(lanes) // FEWEST))))


def _in_parts(function: Callable[[np.ndarray], np.ndarray], lanes: np.ndarray, parts: int) -> np.ndarray:
    if parts < 2:
        return function(lanes)
    return np.concatenate(list(_threads().map(function, np.array_split(lanes, parts))))


def each_apart(
    function: Callable[[Item], Result], items: Sequence[Item], parts: Callable[[int], Counting] = uncounted
) -> list[Result]:
    """`function` of each item, on all cores. It may itself work `side_by_side`, whose threads are others.

    `parts` (`Effort.parts`) counts the items that have ended.
    """
    with parts(len(items)) as ended:

        def counted(item: Item) -> Result:
            result = function(item)
            ended()
            return result

        if min(cores(), len(items)) < 2:
            return [counted(item) for item in items]
        with ThreadPoolExecutor(cores()) as pool:
            return list(pool.map(counted, items))


@functools.cache
def _threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor()
