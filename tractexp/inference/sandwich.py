r"""How far an estimate by least squares scatters where what it leaves is no noise.

With the sensitivities J and the residual r in blocks b, the estimate without block b is, to first
order,

    theta_(-b) - theta = (J'J - J_b'J_b)^-1 J_b' r_b

and the covariance is (G - 1)/G times the sum of their outer products over the G blocks: the
sandwich (J'J)^-1 (sum_b J_b' r_b r_b' J_b) (J'J)^-1 of White (1982) for residuals that are
correlated within blocks, with each residual given back what the fit took of it. P0 and Q0 are means
before the dip; leaving out a block of that moves them, and the estimate with them. In no direction
is the variance less than that of independent residuals.

Source: White 1982; Bell and McCaffrey 2002 (CR3); MacKinnon, Nielsen and Webb 2023. It holds the
scatter and not the bias: what a missing effect moves a parameter by is told by rival structures.
"""

from collections.abc import Sequence

import numpy as np

from tractexp.inference.blocks import cut_blocks
from tractexp.inference.bounds import is_off_bounds
from tractexp.inference.differences import compute_central_differences
from tractexp.inference.information import STRUCTURAL, Information
from tractexp.inference.interval import compute_interval_factor
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.separable import Sensitivities

# of the largest singular value of a covariance's root: what the records do not see is 0 there
SINGULAR_ROUNDING = 1e-13


def estimate_scatter(
    likelihood: Likelihood, unit: np.ndarray
) -> tuple[Information, float, np.ndarray, float]:
    """How far a fit by Eq. (8) scatters.

    Parameters inside their bounds are told with those on a bound held there; one on a bound as if
    all were free, beyond the bounds, too.

    Parameters
    ----------
    likelihood : Likelihood
        That of Eq. (8), its rows in units of what the fit leaves.
    unit : (d,)
        Coordinates of the fit.

    Returns
    -------
    Information
        Whose covariance is that of the scatter.
    float
        Student's t at 97.5 %.
    (d,) array
        Each standard error over that of independent residuals.
    float
        The geometric mean of that over all directions.
    """
    problem = likelihood.problem
    whole = likelihood.of_records.with_initial_power
    rows, J = whole.jacobian(whole.place_parameters(unit[None])[0])
    free = likelihood.free
    drive = problem.drive
    blocks = cut_blocks(problem.events, drive, free)
    held_by = _differentiate_prior(likelihood, unit)
    rows = rows.reshape(drive.channels, -1)
    power = _find_power_changes(whole, blocks)

    def influences(columns: np.ndarray) -> np.ndarray:
        return _compute_influences(J, rows, columns, blocks, power, held_by, likelihood.prior)

    shared = np.concatenate([J.shared_columns, held_by])
    every = np.arange(free)
    inside = every[is_off_bounds(unit[:free])]
    root = np.zeros((free, free))
    ratio = np.ones(free)
    own, ratio[inside], spread = compute_robust_root(shared[:, inside], influences(inside))
    root[np.ix_(every[: len(own)], inside)] = own
    if len(inside) < free:
        held = np.setdiff1d(every, inside)
        rows = rows - (
            J.shared_columns @ np.linalg.lstsq(J.shared_columns, rows.ravel())[0]
        ).reshape(rows.shape)
        full, wider, _ = compute_robust_root(shared, influences(every))
        ratio[held] = wider[held]
        errors = np.sqrt(np.maximum(np.diag(np.linalg.pinv(full.T @ full))[held], 0.0))
        seen = errors > 0  # what changes nothing has no error, and stays out of what is known
        root[len(own) + np.flatnonzero(seen), held[seen]] = 1 / errors[seen]
    information = Information(
        problem.space.names,
        likelihood.values(unit),
        problem.upper - problem.lower,
        root,
        SINGULAR_ROUNDING,
    )
    return information, compute_interval_factor(len(blocks) - 1), ratio, spread


def _differentiate_prior(likelihood: Likelihood, unit: np.ndarray) -> np.ndarray:
    """Derivatives (k, d) of the rows of a prior, per range of each parameter."""
    _, J = compute_central_differences(
        lambda at, _: likelihood.prior_rows(at), unit[None], np.zeros(1, dtype=int)
    )
    return J[0].T


def _find_power_changes(
    likelihood: Likelihood, blocks: Sequence[slice]
) -> list[tuple[int, np.ndarray]]:
    """The event of each block, and the change (2,) of its P0 and Q0 in ranges when the block is
    left out of their means.
    """
    drive = likelihood.problem.drive
    changes = list[tuple[int, np.ndarray]]()
    width = likelihood.free_set.box.width[likelihood.free :].reshape(drive.events, 2)
    means = likelihood.problem.steady or [slice(0, 0)] * drive.events  # of waves there are none
    for block in blocks:
        e = int(np.searchsorted(drive.first, block.start, "right")) - 1
        steady = means[e]
        change = np.zeros(2)
        a, z, n = (
            max(block.start, steady.start),
            min(block.stop, steady.stop),
            steady.stop - steady.start,
        )
        if 0 < z - a < n:
            off = np.nanmean(drive.measurements[:, a:z], axis=1) - drive.before[e]
            change = -np.nan_to_num(off) * (z - a) / (n - (z - a))
        changes.append((e, change / width[e]))
    return changes


def _compute_influences(
    J: Sensitivities,
    rows: np.ndarray,
    columns: np.ndarray,
    blocks: Sequence[slice],
    power: Sequence[tuple[int, np.ndarray]],
    held_by: np.ndarray,
    weight: float,
) -> np.ndarray:
    """The change (G + k, columns) of the estimate when each block of J and rows (C, N) is left out.

    `held_by` (k, d) are derivatives of the rows of a prior, of this weight. They are never left
    out; each moves the estimate by what one standard deviation of it does.
    """
    flat = J.shared_columns[:, columns]
    prior = held_by[:, columns]
    cross = [flat[mine].T @ J.own(e) for e, mine in enumerate(J.rows)]
    total = flat.T @ flat + prior.T @ prior
    shifts = [cross[e] @ change for e, change in power]
    moves = compute_moves_without_blocks(flat.reshape(*rows.shape, -1), rows, blocks, total, shifts)
    return np.concatenate([moves, weight * prior @ np.linalg.pinv(total)])


def compute_moves_without_blocks(
    J: np.ndarray,
    rows: np.ndarray,
    blocks: Sequence[slice],
    whole: np.ndarray,
    shifts: Sequence[np.ndarray | float] | None = None,
) -> np.ndarray:
    """The change of an estimate when each block of samples is left out.

    Parameters
    ----------
    J : (C, N, k)
        Sensitivities.
    rows : (C, N)
        Residuals.
    blocks : slices of samples
        G of them.
    whole : (k, k)
        J'J with all that is never left out, such as a prior.
    shifts : (k,) for each block
        What else moves J'r where it is left out; None: nothing.

    Returns
    -------
    (G, k) array

    Notes
    -----
    Source: the jackknife of Bell and McCaffrey 2002, blocks in place of clusters.
    """
    scale = np.sqrt(np.maximum(np.diag(whole), 1e-300))
    moves = []
    for block, shift in zip(blocks, shifts or [0.0] * len(blocks), strict=True):
        a = np.concatenate(J[:, block])
        r = rows[:, block].ravel()
        rest = (whole - a.T @ a) / np.outer(scale, scale)
        moves.append(
            np.linalg.pinv(rest, STRUCTURAL**2, hermitian=True)
            @ ((a.T @ r - shift) / scale)
            / scale
        )
    return np.clip(moves, -1.0, 1.0)  # no estimate leaves its box


def compute_robust_root(J: np.ndarray, moved: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Rows whose inverse products are the covariance of an estimate under a wrong model.

    Along the directions of J, in which independent residuals of unit variance have unit variance,
    less is raised to it.

    Parameters
    ----------
    J : (R, d)
        Whitened sensitivities.
    moved : (G, d)
        By how much the estimate moves without each block.

    Returns
    -------
    (k, d) array
        The rows, of the k directions that J sees.
    (d,) array
        Each standard error over that of independent residuals.
    float
        The geometric mean of that over all directions.

    Notes
    -----
    Source: White 1982.
    """
    size = np.linalg.norm(J, axis=0)
    scale = np.where(size > 0, size, 1.0)
    _, singular, directions = np.linalg.svd(J / scale, full_matrices=False)
    seen = singular > STRUCTURAL * singular.max(initial=0.0)
    along = singular[seen, None] * directions[seen] * scale
    z = moved @ along.T
    values, vectors = np.linalg.eigh((len(moved) - 1) / len(moved) * z.T @ z)
    values = np.maximum(values, 1.0)
    back = np.linalg.pinv(along)
    plain, whole = (
        np.sqrt(((back @ v) ** 2).sum(axis=1)) for v in (vectors, vectors * np.sqrt(values))
    )
    ratio = np.divide(whole, plain, out=np.ones_like(whole), where=plain > 0)
    return (
        (vectors / np.sqrt(values)).T @ along,
        ratio,
        float(np.exp(np.mean(np.log(values)) / 2)) if seen.any() else 1.0,
    )
