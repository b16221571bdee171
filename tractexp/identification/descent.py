"""Damped least squares of many problems at once: every lane takes its step in the same two simulation calls.

Profiles, starts and subsets of events are lanes. A call with the differences of all lanes and a call with several
dampings of all steps replace hundreds of single simulations, which cost as much to call as to run.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

# (n, D) unit values and (n,) their lanes -> rows (n, R) whose squares are summed; nan rows cannot be simulated
Rows = Callable[[np.ndarray, np.ndarray], np.ndarray]

DIFFERENCE = 1e-6  # of a parameter's range
CENTRAL = 1e-5  # of it, where both sides are taken: truncation and rounding both stay below 1e-7 of a column
DAMPINGS = np.array([1e-3, 1e-1, 1e1, 1e3])  # tried together, relative to the lane's own
LEAST_DAMPING, MOST_DAMPING = 1e-9, 1e9
LARGEST_STEP = 0.3  # of a parameter's range
MOST_NUMBERS = 8_000_000  # of all differences held at once


@dataclass(frozen=True, eq=False)
class Descent:
    """Where each lane ended: `unit` (n, D) in the unit cube, `deviance` (n,) its sum of squares (inf: never begun)."""

    unit: np.ndarray
    deviance: np.ndarray
    simulations: int


@dataclass(frozen=True, eq=False)
class SeparableColumns:
    """Coordinates (k,) that act on different rows, (k, R) where True: one simulation has the differences of all.

    Several of them act on the same rows.
    """

    coordinates: np.ndarray
    rows: np.ndarray


def _alone(size: int, apart: Sequence[SeparableColumns]) -> np.ndarray:
    """Which of so many coordinates are in none of the groups."""
    alone = np.ones(size, dtype=bool)
    for group in apart:
        alone[group.coordinates] = False
    return np.flatnonzero(alone)


def forward_differences(
    rows: Rows, unit: np.ndarray, base: np.ndarray, lanes: np.ndarray, apart: Sequence[SeparableColumns] = ()
) -> np.ndarray:
    """Derivatives (n, k, R) of the rows at `unit` (n, D), where they are `base` (n, R), away from the nearer wall.

    First those to each coordinate that is in no group, then one of each group: in each row that to the coordinate that
    acts there. One that cannot be simulated is zero.
    """
    n, d = unit.shape
    alone = _alone(d, apart)
    steps = np.zeros((len(alone) + len(apart), d))  # which coordinates move in each simulation
    steps[np.arange(len(alone)), alone] = 1
    for k, group in enumerate(apart, len(alone)):
        steps[k, group.coordinates] = 1
    h = np.where(unit > 0.5, -DIFFERENCE, DIFFERENCE)
    moved = unit[:, None, :] + steps * h[:, None, :]
    J = rows(moved.reshape(-1, d), np.repeat(lanes, len(steps))).reshape(n, len(steps), -1)
    J -= base[:, None, :]
    J[:, : len(alone)] /= h[:, alone, None]
    for k, group in enumerate(apart, len(alone)):
        J[:, k] /= h[:, group.coordinates[group.rows.argmax(axis=0)]]
    if (lost := ~np.isfinite(J.sum(axis=2))).any():
        J[lost] = np.where(np.isfinite(J[lost]), J[lost], 0.0)
    return J


def central_differences(rows: Rows, unit: np.ndarray, lanes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows (n, R) at `unit` (n, D) and their derivatives (n, D, R) from both sides: one batch of n (2 D + 1).

    Next to a wall, or where one side cannot be simulated, the difference is one-sided.
    """
    n, d = unit.shape
    up = np.minimum(unit + CENTRAL, 1.0) - unit
    down = unit - np.maximum(unit - CENTRAL, 0.0)
    steps = np.concatenate([np.zeros((n, 1, d)), np.eye(d) * up[:, None], np.eye(d) * -down[:, None]], axis=1)
    batch = rows((unit[:, None] + steps).reshape(-1, d), np.repeat(lanes, 2 * d + 1)).reshape(n, 2 * d + 1, -1)
    base, above, below = batch[:, 0], batch[:, 1 : d + 1], batch[:, d + 1 :]
    lost_up, lost_down = np.isnan(above).any(axis=2), np.isnan(below).any(axis=2)
    for side, lost in (above, lost_up), (below, lost_down):
        side[lost] = base[np.nonzero(lost)[0]]
    span = np.where(lost_up, 0.0, up) + np.where(lost_down, 0.0, down)
    return base, (above - below) / np.where(span > 0, span, 1.0)[..., None]


def normal(
    rows: Rows,
    unit: np.ndarray,
    base: np.ndarray,
    lanes: np.ndarray,
    apart: Sequence[SeparableColumns] = (),
    *,
    central: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Gradient (n, D) and Gauss-Newton matrix (n, D, D) of half the sum of squares; `base` (n, R) are the rows there.

    Lanes are taken in groups, so that their differences stay in memory however long the records are.
    """
    n, d = unit.shape
    gradient, H = np.empty((n, d)), np.empty((n, d, d))
    apart = () if central else apart
    together = max(1, MOST_NUMBERS // ((len(_alone(d, apart)) + len(apart)) * base.shape[1]))
    for first in range(0, n, together):
        part = slice(first, first + together)
        if central:
            _, J = central_differences(rows, unit[part], lanes[part])
        else:
            J = forward_differences(rows, unit[part], base[part], lanes[part], apart)
        gradient[part], H[part] = _products(J, base[part], d, apart)
    return gradient, H


def _products(
    J: np.ndarray, base: np.ndarray, size: int, apart: Sequence[SeparableColumns]
) -> tuple[np.ndarray, np.ndarray]:
    """Gradient (n, D) and matrix (n, D, D) of derivatives (n, k, R) as `forward_differences` has them.

    Coordinates of a group have nothing in common with each other, so that their columns are never written out.
    """
    gradient, H, alone = np.zeros((len(J), size)), np.zeros((len(J), size, size)), _alone(size, apart)
    own = J[:, : len(alone)]
    gradient[:, alone] = (own @ base[:, :, None])[:, :, 0]
    H[:, alone[:, None], alone] = own @ np.swapaxes(own, 1, 2)
    for e, rows in enumerate(apart[0].rows if apart else ()):
        theirs = np.array([group.coordinates[e] for group in apart])
        both = np.concatenate([alone, theirs])
        columns = J[:, :, rows]
        acting = columns[:, len(alone) :]
        gradient[:, theirs] = (acting @ base[:, rows, None])[:, :, 0]
        block = acting @ np.swapaxes(columns, 1, 2)
        H[:, theirs[:, None], both] = block
        H[:, both[:, None], theirs] = np.swapaxes(block, 1, 2)
    return gradient, H


def descend(
    rows: Rows,
    start: np.ndarray,
    frozen: np.ndarray | None = None,
    iterations: int = 40,
    tolerance: float = 1e-4,
    apart: Sequence[SeparableColumns] = (),
    *,
    central: bool = False,
    ended: Callable[[], None] = lambda: None,
) -> Descent:
    """Levenberg-Marquardt in the unit cube from `start` (n, D); columns where `frozen` (n, D) is True do not move.

    A lane ends when a step lowers its deviance by less than `tolerance` (absolute: rows are whitened, so that
    1 is one squared standard deviation) or when no damping helps. A coordinate on a wall that would leave the
    box rests for that step. Source: Marquardt 1963, with several dampings per step.

    Forward differences are enough for an estimate, whose standard errors are far wider than what they truncate. The
    minimum itself, to more than four digits, takes `central` ones. `ended` is called at the end of each lane that comes
    to one.

    Not `least_squares.least_squares_from`: that is SciPy's, from one start, counted and stopped by the search loop.
    """
    unit = np.clip(start, 0.0, 1.0)
    n = len(unit)
    frozen = np.zeros(unit.shape, dtype=bool) if frozen is None else frozen
    every = np.arange(n)
    base = rows(unit, every)
    deviance = _squares(base)
    damping, active, spent = np.full(n, 1e-3), np.isfinite(deviance), n
    for _ in range(iterations):
        lanes = every[active]
        if not len(lanes):
            break
        x = unit[lanes]
        gradient, H = normal(rows, x, base[lanes], lanes, apart, central=central)
        rest = frozen[lanes] | ((x <= 0) & (gradient > 0)) | ((x >= 1) & (gradient < 0))
        tried = damping[lanes, None] * DAMPINGS
        trials = np.clip(x[:, None, :] + _steps(H, gradient, rest, tried), 0.0, 1.0)
        width = trials.shape[1]
        candidates = rows(trials.reshape(-1, x.shape[1]), np.repeat(lanes, width)).reshape(len(lanes), width, -1)
        spent += (len(lanes) + 2 * x.size if central else x.size) + trials.shape[0] * width
        outcome = _squares(candidates)
        best = outcome.argmin(axis=1)
        pick = np.arange(len(lanes))
        gain = deviance[lanes] - outcome[pick, best]
        better = gain > 0
        won = lanes[better]
        unit[won], base[won] = trials[pick, best][better], candidates[pick, best][better]
        deviance[won] = outcome[pick, best][better]
        damping[lanes] = np.clip(np.where(better, tried[pick, best], tried[:, -1] * 10), LEAST_DAMPING, MOST_DAMPING)
        hopeless = ~better & (damping[lanes] >= MOST_DAMPING)
        done = (better & (gain < tolerance)) | hopeless | (~better & _flat(H, gradient, rest, tolerance))
        active[lanes] = ~done
        for _ in lanes[done]:
            ended()
    return Descent(unit, deviance, spent)


def _steps(H: np.ndarray, gradient: np.ndarray, rest: np.ndarray, damping: np.ndarray) -> np.ndarray:
    """Damped Newton steps (n, k, D) for k dampings; resting coordinates stay."""
    free = ~rest
    H = H * (free[:, :, None] & free[:, None, :])
    diagonal = np.einsum("ndd->nd", H)
    floor = np.maximum(1e-12 * diagonal.max(axis=1, keepdims=True), 1e-30)
    scale = np.where(free, np.maximum(diagonal, floor), 1.0)
    eye = np.eye(H.shape[1])
    damped = H[:, None] + eye * (damping[:, :, None, None] * scale[:, None, None, :])
    damped += eye * (rest[:, None, None, :] + 1e-14 * scale[:, None, None, :])
    side = np.broadcast_to((-gradient * free)[:, None, :, None], (*damping.shape, H.shape[1], 1))
    return np.clip(np.linalg.solve(damped, side)[..., 0], -LARGEST_STEP, LARGEST_STEP)


def _flat(H: np.ndarray, gradient: np.ndarray, rest: np.ndarray, tolerance: float) -> np.ndarray:
    """Whether even the undamped step promises less than `tolerance`, (n,)."""
    step = _steps(H, gradient, rest, np.full((len(H), 1), 1e-9))[:, 0]
    return -np.einsum("nd,nd->n", gradient, step) < tolerance


def _squares(rows: np.ndarray) -> np.ndarray:
    """Sums of squares over the last axis, inf where any is nan."""
    total = np.einsum("...r,...r->...", rows, rows)
    return np.where(np.isfinite(total), total, np.inf)
