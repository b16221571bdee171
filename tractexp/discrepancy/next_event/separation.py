"""How surely one more event tells rivals apart: each in turn the truth, all others refitted, by the
product's own rule.

Every rival is linearised about its fit: r + J d on the events recorded, f + K d on the new one,
whitened. With A the truth the new event shows y = f_A + K_A h + e, with h as uncertain as the
records leave A's parameters and e noise. All rivals are fitted to both, in closed form, and judged
as the product judges them (`Criteria.rejects`). Only the space that all r, J, f and K span matters,
so that thousands of draws cost little.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.discrepancy.next_event.imagined import ImaginedDip, drive_imagined, transfer_noise
from tractexp.inference.context import Context
from tractexp.inference.criteria import Criteria
from tractexp.inference.differences import divide_differences, step_both_ways
from tractexp.inference.fitting import Refit
from tractexp.inference.information import UNIFORM_PRECISION
from tractexp.inference.linearization import find_active_bounds
from tractexp.inference.model_error import weigh_error
from tractexp.model.drive import Drive
from tractexp.noise import Noise

SEPARATION_SEED = 0  # of the draws: the choice of one event is always the same
DRAWS, FEW = 2000, 200  # of the event chosen, and of each that is tried
POWER_DIFFERENCE = 1e-3  # of P0 and Q0, for their differences [pu]
EventView = tuple[np.ndarray, float]  # of one explanation, as of `view_events`


@dataclass(frozen=True, eq=False)
class Side:
    """One explanation on the recorded events, with k parameters of the model and its effects.

    P0 and Q0 of each event are free beside them. Rows of parameters on a bound are 0.

    Attributes
    ----------
    fit : Refit
        Where it is linearized.
    columns : tuple of ints
        The parameters' columns.
    free : (k,) bools
        Which of them are on no bound.
    r, J : (R,), (k, R)
        Whitened residuals and derivatives, faults of the measurement with their priors.
    own, s : (k, m), (m,)
        Priors of the explanation's own.
    box : (k,)
        Precision of each parameter by its range alone.
    """

    fit: Refit
    columns: tuple[int, ...]
    free: np.ndarray  # (k,) which are not on a wall
    r: np.ndarray
    J: np.ndarray
    own: np.ndarray
    s: np.ndarray
    box: np.ndarray  # (k,) precision of each by its range alone

    @property
    def precision(self) -> np.ndarray:
        """Precision (k, k) of the parameters by the recorded events."""
        return self.J @ self.J.T + self.own @ self.own.T + np.diag(self.box)


def linearize_side(context: Context, noise: Noise, fit: Refit) -> Side:
    """Linearise an explanation at its fit."""
    at = context.coordinates
    faults = at.sizes(context.catalogue.of_measurement)
    own = [k for k in at.parameters(fit.names) if k not in faults]
    columns = [*at.base, *faults, *own, *at.before]
    _, rows = context.linearize(fit.unit, noise, columns, fit.names)
    shared = context.drive.measurements.size + len(faults)
    free = ~find_active_bounds(context, fit.unit, columns, rows[1:] @ rows[0])
    J = rows[1:, :shared] * free[:, None]
    box = np.where(np.isin(columns, faults), 0.0, UNIFORM_PRECISION)
    return Side(
        fit, tuple(columns), free, rows[0, :shared], J, rows[1:, shared:], rows[0, shared:], box
    )


def view_events(
    context: Context, noise: Noise, side: Side, events: Sequence[ImaginedDip], error: float = 0.0
) -> list[EventView]:
    """What an explanation predicts of events that are sampled alike, with the faults of the
    measurement at their null. It misses `error` of the response.

    What the recorder did to earlier events says nothing of the load, but it may go on.

    Returns
    -------
    list of (rows, missed)
        Of each event the whitened prediction and its derivatives, those by P0 and Q0 last (k + 3,
        n), nan where the model does not survive it; and by how many times the noise's variance the
        model's error adds to it.
    """
    at = context.coordinates
    names = side.fit.names
    drives = [drive_imagined(context, event) for event in events]
    inside = list(side.columns[: len(side.columns) - len(at.before)])
    middle = at.without_faults(side.fit.unit, ())
    points, width = step_both_ways(middle, inside)
    # (E, n, C, N)
    moved = _simulate_drives(context, names, np.concatenate([middle[None], points]), drives)
    before = [
        _simulate_drives(
            context,
            names,
            middle[None],
            [
                replace(d, **{channel: getattr(d, channel) + sign * POWER_DIFFERENCE})
                for d in drives
            ],
        )
        for channel in ("P0", "Q0")
        for sign in (1, -1)
    ]
    one = Drive.from_events(drives[:1])
    k = len(inside)
    missed = [0.0] * len(events)
    if error:
        still = replace(events[0], depth=0.0, jump=0.0, unbalance=0.0)
        (rest,) = _simulate_drives(context, names, middle[None], [drive_imagined(context, still)])[
            0
        ]
        variance = float(np.mean(np.square(noise.levels)))
        step = drives[0].step
        responses = [float(np.mean((rows[0] - rest) ** 2)) for rows in moved]
        missed = [weigh_error(error, response, variance, step) for response in responses]
    white = transfer_noise(noise, one, events[0].rate, context.events[0].record.step)
    chances = []
    for e in range(len(events)):
        rows = np.concatenate([moved[e], *(b[e] for b in before)])
        rows = white.whiten(np.where(one.weights > 0, rows, 0.0), one, one.weights > 0)
        view = np.zeros((len(side.columns) + 3, rows.shape[1]))
        view[0] = rows[0]
        view[1 : 1 + k] = divide_differences(rows[1 : 1 + 2 * k], width) * side.free[:k, None]
        view[-2:] = (rows[[-4, -2]] - rows[[-3, -1]]) / (2 * POWER_DIFFERENCE)
        chances.append((view, missed[e]))
    return chances


def _simulate_drives(
    context: Context, names: Sequence[str], points: np.ndarray, drives: Sequence
) -> np.ndarray:
    """What is compared (E, n, C, N) of drives of equal length."""
    power = context.kernels.simulate(names, points, Drive.from_events(drives))
    context.effort.spend(len(points))
    return np.moveaxis(power.reshape(len(points), power.shape[1], len(drives), -1), 2, 0)


class Separation:
    """Rivals on the recorded events, reduced to what they span; the first of `sides` is the base
    model.
    """

    def __init__(self, sides: Sequence[Side], criteria: Criteria, draws: int = DRAWS):
        """Reduce what the records say of each rival to a few rows, from which draws are decided."""
        self.sides, self.criteria, self.draws = sides, criteria, draws
        rows = _reduce_blocks([np.vstack([x.r, x.J]) for x in sides])
        self.r = [x[0] for x in rows]
        self.J = [x[1:] for x in rows]
        self.precision = [x.precision for x in sides]

    def find_denied_rivals(
        self, seen: Sequence[EventView], truth: int, times: int = 1
    ) -> np.ndarray:
        """Which rivals (a, b) each of b draws denies by one new event, or `times` its like, with
        `truth` the truth.

        None is denied where a side does not survive, the truth itself always where all do. What the
        models miss is missed again in each of its like: more of them tell more of the noise alone.
        """
        if not all(np.isfinite(rows).all() for rows, _ in seen):
            return np.zeros((len(self.sides) - 1, self.draws), bool)
        weight = np.sqrt(times / (1 + times * max(missed for _, missed in seen)))
        first = seen[0][0][0]
        rows = _reduce_blocks([weight * np.vstack([x[0] - first, x[1:]]) for x, _ in seen])
        f = [x[0] for x in rows]
        K = [x[1:] for x in rows]
        rng = np.random.default_rng([SEPARATION_SEED, truth])
        side = self.sides[truth]
        k = len(side.columns)
        here = side.fit.unit[list(side.columns)]
        h = (
            rng.standard_normal((self.draws, k))
            @ np.linalg.cholesky(np.linalg.inv(self.precision[truth])).T
        )
        h = np.clip(h, -here, 1 - here)
        y = f[truth] + h @ K[truth][:k] + rng.standard_normal((self.draws, len(f[truth])))
        rivals = range(1, len(self.sides))
        cost = np.array(
            [self._deviance(x, f[x] - y, K[x]) + 2 * self.sides[x].fit.parameters for x in rivals]
        )
        return self.criteria.rejects(cost - cost[truth - 1]) | (np.array(rivals) == truth)[:, None]

    def _deviance(self, x: int, off: np.ndarray, K: np.ndarray) -> np.ndarray:
        """Of one side fitted to recorded and new events (b,)."""
        side, r, J = self.sides[x], self.r[x], self.J[x]
        k = len(J)
        whole = np.zeros((k + 2, k + 2))
        whole[:k, :k] = self.precision[x]
        whole[k:, k:] += 1e-9 * np.eye(2)
        whole += K @ K.T
        slope = off @ K.T
        slope[:, :k] += J @ r + side.own @ side.s
        d = -np.linalg.solve(whole, slope.T).T
        old, new, prior = r + d[:, :k] @ J, off + d @ K, side.s + d[:, :k] @ side.own
        return (old**2).sum(axis=1) + (new**2).sum(axis=1) + (prior**2).sum(axis=1)


def _reduce_blocks(blocks: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Blocks of rows (m_i, n) as rows (m_i, m) of the same inner products, m their
    number in all.
    """
    rows = np.concatenate(blocks)
    squares, vectors = np.linalg.eigh(rows @ rows.T)
    return np.split(
        vectors * np.sqrt(np.maximum(squares, 0.0)), np.cumsum([len(b) for b in blocks])[:-1]
    )
