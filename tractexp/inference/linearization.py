"""The linearized problem around a fit: what each parameter, candidate and injected perturbation
would change, in one batch.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.inference.bounds import BOUND_DISTANCE
from tractexp.inference.context import Context
from tractexp.inference.fitting import Refit
from tractexp.inference.injection import PUSHES, inject_perturbations
from tractexp.inference.noise import restore_variance
from tractexp.inference.score_test import CandidateColumn, ScoreTest
from tractexp.noise import Noise
from tractexp.noise.span import compute_basis, project_out

CANDIDATE_STEP = 0.5  # smallest relevant sizes: the step of a candidate's difference quotient
LARGEST_MOVE_AT_BOUND = 1e-6  # of it: how far a parameter that rests on a wall may move


@dataclass(frozen=True, eq=False)
class Linearization:
    """Raw residuals and derivatives at a fit; `build_score_test` makes a `ScoreTest` of them under
    a noise.

    Attributes
    ----------
    context : Context
        The records and models.
    unit : (D,)
        Coordinates of the fit.
    residual : (C, N) [pu]
        What it leaves.
    nuisance : (k, C, N)
        Derivatives by what was fitted and by the faults of the measurement.
    prior : (rows, k)
        Whitened rows of the priors of the nuisances.
    estimate : (k,)
        Departure of the nuisances from their prior mean.
    faults : {name: positions}
        Which nuisances belong to which fault of the measurement.
    columns : tuple of CandidateColumn
        Changes by each candidate.
    split : (e, C, N)
        Derivatives by fitted parameters but thresholds and times, each in one event only.
    perturbed : (c, C, N)
        Responses to injected perturbations.
    groups : (c,) ints
        Which balance each perturbs.
    held : tuple of columns
        The base model's parameters that rest on a bound.
    """

    context: Context
    unit: np.ndarray  # (D,) coordinates of the fit
    residual: np.ndarray  # (C, N)
    nuisance: np.ndarray  # (k, C, N)
    prior: np.ndarray  # (rows, k) prior rows of the nuisances, whitened
    # (k,) the nuisances' departure from their prior mean, in its standard deviations (or 0)
    estimate: np.ndarray
    faults: dict[str, list[int]]  # which nuisances belong to which fault of the measurement
    columns: tuple[CandidateColumn, ...]
    # (e, C, N) differences of the fitted parameters but thresholds and times, each in one event
    # only
    split: np.ndarray
    perturbed: np.ndarray  # (c, C, N) responses to injections
    groups: np.ndarray  # (c,) which balance an injection pushes
    held: tuple[int, ...]  # columns of the base model's parameters that rest on a wall

    @functools.cached_property
    def explaining_columns(self) -> np.ndarray:
        """All that the fit or any candidate could change, (k, C, N)."""
        return np.concatenate([self.nuisance, *(c.raw for c in self.columns)])

    def build_score_test(self, noise: Noise) -> ScoreTest:
        """Project under this noise; `ScoreTest.replace_residuals` puts other residuals in place of
        the fit's own.
        """
        raw = [
            self.nuisance,
            self.residual[None],
            *(c.raw for c in self.columns),
            self.split,
            self.perturbed,
        ]
        ends = np.cumsum([len(part) for part in raw])
        white = self.context.whiten(noise, np.concatenate(raw))
        rows = np.pad(white, ((0, 0), (0, len(self.prior))))
        size = white.shape[1]
        rows[: ends[0], size:] = self.prior.T
        rows[ends[0], size:] = self.prior @ self.estimate
        Q, R = np.linalg.qr(rows[: ends[0]].T)
        rest = rows[ends[0] :]
        along = rest @ Q
        rest -= along @ Q.T
        r, *blocks, split, perturbed = np.split(rest, ends[1:-1] - ends[0])
        return ScoreTest(
            self.columns,
            self.faults,
            self.groups,
            Q,
            R,
            r,
            along[:1],
            self.estimate,
            blocks,
            split,
            perturbed,
        )


def linearize_fit(context: Context, fit: Refit, noise: Noise) -> Linearization:
    """Linearize everything at a fit, in one batch of simulations.

    What is fitted, and faults of the measurement, are nuisances. A parameter of the base model on a
    bound that would leave the box is held there: what only values beyond its bounds explain is
    left. Those of effects are not: they belong to a formula, not to the load.

    Parameters
    ----------
    context : Context
        The records and models.
    fit : Refit
        Where the differences are taken.
    noise : Noise
        By which it is judged which bounds hold a parameter.

    Returns
    -------
    Linearization
    """
    at = context.coordinates
    faults = {name: at.sizes([name]) for name in context.catalogue.of_measurement}
    nuisances = at.nuisances(fit.names)
    points, spans, labels = _place_candidate_points(context, fit)
    injected, groups = inject_perturbations(context, fit.unit)
    k = len(nuisances)
    base, nuisance = context.differentiate(fit.unit, nuisances, fit.names)
    beside = [candidate.name for candidate, _, first, last in labels for _ in range(first, last)]
    changes = context.changes(
        fit.unit, np.concatenate([points, injected]), fit.names, beside + [PUSHES] * len(injected)
    )
    further = changes[: len(points)] / spans[:, None, None]
    perturbed = changes[len(points) :]
    columns = tuple(CandidateColumn(c, s, further[a:b]) for c, s, a, b in labels)
    members = {name: [nuisances.index(c) for c in cols] for name, cols in faults.items()}
    white = context.whiten(noise, np.concatenate([nuisance, base[None]]))
    held = set(
        np.flatnonzero(
            find_active_bounds(context, fit.unit, nuisances, white[:k] @ white[k])
        ).tolist()
    )
    rows = sorted({*held, *(i for i, c in enumerate(nuisances) if c in at.prior_deviation)})
    prior = np.zeros((len(rows), k))
    departure = np.zeros(k)
    for row, i in enumerate(rows):
        prior[row, i] = 1 / (
            LARGEST_MOVE_AT_BOUND if i in held else at.prior_deviation[nuisances[i]]
        )
        departure[i] = 0.0 if i in held else fit.unit[nuisances[i]] - at.null[nuisances[i]]
    # a relay's instants hang on the voltage's noise, which no draw has
    fitted = {*at.base, *at.sizes(fit.names)}
    split = _split_by_event(
        context, nuisance[[i for i, c in enumerate(nuisances) if c in fitted and i not in held]]
    )
    active_bounds = tuple(nuisances[i] for i in sorted(held))
    return Linearization(
        context,
        fit.unit,
        base,
        nuisance,
        prior,
        departure,
        members,
        columns,
        split,
        perturbed,
        groups,
        active_bounds,
    )


def find_active_bounds(
    context: Context, unit: np.ndarray, columns: Sequence[int] | np.ndarray, gradient: np.ndarray
) -> np.ndarray:
    """Which parameters of the base model rest on a bound beyond which the deviance falls.

    Parameters
    ----------
    context : Context
        The records and models.
    unit : (D,)
        Coordinates of the fit.
    columns : k columns
        The coordinates that are asked for.
    gradient : (k,)
        Of the deviance; only its sign counts.

    Returns
    -------
    (k,) array of bools
    """
    x = unit[list(columns)]
    leaving = ((x <= BOUND_DISTANCE) & (gradient > 0)) | (
        (x >= 1 - BOUND_DISTANCE) & (gradient < 0)
    )
    return leaving & np.isin(columns, context.coordinates.base)


def _split_by_event(context: Context, columns: np.ndarray) -> np.ndarray:
    """Columns (k, C, N) cut into one for each event, (k E, C, N)."""
    split = np.zeros((len(context.events), *columns.shape))
    for e, part in enumerate(context.drive.parts):
        split[e, ..., part] = columns[..., part]
    return split.reshape(-1, *columns.shape[1:])


def _place_candidate_points(context: Context, fit: Refit) -> tuple[np.ndarray, np.ndarray, list]:
    """One point per size and setting of each candidate outside the fit, and how far it steps [unit
    of the size].
    """
    at = context.coordinates
    points, spans, labels = [], [], []
    for candidate in context.catalogue.candidates:
        if candidate.measurement or candidate.name in fit.names:
            continue
        for setting in candidate.settings:
            first = len(points)
            for p in candidate.sizes:
                step = CANDIDATE_STEP * candidate.relevant(p) * (candidate.sign(p) or 1)
                points.append(at.place_values(fit.unit, setting | {p.name: p.absent + step}))
                spans.append(step)
            labels.append((candidate, setting, first, len(points)))
    return np.array(points).reshape(-1, at.dimension), np.array(spans), labels


def remove_explained(t: Linearization, residuals: np.ndarray) -> np.ndarray:
    """Residuals without everything that any column explains, their variance restored: what noise is
    estimated from.

    Parameters
    ----------
    t : Linearization
        With all columns of the fit and of the candidates.
    residuals : (b, C, N) [pu]
        Of a fit or of draws.

    Returns
    -------
    (b, C, N) array [pu]
    """
    right = compute_basis(t.explaining_columns.reshape(-1, residuals[0].size), 1e-6)
    flat = residuals.reshape(len(residuals), -1)
    leverage = np.einsum("kn,kn->n", right, right)
    return restore_variance(project_out(flat, right), leverage).reshape(residuals.shape)
