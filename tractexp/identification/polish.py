"""Bounded least squares from good starts: the end of a polished search and the body of a
multi-start one.

A step costs d + 1 simulations: one trial, and a Jacobian whose d forward differences are one batch.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from tractexp.identification.optimizer import REFUSED, Box, Evaluate
from tractexp.parameter import best_distinct

# of the box's width; rounding (3e-13 relative) and curvature both stay below 1e-6 of a column
UNIT_DIFFERENCE = 1e-6
BOX_MARGIN = 1e-9  # SciPy's interior method starts strictly inside the box
ELITE = 30  # starts of a polish: the valley sought may rank twentieth where the motor stalls
# between starts, in the coordinate that differs most: a search that has settled in one valley must
# not fill the elite with points of it
LEAST_START_DISTANCE = 0.3

# relative tolerance and trials of a descent that has yet to prove itself
ROUGH, ROUGH_TRIALS = 1e-2, 12


class Elite:
    """The best points of a search that lie apart from each other, best first: where a polish
    starts.

    Attributes
    ----------
    box : Box
        Bounds (d,) of the points.
    x : (n, d)
        The points, at most `ELITE` of them.
    f : (n,)
        Their objectives.
    """

    def __init__(self, box: Box):
        """Keep none yet of the points of a box."""
        self.box = box
        self.x = np.empty((0, box.dimension))
        self.f = np.empty(0)

    def add(self, x: np.ndarray, f: np.ndarray) -> None:
        """Consider further points; those refused or worse than a full elite are passed over.

        Parameters
        ----------
        x : (n, d)
            Points of the box.
        f : (n,)
            Their objectives.
        """
        better = f < (self.f[-1] if len(self.f) == ELITE else REFUSED)
        if better.any():
            x = np.concatenate((self.x, x[better]))
            f = np.concatenate((self.f, f[better]))
            chosen = best_distinct(self.box.to_unit(x), f, LEAST_START_DISTANCE, ELITE)
            self.x = x[chosen]
            self.f = f[chosen]


class _Residuals:
    """Scaled residuals and their Jacobian at points of the unit cube, as SciPy asks for them."""

    def __init__(self, evaluate: Evaluate, box: Box, scale: float):
        """Residuals of `evaluate` at points of the unit cube, times `scale`, of which the last are
        kept.
        """
        self.evaluate, self.box, self.scale = evaluate, box, scale
        self.unit = np.empty(0)
        self.value = np.empty(0)

    def _rows(self, unit: np.ndarray) -> np.ndarray:
        """Residuals (n, m) at points (n, d) of the unit cube, scaled."""
        return self.evaluate.residuals(self.box.from_unit(unit))[1] * self.scale

    def __call__(self, unit: np.ndarray) -> np.ndarray:
        """Residuals (m,) at a point (d,) of the unit cube, scaled."""
        # asked again, as for the Jacobian: no second simulation
        if not np.array_equal(unit, self.unit):
            self.unit = unit.copy()
            self.value = self._rows(unit[None])[0]
        return self.value

    def jacobian(self, unit: np.ndarray) -> np.ndarray:
        """The Jacobian (m, d) at a point (d,), by differences away from the nearer bound.

        A difference that cannot be simulated steps the other way, and is zero where that fails as
        well: the parameter then rests for one step.
        """
        h = np.where(unit > 0.5, -UNIT_DIFFERENCE, UNIT_DIFFERENCE)
        rows = self._rows(unit + np.diag(h))
        lost = np.isnan(rows).any(axis=1)
        if lost.any():
            h[lost] *= -1
            rows[lost] = self._rows((unit + np.diag(h))[lost])
        return np.nan_to_num((rows - self(unit)) / h[:, None], nan=0.0).T


def descend_least_squares(
    evaluate: Evaluate,
    box: Box,
    start: np.ndarray,
    objective: float,
    tolerance: float = 1e-8,
    trials: int = 100,
) -> tuple[np.ndarray, float]:
    """Bounded least squares from one start, by SciPy's trust region reflective.

    It works in the unit cube and on residuals scaled to a sum of squares of one, so that the
    tolerance is relative. Not `inference.least_squares.descend`: here each simulation is counted
    and the search loop may stop it anywhere, and the method is a library's; there hundreds of lanes
    share each simulation call.

    Parameters
    ----------
    evaluate : Evaluate
        The batch objective and its residuals.
    box : Box
        Bounds (d,).
    start : (d,)
        Where it begins.
    objective : float
        The objective there.
    tolerance : float
        It ends where the relative change of objective or step, or the gradient, is below this.
    trials : int
        It ends after so many at the latest.

    Returns
    -------
    (d,) array
        The point it ended at: the start, where that cannot be simulated.
    float
        Its objective.
    """
    from scipy.optimize import least_squares  # its annotations know `jac` as a string only

    residuals = _Residuals(evaluate, box, 1 / np.sqrt(objective) if objective > 0 else 1.0)
    unit = np.clip(box.to_unit(start), BOX_MARGIN, 1 - BOX_MARGIN)
    if not np.isfinite(residuals(unit)).all():
        return start, objective
    result = least_squares(
        residuals,
        unit,
        residuals.jacobian,  # pyright: ignore[reportArgumentType]
        (0.0, 1.0),
        ftol=tolerance,
        xtol=tolerance,
        gtol=tolerance,
        max_nfev=trials,
    )
    return box.from_unit(result.x), float(2 * result.cost / residuals.scale**2)


def race(
    evaluate: Evaluate,
    box: Box,
    starts: Iterable[tuple[np.ndarray, float]],
    tolerance: float = 1e-8,
    trials: int = 100,
) -> Iterator[None]:
    """Descend briefly from each start, and to the end from each that comes out lowest so far.

    At the right minimum a descent is soon below the bottoms of the wrong ones, which take most of
    the simulations where every descent is finished. What was left is finished at last, lowest
    first.

    Parameters
    ----------
    evaluate : Evaluate
        The batch objective and its residuals.
    box : Box
        Bounds (d,).
    starts : iterable of (point (d,), objective)
        In the order in which they are tried.
    tolerance, trials : float, int
        Of a descent to the end, as of `descend_least_squares`.

    Yields
    ------
    None
        After each descent.
    """
    left = []
    best = np.inf
    for start, objective in starts:
        x, f = descend_least_squares(evaluate, box, start, objective, ROUGH, ROUGH_TRIALS)
        if f < best:
            best = descend_least_squares(evaluate, box, x, f, tolerance, trials)[1]
        else:
            left.append((x, f))
        yield
    for x, f in sorted(left, key=lambda end: end[1]):
        descend_least_squares(evaluate, box, x, f, tolerance, trials)
        yield


def polish(evaluate: Evaluate, elite: Elite) -> Iterator[None]:
    """Race from the elite points, best first."""
    yield from race(evaluate, elite.box, list(zip(elite.x, elite.f, strict=True)))
