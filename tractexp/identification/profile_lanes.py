"""Lanes of profiles: each follows the best fit as one parameter moves away from where it begins,
all others free.

All lanes advance in lockstep, two (down and up) for each place, so that one simulation call carries
a step of every one of them. A lane ends where the deviance has risen too far.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from tractexp.identification.uncertainty import Uncertainty, compute_threshold
from tractexp.inference.least_squares import Descent

BEYOND = 1.6  # of the threshold: a lane ends when its deviance has risen so far
OVERSHOOT = 3.0  # of the threshold: a step that rises so far at once is taken back
LANE_STEP = 0.5  # standard errors between the first points of a lane
SMALLEST_STEP, LARGEST_STEP = 1e-5, 0.08  # of the range
AIM = 0.8  # rise of the root of the deviance that a step aims at
LEAST_OPTIMUM_GAIN = 0.05  # fall of the deviance that makes a point a better optimum
RISE = 0.5  # of the deviance between two minima, for them to count as two


class End(StrEnum):
    """Why a side of a profile ends."""

    CLOSED = "closed"  # it crosses the threshold
    BOUND = "bound"  # it reaches the bound below the threshold: open on that side
    POINTS = "points"  # it ran out of points below the threshold


@dataclass(frozen=True, eq=False)
class LikelihoodProfile:
    """One parameter: `deviance` (n,) above the optimum's at `values` (n,), in increasing order of
    value.
    """

    name: str
    values: np.ndarray
    deviance: np.ndarray
    interval: tuple[float, float]
    ends: tuple[End, End]
    minima: tuple[float, ...]  # values of further minima below the threshold

    @property
    def verdict(self) -> str:
        """What the profile adds to the verdict, or ""."""
        sentences = []
        for end, side in zip(self.ends, ("downwards", "upwards"), strict=True):
            if end is not End.CLOSED:
                sentences.append(f"open {side}")
        if self.minima:
            sentences.append(f"two minima, another at {', '.join(f'{m:.4g}' for m in self.minima)}")
        return ", ".join(sentences)


def find_outermost(
    unit: np.ndarray, rise: np.ndarray, c: int, interval: tuple[float, float]
) -> list[int]:
    """The points that fit and lie farthest beyond an interval.

    Parameters
    ----------
    unit : (n, D)
        Coordinates of points that lanes passed.
    rise : (n, d)
        By how much the deviance is up there, over the limit of each parameter's interval: below 1
        the point fits.
    c : int
        The parameter.
    interval : (low, high)
        In its range.

    Returns
    -------
    list of ints
        At most two: the farthest below and the farthest above.
    """
    low, high = interval
    values = np.where(rise[:, c] < 1.0, unit[:, c], low)
    if not len(values):
        return []
    down = int(values.argmin())
    up = int(values.argmax())
    return ([down] if values[down] < low - SMALLEST_STEP else []) + (
        [up] if values[up] > high + SMALLEST_STEP else []
    )


class Lanes:
    """The state of all lanes: lane 2 k goes down, lane 2 k + 1 up from the k-th place, in its
    parameter.
    """

    def __init__(
        self,
        uncertainty: Uncertainty,
        column: np.ndarray,
        unit: np.ndarray,
        rise: np.ndarray,
        simulations: int = 0,
    ):
        """From coordinates `unit` (k, D), where the deviance is up by `rise` (k,) and so many
        `simulations` led to.
        """
        self.uncertainty, self.limit, self.simulations = (
            uncertainty,
            compute_threshold(),
            simulations,
        )
        self.origin = unit
        self.risen = rise
        self.column = np.repeat(column, 2)
        self.unit = np.repeat(unit, 2, axis=0)
        self.sign = np.tile([-1.0, 1.0], len(column))
        self.scale = self.limit / uncertainty.limits[self.column]
        self.slope = np.zeros_like(self.unit)  # how the others move with the profiled one
        errors = uncertainty.information.standard_errors / (uncertainty.upper - uncertainty.lower)
        self.step = np.clip(LANE_STEP * errors, SMALLEST_STEP, LARGEST_STEP)[self.column]
        self.rise = np.repeat(rise, 2)
        self.open = np.ones(len(self.column), dtype=bool)
        self.path: list[list[tuple[float, float]]] = [[] for _ in self.column]
        # coordinates (n, D), deviances above the optimum's (n,)
        self.trail: list[tuple[np.ndarray, np.ndarray]] = []
        self.better: np.ndarray | None = None

    @property
    def points(self) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (n, D) of every point of the lanes, and by how much the deviance is up there,
        over the limit of each parameter's interval (n, d).
        """
        limits = self.uncertainty.limits
        size = len(self.uncertainty.unit)
        unit = np.concatenate([np.empty((0, size)), *(unit for unit, _ in self.trail)])
        rise = np.concatenate([np.empty(0), *(rise for _, rise in self.trail)])
        return unit, rise[:, None] / limits

    def run(self, points: int, ended: Callable[[], None]) -> None:
        """At most so many points on every lane, until one is better than the optimum."""
        for _ in range(points):
            if not self.open.any():
                break
            self.advance()
            if self.better is not None:
                break
            ended()

    def advance(self) -> None:
        """One more point on every open lane."""
        lanes = np.flatnonzero(self.open)
        column = self.column[lanes]
        sign = self.sign[lanes]
        here = self.unit[lanes, column]
        target = np.clip(here + sign * self.step[lanes], 0.0, 1.0)
        start = np.clip(self.unit[lanes] + self.slope[lanes] * (target - here)[:, None], 0.0, 1.0)
        start[np.arange(len(lanes)), column] = target
        descent = descend_others(self.uncertainty, start, column, tolerance=0.01)
        self.simulations += descent.simulations
        rise = (descent.deviance - self.uncertainty.deviance) * self.scale[lanes]
        moved = target - here
        # or cannot be simulated
        over = ~(rise <= OVERSHOOT * self.limit) & (self.rise[lanes] < self.limit)
        if (over := over & (np.abs(moved) > 2 * SMALLEST_STEP)).any():
            self.step[lanes[over]] = np.abs(moved[over]) / 3
            fine = ~over
            lanes, rise, moved, target = lanes[fine], rise[fine], moved[fine], target[fine]
            descent = replace(descent, unit=descent.unit[fine], deviance=descent.deviance[fine])
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = (descent.unit - self.unit[lanes]) / moved[:, None]
        self.slope[lanes] = np.where(np.isfinite(slope), slope, 0.0)
        self.unit[lanes] = descent.unit
        self._adapt(lanes, rise, moved)
        self.rise[lanes] = rise
        self.trail.append((descent.unit, descent.deviance - self.uncertainty.deviance))
        for lane, value, height in zip(lanes, target, rise, strict=True):
            if np.isfinite(height):
                self.path[lane].append((value, height))
        ended = (rise > BEYOND * self.limit) | (target <= 0) | (target >= 1) | ~np.isfinite(rise)
        self.open[lanes[ended]] = False
        if rise.min(initial=0.0) < -LEAST_OPTIMUM_GAIN:
            self.better = descent.unit[rise.argmin()]

    def _adapt(self, lanes: np.ndarray, rise: np.ndarray, moved: np.ndarray) -> None:
        """Steps that raise the root of the deviance by about `AIM`, at most thrice or a third of
        the last.
        """
        roots = np.sqrt(np.maximum(np.stack((rise, self.rise[lanes])), 0.0))
        gained = np.maximum(roots[0] - roots[1], 1e-3)
        factor = np.clip(np.where(np.isfinite(gained), AIM / gained, 1 / 3), 1 / 3, 3.0)
        self.step[lanes] = np.clip(np.abs(moved) * factor, SMALLEST_STEP, LARGEST_STEP)

    def profile(self, k: int) -> LikelihoodProfile:
        """The profile of the k-th parameter, from its two lanes."""
        j = int(self.column[2 * k])
        optimum = (float(self.origin[k, j]), float(self.risen[k]))
        down, up = (np.array([optimum, *self.path[lane]]) for lane in (2 * k, 2 * k + 1))
        (lowest, below), (highest, above) = self._find_crossing(down), self._find_crossing(up)
        joined = np.concatenate((down[:0:-1], up))
        low = self.uncertainty.lower[j]
        scale = self.uncertainty.upper[j] - low
        return LikelihoodProfile(
            name=self.uncertainty.names[j],
            values=low + scale * joined[:, 0],
            deviance=joined[:, 1],
            interval=(float(low + scale * lowest), float(low + scale * highest)),
            ends=(below, above),
            minima=tuple(float(low + scale * m) for side in (down, up) for m in self._minima(side)),
        )

    def _find_crossing(self, path: np.ndarray) -> tuple[float, End]:
        """Where the path (n, 2) last rises through the threshold, on the root of the deviance."""
        over = path[:, 1] > self.limit
        if not over[-1]:
            wall = path[-1, 0] in (0.0, 1.0)
            return float(path[-1, 0]), End.BOUND if wall else End.POINTS
        last = int(np.flatnonzero(~over)[-1])
        roots = np.sqrt(np.maximum(path[last : last + 2, 1], 0.0))
        share = (np.sqrt(self.limit) - roots[0]) / (roots[1] - roots[0])
        return float(path[last, 0] + share * (path[last + 1, 0] - path[last, 0])), End.CLOSED

    def _minima(self, path: np.ndarray) -> list[float]:
        """Places of local minima below the threshold, beyond a rise that is no ripple."""
        heights = path[:, 1]
        return [
            float(path[k, 0])
            for k in range(1, len(heights) - 1)
            if heights[k] <= min(heights[k - 1], heights[k + 1], self.limit)
            and heights[:k].max() - heights[k] > RISE
        ]


def descend_others(
    uncertainty: Uncertainty, start: np.ndarray, columns: np.ndarray, tolerance: float
) -> Descent:
    """Descents from coordinates (n, D), each with one of the `columns` (n,) as it is."""
    frozen = np.arange(start.shape[1]) == columns[:, None]
    return uncertainty.likelihood.descent(start, frozen, tolerance=tolerance)
