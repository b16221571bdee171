"""Whether two explanations are one function of the voltage: then no event at this bus tells them
apart.

Two conditions, both numerical, over voltages richer than any record's: at the point where one
follows the other, the changes that the parameters of either make span the same space (the joint
Jacobian has the rank of each); and refitted without noise each follows the other, at its fit and at
half its size, to what the integration leaves.
"""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from tractexp.discrepancy.next_event.imagined import ImaginedDip, drive_imagined
from tractexp.inference.context import Context
from tractexp.inference.differences import divide_differences, step_both_ways
from tractexp.inference.fitting import Refit
from tractexp.inference.least_squares import descend
from tractexp.model.drive import Drive

LARGEST_FOLLOWED_DISTANCE = 1e-6  # pu: how near one comes to the other
# steps of a descent, which ends where one gains less [pu²]: a single sample so far off
MOST_FOLLOWING_STEPS, DONE = 60, LARGEST_FOLLOWED_DISTANCE**2
SETTLED = 0.1  # of the power before: an event that a load has survived by its end
DIRECTION = 1e-4  # of the largest singular value of normalized columns: a direction of its own
RICH = (0.1, 0.3, 0.5, 0.7)  # depths
TURNED = (0.0, 20.0, -30.0)  # degrees


def prove_same(context: Context, one: Refit, other: Refit) -> dict[str, Any] | None:
    """The proof that two explanations are the same function of the voltage, None where they are
    not: the `rank` of their joint Jacobian, how far each is `off` the other where it follows it
    [pu], and the `reason` why no dip tells them apart.
    """
    events = [
        ImaginedDip(*shape)
        for shape in itertools.product(RICH, context.domain.dips.durations[::2], TURNED)
    ]
    drive = Drive.from_events([drive_imagined(context, event) for event in events])
    pairs = []
    for truth, rival in ((one, other), (other, one)):
        for size in (1.0, 0.5):
            pair = _follow_truth(
                context, drive, _scale_effects(context, truth, size), truth.names, rival
            )
            if pair is None:
                return None
            pairs.append(pair)
    rank = max(rank for rank, _ in pairs)
    reason = (
        f"over {len(events)} voltages, dips and phase jumps of many sizes, the changes that the"
        f" parameters of either make span the same {rank} directions, and each follows the other"
        f" within {LARGEST_FOLLOWED_DISTANCE:.0e} pu"
    )
    return {"rank": rank, "off": max(off for _, off in pairs), "reason": reason}


def _scale_effects(context: Context, fit: Refit, share: float) -> np.ndarray:
    """The coordinates (D,) of a fit without faults of the measurement, the size of each effect at a
    share of its way from null: 0 is without the effect, 1 as it was fitted.
    """
    coordinates = context.coordinates
    scaled = coordinates.without_faults(fit.unit, free=())  # a copy
    columns = coordinates.sizes(fit.names)
    null = coordinates.null[columns]
    scaled[columns] = null + share * (scaled[columns] - null)
    return scaled


def _follow_truth(
    context: Context, drive: Drive, point: np.ndarray, names: Sequence[str], rival: Refit
) -> tuple[int, float] | None:
    """Rank and distance where the rival follows the truth at coordinates (D,); None where it does
    not.
    """
    answer = context.kernels.simulate(names, point[None], drive)[0]
    valid = (drive.weights > 0) & _find_recovering_samples(answer, drive)
    truth = answer[valid]
    if not len(truth):
        return None
    columns = _list_load_columns(context, rival.names)
    start = _scale_effects(context, rival, 1.0)

    def simulate_points(points: np.ndarray, whose: Sequence[str]) -> np.ndarray:
        outputs = context.kernels.simulate(whose, points, drive)
        context.effort.spend(len(points))
        return np.nan_to_num(outputs[:, valid])

    def whole(points: np.ndarray) -> np.ndarray:
        units = np.tile(start, (len(points), 1))
        units[:, columns] = points
        return units

    def compute_slopes(unit: np.ndarray, whose: Sequence[str], inside: Sequence[int]) -> np.ndarray:
        points, width = step_both_ways(unit, inside)
        return divide_differences(simulate_points(points, whose), width)

    def come_nearest(point: np.ndarray, rows: np.ndarray) -> np.ndarray:
        miss = lambda points, _: (simulate_points(whole(points), rival.names) - truth)[:, rows]  # noqa: E731
        begin = np.clip(point, 1e-3, 1 - 1e-3)[None]
        return descend(miss, begin, None, MOST_FOLLOWING_STEPS, DONE, central=True).unit[0]

    mild = np.zeros(valid.shape, bool)  # first: near a stall a descent from afar goes astray
    mild[:, : drive.first[drive.events // 2]] = True
    nearest_point = start[columns]
    off = np.inf
    for rows in (mild[valid], np.ones(len(truth), bool)):
        if not rows.any():  # the load stalls in all of them
            continue
        nearest_point = come_nearest(nearest_point, rows)
        missed = simulate_points(whole(nearest_point[None]), rival.names)[0] - truth
        off = float(np.abs(missed[rows]).max())
        if off > LARGEST_FOLLOWED_DISTANCE:
            return None
    own = (
        compute_slopes(point, names, _list_load_columns(context, names)),
        compute_slopes(whole(nearest_point[None])[0], rival.names, columns),
    )
    ranks = [_rank(rows) for rows in (*own, np.concatenate(own))]
    return (ranks[2], off) if len(set(ranks)) == 1 else None


def _find_recovering_samples(answer: np.ndarray, drive: Drive) -> np.ndarray:
    """Which samples (C, N) are of events that the load survives: a motor that stalls amplifies what
    rounding does.
    """
    alive = np.zeros(answer.shape, bool)
    for part in drive.parts:
        own = answer[:, part]
        first = own[:, :20].mean(axis=1)
        last = own[:, -20:].mean(axis=1)
        alive[:, part] = (
            np.isfinite(own).all() and np.abs(last - first).max() < SETTLED * np.abs(first).max()
        )
    return alive


def _list_load_columns(context: Context, names: Sequence[str]) -> list[int]:
    """Columns of the base model's and the effects' parameters."""
    at = context.coordinates
    return [*at.base, *at.parameters(names)]


def _rank(rows: np.ndarray) -> int:
    """How many directions rows (k, R) span, each of size one."""
    size = np.linalg.norm(rows, axis=1)
    large = rows[size > DIRECTION * size.max()]
    values = np.linalg.svd(large / np.linalg.norm(large, axis=1)[:, None], compute_uv=False)
    return int((values > DIRECTION * values[0]).sum())
