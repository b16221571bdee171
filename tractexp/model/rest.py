"""Whether the steady state that the parts declare is exact, or a first guess that the kernel has to solve for."""

from collections.abc import Mapping, Sequence

import numpy as np
import sympy

from tractexp.kernel.arrays import values_of
from tractexp.kernel.lowered import Phase
from tractexp.model.equations import Equations

POINTS, TRIES = 5, 200  # admissible points looked at, of so many that are drawn
ROUNDING = 1e-7  # of a balance [pu/s, rad/s²]: above what doubles leave of zero, below what a guess misses by
EVENTS: Mapping[str, tuple[float, float]] = {
    "U0": (0.9, 1.1), "omega_s0": (-3.0, 3.0), "U20": (0.01, 0.05), "omega_n": (310.0, 380.0), "step": (1e-3, 1e-2),
    "P0": (0.5, 1.5), "Q0": (0.3, 0.9),
}  # fmt: skip


def settled(eq: Equations, start: Phase, rest: Phase, starts: Sequence[sympy.Symbol]) -> bool:
    """Whether every balance vanishes at the declared start, at random parameters and events that have a steady state.

    `start` computes `starts` and then the slack of each requirement, `rest` the balances from them.
    """
    ranges = {**{name: p.bounds for name, p in eq.parameters.items()}, **EVENTS}
    low, high = np.array([*ranges.values()]).T
    drawn = np.random.default_rng(0).uniform(low, high, (TRIES, len(ranges))).T
    given = {sympy.Symbol(name, real=True): values for name, values in zip(ranges, drawn, strict=True)}
    values = values_of(start, given, TRIES)
    first, slacks = values[: len(starts)], values[len(starts) :]
    balances = values_of(rest, given | dict(zip(starts, first, strict=True)), TRIES)
    finite = np.isfinite(np.array([*first, *slacks, *balances])).all(axis=0)
    admissible = finite & (np.array([np.ones(TRIES), *slacks]) >= 0).all(axis=0)
    points = np.flatnonzero(admissible)[:POINTS]
    missed = np.abs(np.array([np.zeros(TRIES), *balances])[:, points]).max(axis=0)
    return len(points) == POINTS and bool((missed < ROUNDING).all())
