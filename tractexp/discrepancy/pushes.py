"""Pushes into the balances in windows of time: the yardstick of what no effect of the catalogue explains."""

import itertools

import numpy as np

from tractexp.discrepancy.bench import Bench
from tractexp.discrepancy.injection import PUSHES

WINDOWS = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6)  # s after the end of the dip
PUSH = 1e-3  # how hard


def windows(bench: Bench, event: int) -> list[tuple[float, float]]:
    """The windows [s since the first sample] of one event: before, both halves of the dip, then ever longer ones."""
    e = bench.events[event]
    start, end = e.t_start - e.record.t[0], e.t_end - e.record.t[0]
    last = e.record.t[-1] - e.record.t[0]
    edges = [0.0, start, (start + end) / 2, *(end + w for w in WINDOWS if end + w < last), last]
    return [(a, b) for a, b in itertools.pairwise(edges) if b > a]


def push_points(bench: Bench, unit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (c, D) with a push into one balance in one window of the union of the events', and which balance."""
    at = bench.coordinates
    spans = sorted({w for e in range(len(bench.events)) for w in windows(bench, e)})
    points, groups = [], []
    for g, push in enumerate(PUSHES):
        for a, b in spans:
            point = unit.copy()
            point[at.column[push]] += PUSH / at.width(push)
            point[at.column["window_on"]] = at.to_unit("window_on", a)
            point[at.column["window_off"]] = at.to_unit("window_off", b)
            points.append(point)
            groups.append(g)
    return np.array(points), np.array(groups)
