"""Where searches start: points that fill a box evenly, and the best of many points that are distinct."""

import numpy as np


def even(n: int, d: int) -> np.ndarray:
    """(n, d) points that fill the unit cube evenly. Source: Roberts 2018, the additive sequence R_d."""
    ratio = 2.0
    for _ in range(60):  # the root above 1 of x^(d + 1) = x + 1
        ratio = (1 + ratio) ** (1 / (d + 1))
    return (0.5 + np.outer(np.arange(1, n + 1), ratio ** -np.arange(1.0, d + 1))) % 1


def best_distinct(unit: np.ndarray, f: np.ndarray, distance: float, count: int, norm: float = np.inf) -> np.ndarray:
    """Indices of at most `count` points, best first, each further than `distance` from every better one chosen.

    `unit` (n, d) in the unit cube, `f` (n,) objectives, lower is better. `norm` is the order of the distance's norm:
    `np.inf` takes the coordinate that differs most, 2 is Euclid's.
    """
    left, chosen = np.argsort(f, kind="stable"), []
    while len(left) and len(chosen) < count:
        chosen.append(left[0])
        left = left[np.linalg.norm(unit[left] - unit[left[0]], norm, axis=1) > distance]
    return np.array(chosen, dtype=int)
