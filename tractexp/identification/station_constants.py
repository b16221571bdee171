"""How sure the constants of a load are that all its dips share, and which of them are none.

How far they scatter is told by leaving out one dip at a time; a constant that differs from dip to
dip beyond chance is told with by how much.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tractexp.identification.station import (
    MOST_FITTED_DIPS,
    SMALLEST_SQUARE,
    LoadSpec,
    SharedFit,
    differentiate,
    find_event,
)
from tractexp.inference.blocks import cut_blocks
from tractexp.inference.information import Information
from tractexp.inference.interval import compute_interval_factor
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.sandwich import (
    SINGULAR_ROUNDING,
    compute_moves_without_blocks,
    compute_robust_root,
)
from tractexp.inference.sized_problem import SizedProblem

CONSTANT_CHANCE = 1e-3  # of a constant that looks as if it differed from dip to dip
LEAST_VARIATION = 0.05  # of its value: what differs by less is a constant
LEAST_WEIGHT = 1e-12  # of the greatest: a dip with less tells nothing of a constant


@dataclass(frozen=True, eq=False)
class Constants:
    """What is known of the constants: their `information`, on the base of what the motors draw
    themselves, `factor` of a 95 % interval, and `spreads` {name: how far it differs from dip to
    dip, as a share of it}, of those that do.
    """

    information: Information
    factor: float
    spreads: Mapping[str, float]

    @property
    def intervals(self) -> np.ndarray:
        """(k, 2), 95 %."""
        half = self.factor * self.information.standard_errors
        return self.information.values[:, None] + half[:, None] * [-1.0, 1.0]


def judge_constants(spec: LoadSpec, fit: SharedFit) -> Constants:
    """How far the constants of a fit scatter, and which are none."""
    dips = [fit.dips[k] for k in fit.regular]
    torques = fit.torques[fit.regular]
    some = sorted(range(len(dips)), key=lambda k: -dips[k].promise)[:MOST_FITTED_DIPS]
    problem = spec.pose([dips[k].event for k in some])
    values = np.empty(problem.space.dimension)
    values[problem.constants] = fit.constants
    values[problem.shares] = torques[some]
    likelihood = Likelihood.of_objective(problem, float(problem.objective(values[None])[0]))
    unit = likelihood.to_unit(values)[0]
    rows, J = differentiate(likelihood, problem, unit)
    own = _project_out(J, problem)
    rows = rows.reshape(problem.drive.channels, -1)
    columns = own.T.reshape(*rows.shape, -1)
    blocks = _choose_blocks(problem)
    moved = compute_moves_without_blocks(
        columns,
        rows,
        blocks,
        own @ own.T,
    )
    root, _, _ = compute_robust_root(own.T, moved)
    scale = problem.scale_to_own_power
    values = fit.constants * scale
    width = (problem.upper - problem.lower)[problem.constants]
    names = tuple(problem.space.names[k] for k in problem.constants)
    information = Information(
        names,
        values,
        width * scale,
        root,
        SINGULAR_ROUNDING,
    )
    spreads = _find_spreads(problem, columns, rows, fit.constants)
    factor = compute_interval_factor(max(len(blocks) - 1, 1))
    return Constants(information, factor, spreads)


def _choose_blocks(problem: SizedProblem) -> list[slice]:
    """What is left out in turn: each dip, and stretches where there are few of them."""
    free = len(problem.constants)
    if problem.drive.events <= free:
        return cut_blocks(problem.events, problem.drive, free)
    return [problem.drive.part(e) for e in range(problem.drive.events)]


def _project_out(J: np.ndarray, problem: SizedProblem) -> np.ndarray:
    """Derivatives (k, R) to the constants, of (k + 1, R), less what each dip's torque does."""
    own = J[:-1].copy()
    for mine in problem.separable.rows:
        torque = J[-1, mine]
        size = max(float(torque @ torque), SMALLEST_SQUARE)
        part = own[:, mine] @ torque / size
        own[:, mine] -= np.outer(part, torque)
    return own


def _find_spreads(
    problem: SizedProblem, columns: np.ndarray, rows: np.ndarray, constants: np.ndarray
) -> dict[str, float]:
    """By how much constants differ from dip to dip beyond chance, as shares of them: of one step of
    each dip's own, the others held. Source: DerSimonian and Laird 1986.
    """
    from scipy.special import chdtri

    blocks = cut_blocks(problem.events, problem.drive)
    events = [find_event(problem, block) for block in blocks]
    spreads = {}
    width = (problem.upper - problem.lower)[problem.constants]
    for k, value in enumerate(constants.tolist()):
        acting = np.zeros(problem.drive.events)
        weight = np.zeros_like(acting)
        squares = np.zeros_like(acting)
        for e, block in zip(events, blocks, strict=True):
            own = columns[:, block, k]
            told = float(np.sum(own * rows[:, block]))
            acting[e] -= told
            weight[e] += np.sum(own**2)
            squares[e] += told**2
        seen = weight > LEAST_WEIGHT * weight.max()
        weight = weight[seen]
        step = acting[seen] / weight
        precision = weight**2 / np.maximum(squares[seen], SMALLEST_SQUARE)
        mean = np.average(step, weights=precision)
        excess = float(np.sum(precision * (step - mean) ** 2))
        freedom = int(seen.sum()) - 1
        if freedom < 1 or excess <= chdtri(freedom, CONSTANT_CHANCE):
            continue
        total = np.sum(precision)
        room = total - np.sum(precision**2) / total
        step_spread = np.sqrt(max(excess - freedom, 0.0) / room)
        spread = width[k] * step_spread / abs(value)
        if spread > LEAST_VARIATION:
            spreads[problem.space.names[problem.constants[k]]] = float(spread)
    return spreads
