"""Work on all cores: lanes of one call side by side, and independent items each by themselves."""

import functools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np

from tractexp.model.template import GROUP

Item = TypeVar("Item")
Result = TypeVar("Result")


def side_by_side(function: Callable[[np.ndarray], np.ndarray], lanes: np.ndarray) -> np.ndarray:
    """`function` of lanes (n, ...), on all cores: they do not know of each other, so the bits are the same."""
    from numba import get_num_threads

    parts = min(get_num_threads(), -(-len(lanes) // (2 * GROUP)))
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
