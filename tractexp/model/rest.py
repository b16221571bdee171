"""Whether the steady state that the parts declare is exact, or a first guess that the kernel has to solve for."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import sympy

from tractexp.model.equations import Equations

if TYPE_CHECKING:
    from tractexp.model.lowering import Phase

POINTS, TRIES = 5, 200  # admissible points looked at, and points drawn until there are so many
ROUNDING = 1e-7  # of a balance [pu/s, rad/s²]: above what doubles leave of zero, below what a guess misses by
EVENTS: Mapping[str, tuple[float, float]] = {
    "U0": (0.9, 1.1), "omega_s0": (-3.0, 3.0), "U20": (0.01, 0.05), "omega_n": (310.0, 380.0), "step": (1e-3, 1e-2),
    "P0": (0.5, 1.5), "Q0": (0.3, 0.9),
}  # fmt: skip


def settled(eq: Equations, start: "Phase", rest: "Phase", starts: Sequence[sympy.Symbol]) -> bool:
    """Whether every balance vanishes at the declared start, at random parameters and events that have a steady state.

    `start` computes `starts` and then the slack of each requirement, `rest` the balances from them.
    """
    given = [sympy.Symbol(name, real=True) for name in (*eq.parameters, *EVENTS)]
    begin, balance = _numeric(start, given), _numeric(rest, [*given, *starts])
    rng, seen = np.random.default_rng(0), 0
    ranges = np.array([*(p.bounds for p in eq.parameters.values()), *EVENTS.values()])
    for _ in range(TRIES):
        point = rng.uniform(*ranges.T).tolist()
        try:
            found = begin(*point)
            first, slack = found[: len(starts)], found[len(starts) :]
            if not all(s >= 0 for s in slack):
                continue
            missed = balance(*point, *first)
        except (ValueError, ZeroDivisionError, OverflowError):
            continue
        if not max(map(abs, missed), default=0.0) < ROUNDING:
            return False
        seen += 1
        if seen == POINTS:
            return True
    return False


def _numeric(phase: "Phase", symbols: Sequence[sympy.Symbol]) -> Callable[..., list[float]]:
    """The expressions of a phase as a function of numbers."""
    ready = lambda _: (list(phase.temporaries), list(phase.expressions))  # noqa: E731
    return sympy.lambdify(list(symbols), list(phase.expressions), "math", cse=ready)
