"""Differences of rows and residuals: what each coordinate changes by a small step, one-sided or
from both sides.
"""

from collections.abc import Callable, Sequence

import numpy as np

from tractexp.inference.separable import NOT_SEPARABLE, SeparableColumns

# (n, D) unit values and (n,) their lanes -> rows (n, R) whose squares are summed; nan rows cannot
# be simulated
Rows = Callable[[np.ndarray, np.ndarray], np.ndarray]

RANGE_DIFFERENCE = 1e-6  # of a parameter's range
# of it, where both sides are taken: truncation and rounding both stay below 1e-7 of a column
CENTRAL = 1e-5
COORDINATE_STEP = 1e-4  # of a coordinate's range, for the residuals at a fit


def compute_forward_differences(
    rows: Rows,
    unit: np.ndarray,
    base: np.ndarray,
    lanes: np.ndarray,
    apart: SeparableColumns = NOT_SEPARABLE,
) -> np.ndarray:
    """Derivatives of rows from one side, away from the nearer bound.

    Parameters
    ----------
    rows : (n, D), (n,) -> (n, R)
        The function, of coordinates and lanes.
    unit : (n, D)
        Coordinates of n lanes in the unit cube.
    base : (n, R)
        The rows there.
    lanes : (n,) ints
        Which lanes these are.
    apart : SeparableColumns
        Coordinates that act on the rows of one event each, m an event.

    Returns
    -------
    (n, k + m, R) array
        Per range of each coordinate: first of the k that act on all rows, then of the m of each
        row's own event. A derivative that cannot be simulated is zero.

    Examples
    --------
    >>> point = np.array([[0.2, 0.7]])
    >>> lane = np.zeros(1, dtype=int)
    >>> J = compute_forward_differences(lambda x, lanes: 3 * x, point, 3 * point, lane)
    >>> J.round(6).tolist()
    [[[3.0, 0.0], [-0.0, 3.0]]]
    """
    n, d = unit.shape
    shared = apart.find_shared_columns(d)
    steps = apart.moves(d)
    h = np.where(unit > 0.5, -RANGE_DIFFERENCE, RANGE_DIFFERENCE)
    moved = unit[:, None, :] + steps * h[:, None, :]
    J = rows(moved.reshape(-1, d), np.repeat(lanes, len(steps))).reshape(n, len(steps), -1)
    J -= base[:, None, :]
    J[:, : len(shared)] /= h[:, shared, None]
    for mine, coordinates in zip(apart.rows, apart.coordinates, strict=True):
        J[:, len(shared) :, mine] /= h[:, coordinates, None]
    if (lost := ~np.isfinite(J.sum(axis=2))).any():
        J[lost] = np.where(np.isfinite(J[lost]), J[lost], 0.0)
    return J


def compute_central_differences(
    rows: Rows, unit: np.ndarray, lanes: np.ndarray, apart: SeparableColumns = NOT_SEPARABLE
) -> tuple[np.ndarray, np.ndarray]:
    """Rows, and their derivatives from both sides.

    One batch of n (2 (k + m) + 1) simulations. Next to a bound, or where one side cannot be
    simulated, the difference is one-sided.

    Parameters
    ----------
    rows : (n, D), (n,) -> (n, R)
        The function, of coordinates and lanes.
    unit : (n, D)
        Coordinates of n lanes in the unit cube.
    lanes : (n,) ints
        Which lanes these are.
    apart : SeparableColumns
        Coordinates that act on the rows of one event each, m an event.

    Returns
    -------
    (n, R) array
        The rows at `unit`.
    (n, k + m, R) array
        Derivatives per range, in the order of `compute_forward_differences`.

    Examples
    --------
    >>> at = np.array([[0.5]]), np.zeros(1, dtype=int)
    >>> base, slope = compute_central_differences(lambda x, lanes: x**2, *at)
    >>> base.tolist(), slope.round(9).tolist()
    ([[0.25]], [[[1.0]]])
    """
    n, d = unit.shape
    up = np.minimum(unit + CENTRAL, 1.0) - unit
    down = unit - np.maximum(unit - CENTRAL, 0.0)
    shared = apart.find_shared_columns(d)
    moves = apart.moves(d)
    steps = np.concatenate(
        [np.zeros((n, 1, d)), moves * up[:, None], moves * -down[:, None]], axis=1
    )
    batch = rows((unit[:, None] + steps).reshape(-1, d), np.repeat(lanes, steps.shape[1])).reshape(
        *steps.shape[:2], -1
    )
    base, above, below = batch[:, 0], batch[:, 1 : len(moves) + 1], batch[:, len(moves) + 1 :]
    J = np.zeros_like(above)
    k = len(shared)
    J[:, :k] = _difference_both_sides(
        base, above[:, :k], below[:, :k], up[:, shared], down[:, shared]
    )
    for mine, own in zip(apart.rows, apart.coordinates, strict=True):
        J[:, k:, mine] = _difference_both_sides(
            base[:, mine], above[:, k:, mine], below[:, k:, mine], up[:, own], down[:, own]
        )
    return base, J


def _difference_both_sides(
    base: np.ndarray, above: np.ndarray, below: np.ndarray, up: np.ndarray, down: np.ndarray
) -> np.ndarray:
    """Derivatives (n, k, R) from rows (n, R) and those (n, k, R) one step `up` and `down` (n, k)
    from there.
    """
    lost_up = np.isnan(above).any(axis=2)
    lost_down = np.isnan(below).any(axis=2)
    for side, lost in (above, lost_up), (below, lost_down):
        side[lost] = base[np.nonzero(lost)[0]]
    span = np.where(lost_up, 0.0, up) + np.where(lost_down, 0.0, down)
    return (above - below) / np.where(span > 0, span, 1.0)[..., None]


def replace_diverged(changes: np.ndarray) -> np.ndarray:
    """Changes of a residual, 0 where a simulation diverges: that tells nothing of small changes.

    Examples
    --------
    >>> replace_diverged(np.array([1.0, np.nan, np.inf])).tolist()
    [1.0, 0.0, 0.0]
    """
    return np.nan_to_num(changes, posinf=0.0, neginf=0.0)


def step_both_ways(
    unit: np.ndarray, columns: Sequence[int] | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Points a small step above and below a fit, for difference quotients.

    Parameters
    ----------
    unit : (D,)
        Coordinates of the fit in the unit cube.
    columns : (k,) ints
        Which coordinates are moved, one at a time.

    Returns
    -------
    (2 k, D) array
        The points above, then those below; none leaves the cube.
    (k,) array
        How far the two of each column are apart.

    Examples
    --------
    >>> points, width = step_both_ways(np.array([0.5, 1.0]), [0, 1])
    >>> width.round(6).tolist()
    [0.0002, 0.0001]
    """
    points = np.tile(unit, (2, len(columns), 1))
    at = (np.arange(len(columns)), np.asarray(columns, dtype=int))
    points[0][at] = np.minimum(unit[at[1]] + COORDINATE_STEP, 1.0)
    points[1][at] = np.maximum(unit[at[1]] - COORDINATE_STEP, 0.0)
    return points.reshape(-1, len(unit)), points[0][at] - points[1][at]


def divide_differences(rows: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Difference quotients of what was computed at the points of `step_both_ways`.

    Parameters
    ----------
    rows : (2 k, ...)
        Values at those points.
    width : (k,)
        How far the two points of each column are apart.

    Returns
    -------
    (k, ...) array
        0 where the values diverge.

    Examples
    --------
    >>> divide_differences(np.array([3.0, 1.0]), np.array([0.5])).tolist()
    [4.0]
    """
    k = len(width)
    with np.errstate(over="ignore", invalid="ignore"):
        quotients = (rows[:k] - rows[k:]) / width.reshape(k, *[1] * (rows.ndim - 1))
    return replace_diverged(quotients)
