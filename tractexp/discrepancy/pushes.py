"""Pushes into the balances in windows of time: the yardstick of what no effect of the catalogue explains."""

import numpy as np

from tractexp.discrepancy.bench import Bench
from tractexp.discrepancy.injection import PUSHES
from tractexp.identification.surprises import windows

PUSH = 1e-3  # how hard


def push_points(bench: Bench, unit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (c, D) with a push into one balance in one window of the union of the events', and which balance."""
    at = bench.coordinates
    spans = sorted({w for e in range(len(bench.events)) for w in windows(bench, e)})
    points, groups = [], []
    for g, push in enumerate(PUSHES):
        for a, b in spans:
            point = at.placed(unit, {"window_on": a, "window_off": b})
            point[at.column[push]] += PUSH / at.width(push)
            points.append(point)
            groups.append(g)
    return np.array(points), np.array(groups)
