"""Damped least squares of many problems at once: every lane takes its step in the same two
simulation calls.

Profiles, starts and subsets of events are lanes. A call with the differences of all lanes and a
call with several dampings of all steps replace hundreds of single simulations, which cost as much
to call as to run.
"""

from dataclasses import dataclass

import numpy as np

from tractexp.inference.differences import (
    Rows,
    compute_central_differences,
    compute_forward_differences,
)
from tractexp.inference.separable import NOT_SEPARABLE, NormalMatrix, SeparableColumns

DAMPINGS = np.array([1e-3, 1e-1, 1e1, 1e3])  # tried together, relative to the lane's own
LEAST_DAMPING, MOST_DAMPING = 1e-9, 1e9
LARGEST_STEP = 0.3  # of a parameter's range
MOST_NUMBERS = 8_000_000  # of all differences held at once


@dataclass(frozen=True, eq=False)
class Descent:
    """Where descents ended, one lane each.

    Attributes
    ----------
    unit : (n, D)
        Coordinates in the unit cube.
    deviance : (n,)
        Sums of squares there; inf of a lane that could not be begun.
    simulations : int
        What they cost.
    """

    unit: np.ndarray
    deviance: np.ndarray
    simulations: int

    @property
    def best(self) -> np.ndarray:
        """Coordinates (D,) of the least deviance."""
        return self.unit[self.deviance.argmin()]

    def join_descent(self, more: "Descent") -> "Descent":
        """These ends and further ones."""
        unit = np.concatenate([self.unit, more.unit])
        deviance = np.concatenate([self.deviance, more.deviance])
        return Descent(unit, deviance, self.simulations + more.simulations)


def build_normal_matrix(
    rows: Rows,
    unit: np.ndarray,
    base: np.ndarray,
    lanes: np.ndarray,
    apart: SeparableColumns = NOT_SEPARABLE,
    *,
    central: bool = False,
) -> tuple[np.ndarray, NormalMatrix]:
    """Gradient and Gauss-Newton matrix of half the sum of squares.

    Lanes are taken in groups, so that their differences stay in memory however long the records
    are.

    Parameters
    ----------
    rows : (n, D), (n,) -> (n, R)
        The function whose squares are summed, of coordinates and lanes.
    unit : (n, D)
        Coordinates of n lanes in the unit cube.
    base : (n, R)
        The rows there.
    lanes : (n,) ints
        Which lanes these are.
    apart : SeparableColumns
        Coordinates that act on one event each.
    central : bool
        Whether differences are central, which costs twice as many simulations.

    Returns
    -------
    (n, D) array
        The gradient.
    NormalMatrix
    """
    n = len(unit)
    parts = []
    together = max(1, MOST_NUMBERS // (len(apart.moves(unit.shape[1])) * base.shape[1]))
    for first in range(0, n, together):
        part = slice(first, first + together)
        if central:
            _, J = compute_central_differences(rows, unit[part], lanes[part], apart)
        else:
            J = compute_forward_differences(rows, unit[part], base[part], lanes[part], apart)
        parts.append(_multiply_derivatives(J, base[part], unit.shape[1], apart))
    gradient, shared, cross, own = (np.concatenate(pieces) for pieces in zip(*parts, strict=True))
    return gradient, NormalMatrix(
        shared, cross, own, apart.find_shared_columns(unit.shape[1]), apart
    )


def _multiply_derivatives(
    J: np.ndarray, base: np.ndarray, size: int, apart: SeparableColumns
) -> tuple[np.ndarray, ...]:
    """Gradient (n, D) and the blocks of a `NormalMatrix`, of derivatives (n, k + m, R) as the
    differences have them.
    """
    shared = apart.find_shared_columns(size)
    m = apart.count
    n, k, events = len(J), len(shared), len(apart.rows)
    gradient = np.zeros((n, size))
    own = J[:, :k]
    gradient[:, shared] = (own @ base[:, :, None])[:, :, 0]
    cross = np.empty((n, events, m, k))
    blocks = np.empty((n, events, m, m))
    for e, mine in enumerate(apart.rows if m else ()):
        columns = J[:, :, mine]
        acting = columns[:, k:]
        gradient[:, apart.coordinates[e]] = (acting @ base[:, mine, None])[:, :, 0]
        products = acting @ np.swapaxes(columns, 1, 2)
        cross[:, e], blocks[:, e] = products[:, :, :k], products[:, :, k:]
    return gradient, own @ np.swapaxes(own, 1, 2), cross, blocks


def descend(
    rows: Rows,
    start: np.ndarray,
    frozen: np.ndarray | None = None,
    iterations: int = 40,
    tolerance: float = 1e-4,
    apart: SeparableColumns = NOT_SEPARABLE,
    *,
    central: bool = False,
) -> Descent:
    """Levenberg-Marquardt in the unit cube, many lanes at once.

    A lane ends when a step lowers its deviance by less than `tolerance`, or when no damping helps.
    A coordinate on a bound that would leave the box rests for that step.

    Forward differences are enough for an estimate, whose standard errors are far wider than what
    they truncate. The minimum itself, to more than four digits, takes `central` ones.

    Not `polish.least_squares_from`: that is SciPy's, from one start, counted and stopped by the
    search loop.

    Parameters
    ----------
    rows : (n, D), (n,) -> (n, R)
        The function whose squares are summed, of coordinates and lanes.
    start : (n, D)
        Where the lanes begin.
    frozen : (n, D) bools
        Coordinates that do not move; None: all do.
    iterations : int
        At most so many.
    tolerance : float
        Absolute: rows are whitened, so that 1 is one squared standard deviation.
    apart : SeparableColumns
        Coordinates that act on one event each.
    central : bool
        Whether differences are central.

    Returns
    -------
    Descent
        Where each lane ended.

    Notes
    -----
    Source: Marquardt 1963, with several dampings per step.

    Examples
    --------
    >>> ends = descend(lambda unit, lanes: 10 * (unit - 0.3), np.array([[0.9], [0.1]]))
    >>> ends.unit.round(4).tolist()
    [[0.3], [0.3]]
    """
    unit = np.clip(start, 0.0, 1.0)
    n = len(unit)
    frozen = np.zeros(unit.shape, dtype=bool) if frozen is None else frozen
    every = np.arange(n)
    base = rows(unit, every)
    deviance = _sum_squares(base)
    damping, active, spent = np.full(n, 1e-3), np.isfinite(deviance), n
    for _ in range(iterations):
        lanes = every[active]
        if not len(lanes):
            break
        x = unit[lanes]
        gradient, H = build_normal_matrix(rows, x, base[lanes], lanes, apart, central=central)
        rest = frozen[lanes] | ((x <= 0) & (gradient > 0)) | ((x >= 1) & (gradient < 0))
        tried = damping[lanes, None] * DAMPINGS
        trials = np.clip(x[:, None, :] + _solve_steps(H, gradient, rest, tried), 0.0, 1.0)
        spent += (len(lanes) + 2 * x.size if central else x.size) + trials.shape[0] * trials.shape[
            1
        ]
        best, outcome, ends = _pick_best_trial(rows, trials, lanes, base.shape[1])
        pick = np.arange(len(lanes))
        gain = deviance[lanes] - outcome
        better = gain > 0
        won = lanes[better]
        unit[won], base[won], deviance[won] = (
            trials[pick, best][better],
            ends[better],
            outcome[better],
        )
        damping[lanes] = np.clip(
            np.where(better, tried[pick, best], tried[:, -1] * 10), LEAST_DAMPING, MOST_DAMPING
        )
        hopeless = ~better & (damping[lanes] >= MOST_DAMPING)
        done = (
            (better & (gain < tolerance))
            | hopeless
            | (~better & _is_flat(H, gradient, rest, tolerance))
        )
        active[lanes] = ~done
    return Descent(unit, deviance, spent)


def _pick_best_trial(
    rows: Rows, trials: np.ndarray, lanes: np.ndarray, size: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which of q trials (n, q, D) of each lane leaves the least, its sum of squares (n,) and its
    rows (n, `size`).
    """
    n, width, d = trials.shape
    best, outcome, ends = np.empty(n, dtype=int), np.empty(n), np.empty((n, size))
    together = max(1, MOST_NUMBERS // (width * size))
    for first in range(0, n, together):
        part = slice(first, first + together)
        candidates = rows(trials[part].reshape(-1, d), np.repeat(lanes[part], width)).reshape(
            -1, width, size
        )
        squares = _sum_squares(candidates)
        best[part], outcome[part] = squares.argmin(axis=1), squares.min(axis=1)
        ends[part] = candidates[np.arange(len(candidates)), best[part]]
    return best, outcome, ends


def _solve_steps(
    H: NormalMatrix, gradient: np.ndarray, rest: np.ndarray, damping: np.ndarray
) -> np.ndarray:
    """Damped Newton steps (n, k, D) for k dampings; resting coordinates stay."""
    free = ~rest
    diagonal = H.diagonal * free
    floor = np.maximum(1e-12 * diagonal.max(axis=1, keepdims=True), 1e-30)
    scale = np.where(free, np.maximum(diagonal, floor), 1.0)
    added = damping[:, :, None] * scale[:, None], (rest + 1e-14 * scale)[:, None]
    return np.clip(H.solve(-gradient * free, free, added), -LARGEST_STEP, LARGEST_STEP)


def _is_flat(
    H: NormalMatrix, gradient: np.ndarray, rest: np.ndarray, tolerance: float
) -> np.ndarray:
    """Whether even the undamped step promises less than `tolerance`, (n,)."""
    step = _solve_steps(H, gradient, rest, np.full((len(gradient), 1), 1e-9))[:, 0]
    return -np.einsum("nd,nd->n", gradient, step) < tolerance


def _sum_squares(rows: np.ndarray) -> np.ndarray:
    """Sums of squares over the last axis, inf where any is nan."""
    total = np.einsum("...r,...r->...", rows, rows)
    return np.where(np.isfinite(total), total, np.inf)
