"""Work on all cores: lanes of one call side by side, and independent items each by themselves."""

import functools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np

from tractexp.model.template import GROUP

FEWEST, MOST = 2 * GROUP, 7 * GROUP  # lanes that are worth a call, and that one call has
Item = TypeVar("Item")
Result = TypeVar("Result")


def side_by_side(function: Callable[[np.ndarray], np.ndarray], lanes: np.ndarray) -> np.ndarray:
    """`function` of lanes (n, ...), on all cores: they do not know of each other, so the bits are the same."""
    from numba import get_num_threads

    return _in_parts(function, lanes, min(get_num_threads(), -(-len(lanes) // FEWEST)))


def in_same_parts(function: Callable[[np.ndarray], np.ndarray], lanes: np.ndarray) -> np.ndarray:
    """As `side_by_side`, of a function whose last bits depend on how many lanes it is given, as matrix products do.

    How lanes are parted does not depend on the number of cores, so that no result does.
    """
    return _in_parts(function, lanes, max(-(-len(lanes) // MOST), min(2, -(-len(lanes) // FEWEST))))


def _in_parts(function: Callable[[np.ndarray], np.ndarray], lanes: np.ndarray, parts: int) -> np.ndarray:
    if parts < 2:
        return function(lanes)
    return np.concatenate(list(_threads().map(function, np.array_split(lanes, parts))))


def each_apart(function: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
    """`function` of each item, on all cores. It may itself work `side_by_side`, whose threads are others."""
    from numba import get_num_threads

    if min(get_num_threads(), len(items)) < 2:
        return [function(item) for item in items]
    with ThreadPoolExecutor(get_num_threads()) as pool:
        return list(pool.map(function, items))


@functools.cache
def _threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor()
