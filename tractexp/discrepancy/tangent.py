"""The linearised problem around a fit: what each candidate would change, with all nuisances projected out.

Notation of the score test with nuisances (Rao 1948; Neyman 1959): r whitened residuals, N nuisance columns with
their prior, M = I - N (N'N)^-1 N', s = M W dy/deta of a candidate. Adding the candidate lowers the deviance by
(s'r)^2/s's; the one-step estimate of its size is -s'r/s's with standard deviation 1/|s|.
"""

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from tractexp.discrepancy.catalogue import Candidate
from tractexp.discrepancy.injection import PUSHES
from tractexp.discrepancy.study import Refit, Study
from tractexp.noise.model import Noise
from tractexp.noise.span import spanned

REACH = 0.5  # smallest relevant sizes: the step of a candidate's difference quotient
NUISANCE_STEP = 1e-4  # of a coordinate's range
WALL, HELD = 1e-3, 1e-6  # of it: how near a wall a parameter rests on it, and how far it may move then
LEAST_KEPT = 0.2  # of a residual's variance: where columns explain more, it tells nothing of the noise
DISTINCT = 1e-3  # of the largest singular value: directions weaker than this are rounding
WINDOWS = (0.0, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6)  # s after the end of the dip


@dataclass(frozen=True, eq=False)
class Column:
    """A candidate with one setting of its scanned parameters: differences (k, 2, N) per unit of each size."""

    candidate: Candidate
    setting: dict[str, float]
    raw: np.ndarray


@dataclass(frozen=True)
class Score:
    """What the score test says of one candidate, at its best setting."""

    name: str
    drop: float  # of the deviance
    p: float  # of this drop alone, not corrected for the others
    size: dict[str, float]  # one-step estimates
    deviation: dict[str, float]
    setting: dict[str, float]


@dataclass(frozen=True, eq=False)
class Tangent:
    """Raw residuals and differences at a fit; `whitened` turns them into a `Projection` under a noise model."""

    study: Study
    residual: np.ndarray  # (2, N)
    nuisance: np.ndarray  # (k, 2, N)
    prior: np.ndarray  # (k, k) prior rows of the nuisances, whitened
    estimate: np.ndarray  # (k,) the nuisances' departure from their prior mean, in its standard deviations (or 0)
    chain: dict[str, list[int]]  # which nuisances belong to which effect of the measurement chain
    columns: tuple[Column, ...]
    split: np.ndarray  # (e, 2, N) differences of the fitted parameters, each in one event only
    cells: np.ndarray  # (c, 2, N) responses to injections
    groups: np.ndarray  # (c,) which balance an injection pushes
    held: tuple[int, ...]  # columns of the base model's parameters that rest on a wall

    @functools.cached_property
    def explaining(self) -> np.ndarray:
        """All that the fit or any candidate could change, (k, 2, N)."""
        return np.concatenate([self.nuisance, *(c.raw for c in self.columns)])

    def whitened(self, noise: Noise, residuals: np.ndarray | None = None) -> "Projection":
        """Project under this noise; `residuals` (b, 2, N) replace the fit's own (for the bootstrap)."""
        own = residuals is None
        raw = [
            self.nuisance,
            self.residual[None] if own else residuals,
            *(c.raw for c in self.columns),
            self.split,
            self.cells,
        ]
        ends = np.cumsum([len(part) for part in raw])
        white = noise.whiten(np.concatenate(raw), self.study.problem.drive, self.study.likelihood.known)
        rows = np.concatenate([white, np.zeros((len(white), len(self.prior)))], axis=1)
        size = white.shape[1]
        rows[: ends[0], size:] = self.prior.T
        if own:
            rows[ends[0], size:] = self.prior @ self.estimate
        Q, R = np.linalg.qr(rows[: ends[0]].T)
        rest = rows[ends[0] :]
        along = rest @ Q
        rest -= along @ Q.T
        parts = np.split(rest, ends[1:-1] - ends[0])
        departure = self.estimate if own else np.zeros_like(self.estimate)
        return Projection(self, Q, R, parts[0], along[: len(parts[0])], departure, parts[1:-2], *parts[-2:])


@dataclass(frozen=True, eq=False)
class Projection:
    """Whitened and with the nuisances projected out; `r` has one row per residual (one, or the bootstrap's)."""

    tangent: Tangent
    Q: np.ndarray
    R: np.ndarray
    r: np.ndarray  # (b, R)
    along: np.ndarray  # (b, k) the residuals' part along the nuisances
    departure: np.ndarray  # (k,) where the nuisances stand, off their prior mean
    blocks: list[np.ndarray]  # per column (k, R)
    split: np.ndarray  # (e, R)
    cells: np.ndarray  # (c, R)

    @functools.cached_property
    def drops(self) -> tuple[np.ndarray, np.ndarray]:
        """Drop of the deviance (columns, b) by adding each column, sizes in their allowed direction, and its p."""
        drops, ps = [], []
        for column, block in zip(self.tangent.columns, self.blocks, strict=True):
            signs = np.array([column.candidate.sign(p) for p in column.candidate.sizes])
            drop, p = _signed_drop(block, self.r, signs)
            drops.append(drop)
            ps.append(p)
        shape = (len(self.blocks), len(self.r))
        return np.array(drops).reshape(shape), np.array(ps).reshape(shape)

    def scores(self) -> list[Score]:
        """The candidates by drop, each at its best setting, for the fit's own residual."""
        best: dict[str, Score] = {}
        drops, ps = self.drops
        for k, (column, block) in enumerate(zip(self.tangent.columns, self.blocks, strict=True)):
            name = column.candidate.name
            if name in best and best[name].drop >= drops[k, 0]:
                continue
            gram = block @ block.T
            inverse = np.linalg.pinv(gram, rcond=1e-10, hermitian=True)
            size = -inverse @ (block @ self.r[0])
            labels = [p.name for p in column.candidate.sizes]
            spread = np.sqrt(np.maximum(np.diag(inverse), 0.0))
            spread = np.where(np.diag(gram) > 0, spread, np.inf)
            best[name] = Score(
                name, float(drops[k, 0]), float(ps[k, 0]), dict(zip(labels, size.tolist(), strict=True)),
                dict(zip(labels, spread.tolist(), strict=True)), column.setting,
            )  # fmt: skip
        return sorted(best.values(), key=lambda s: (s.p, -s.drop))

    def chain_p(self) -> dict[str, np.ndarray]:
        """p of each measurement-chain effect, (b,): its estimate over its standard deviation, prior included."""
        result = {}
        inverse = np.linalg.pinv(self.R, rcond=1e-12)  # N'N = R'R
        estimate = -self.along @ inverse.T  # departures of the nuisances, (b, k)
        covariance = inverse @ inverse.T
        for name, members in self.tangent.chain.items():
            whole = estimate[:, members] + self.departure[members]
            inner = np.linalg.pinv(covariance[np.ix_(members, members)], rcond=1e-12, hermitian=True)
            result[name] = chdtrc(len(members), np.einsum("bi,ij,bj->b", whole, inner, whole))
        return result

    def unrest(self) -> np.ndarray:
        """How much injections of all balances and windows still find, (b,): the structured test of adequacy."""
        power = np.einsum("cr,cr->c", self.cells, self.cells)
        kept = power > 1e-8 * power.max(initial=1e-300)
        z = (self.r @ self.cells[kept].T) ** 2
        groups = self.tangent.groups[kept]
        scale = np.array([power[kept][groups == g].mean() for g in groups])
        return (z / scale).sum(axis=1)

    def unsteadiness(self) -> np.ndarray:
        """How much parameters of their own for each event would lower the deviance, (b,)."""
        return ((self.r @ spanned(self.split, DISTINCT, least=1e-12).T) ** 2).sum(axis=1)


def _signed_drop(block: np.ndarray, r: np.ndarray, signs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Drop (b,) of |r|^2 by a least-squares multiple of the rows of `block` that keeps the signs, and its p.

    A size on its bound loses half of its chi-square: p is that of a chi-bar-square (Self and Liang 1987).
    """
    gram = block @ block.T
    top = np.diag(gram).max(initial=0.0)
    if not top > 1e-12:
        return np.zeros(len(r)), np.ones(len(r))
    side = r @ block.T  # (b, k)
    inverse = np.linalg.pinv(gram, rcond=1e-10, hermitian=True)
    size = -side @ inverse
    drop = np.einsum("bi,ij,bj->b", side, inverse, side)
    if len(signs) == 1:
        if signs[0]:
            drop = np.where(size[:, 0] * signs[0] > 0, drop, 0.0)
            return drop, np.where(drop > 0, 0.5 * chdtrc(1, drop), 1.0)
        return drop, chdtrc(1, drop)
    wrong = ((size * signs) < 0).any(axis=1)
    if wrong.any():
        single = np.where((-side * signs >= 0) | (signs == 0), side**2 / np.maximum(np.diag(gram), 1e-300), 0.0)
        drop = np.where(wrong, single.max(axis=1), drop)
    return drop, chdtrc(len(signs), drop)


def tangent(study: Study, fit: Refit, noise: Noise) -> Tangent:
    """Differences of everything at a fit, in one batch. What is in the fit, and the chain, are nuisances.

    A parameter of the base model on a wall that would leave the box is held there: what only values beyond its bounds
    explain is left. Those of effects are not: they belong to a formula, not to the load.
    """
    inside = [*study.base, *study.before, *study.parameters(fit.names)]
    chain = {name: study.sizes([name]) for name in study.catalogue.chain}
    nuisances = [*inside, *(k for members in chain.values() for k in members)]
    up, down = two_sided(fit.unit, nuisances)
    points, spans, labels = _candidate_points(study, fit)
    injected, groups = injections(study, fit.unit)
    k, m = len(nuisances), len(points)
    sets = [(fit.names, False)] * (1 + 2 * k)
    sets += [((*fit.names, c.name), False) for c, _, first, last in labels for _ in range(first, last)]
    sets += [(fit.names, True)] * len(injected)
    raw = study.residuals_of(np.concatenate([fit.unit[None], up, down, points, injected]), sets)
    base = raw[0]
    up_rows, down_rows = raw[1 : 1 + k], raw[1 + k : 1 + 2 * k]
    width = np.array([u[c] - d[c] for u, d, c in zip(up, down, nuisances, strict=True)])
    nuisance = np.nan_to_num((up_rows - down_rows) / width[:, None, None])
    moved = np.nan_to_num((raw[1 + 2 * k : 1 + 2 * k + m] - base) / spans[:, None, None])
    cells = np.nan_to_num(raw[1 + 2 * k + m :] - base)
    columns = [Column(c, s, moved[a:b]) for c, s, a, b in labels]
    members = {name: [nuisances.index(c) for c in cols] for name, cols in chain.items()}
    white = noise.whiten(np.concatenate([nuisance, base[None]]), study.problem.drive, study.likelihood.known)
    held = set(np.flatnonzero(resting(study, fit.unit, nuisances, white[:k] @ white[k])).tolist())
    rows = sorted({*held, *(i for group in members.values() for i in group)})
    prior = np.zeros((len(rows), k))
    departure = np.zeros(k)
    for row, i in enumerate(rows):
        prior[row, i] = 1 / (HELD if i in held else study.prior_deviation(nuisances[i]))
        departure[i] = 0.0 if i in held else fit.unit[nuisances[i]] - study.null[nuisances[i]]
    fitted = {*study.base, *study.parameters(fit.names)}
    split = _by_event(study, nuisance[[i for i, c in enumerate(nuisances) if c in fitted and i not in held]])
    walls = tuple(nuisances[i] for i in sorted(held))
    return Tangent(study, base, nuisance, prior, departure, members, tuple(columns), split, cells, groups, walls)


def resting(study: Study, unit: np.ndarray, columns: Sequence[int], gradient: np.ndarray) -> np.ndarray:
    """Which of the columns are parameters of the base model on a wall beyond which the deviance falls.

    `gradient` of the deviance is needed for its sign only.
    """
    x = unit[list(columns)]
    leaving = ((x <= WALL) & (gradient > 0)) | ((x >= 1 - WALL) & (gradient < 0))
    return leaving & np.isin(columns, study.base)


def _by_event(study: Study, columns: np.ndarray) -> np.ndarray:
    """Columns (k, 2, N) cut into one for each event, (k E, 2, N)."""
    split = np.zeros((len(study.events), *columns.shape))
    for e, rows in enumerate(split):
        part = study.problem.drive.part(e)
        rows[..., part] = columns[..., part]
    return split.reshape(-1, *columns.shape[1:])


def two_sided(unit: np.ndarray, columns: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Points (k, D) a small step above and below in each of the columns."""
    up, down = (np.tile(unit, (len(columns), 1)) for _ in "ud")
    for row, k in enumerate(columns):
        up[row, k] = min(unit[k] + NUISANCE_STEP, 1.0)
        down[row, k] = max(unit[k] - NUISANCE_STEP, 0.0)
    return up, down


def _candidate_points(study: Study, fit: Refit) -> tuple[np.ndarray, np.ndarray, list]:
    """One point per size and setting of each candidate outside the fit, and how far it steps [unit of the size]."""
    points, spans, labels = [], [], []
    for candidate in study.catalogue.candidates:
        if candidate.measurement or candidate.name in fit.names:
            continue
        for setting in candidate.settings:
            first = len(points)
            for p in candidate.sizes:
                step = REACH * candidate.relevant(p) * (candidate.sign(p) or 1)
                point = fit.unit.copy()
                for name, value in setting.items():
                    point[study.column[name]] = study.to_unit(name, value)
                point[study.column[p.name]] = study.to_unit(p.name, p.null + step)
                points.append(point)
                spans.append(step)
            labels.append((candidate, setting, first, len(points)))
    return np.array(points).reshape(-1, study.dimension), np.array(spans), labels


def windows(study: Study, event: int) -> list[tuple[float, float]]:
    """The windows [s since the first sample] of one event: before, both halves of the dip, then ever longer ones."""
    e = study.events[event]
    start, end = e.t_start - e.record.t[0], e.t_end - e.record.t[0]
    last = e.record.t[-1] - e.record.t[0]
    edges = [0.0, start, (start + end) / 2, *(end + w for w in WINDOWS if end + w < last), last]
    return [(a, b) for a, b in itertools.pairwise(edges) if b > a]


def injections(study: Study, unit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (c, D) with a push into one balance in one window of the union of the events', and which balance."""
    spans = sorted({w for e in range(len(study.events)) for w in windows(study, e)})
    points, groups = [], []
    for g, push in enumerate(PUSHES):
        for a, b in spans:
            point = unit.copy()
            point[study.column[push]] += 1e-3 / study.width(push)
            point[study.column["window_on"]] = study.to_unit("window_on", a)
            point[study.column["window_off"]] = study.to_unit("window_off", b)
            points.append(point)
            groups.append(g)
    return np.array(points), np.array(groups)


def rich_residuals(t: Tangent, residuals: np.ndarray) -> np.ndarray:
    """Residuals (b, 2, N) with everything any column explains taken away, unweighted: what noise is estimated from.

    Each is divided by what is left of its variance then, so that the noise does not come out too small.
    """
    right = spanned(t.explaining.reshape(-1, residuals[0].size), 1e-6)
    flat = residuals.reshape(len(residuals), -1)
    kept = np.maximum(1 - np.einsum("kn,kn->n", right, right), LEAST_KEPT)
    return ((flat - (flat @ right.T) @ right) / np.sqrt(kept)).reshape(residuals.shape)
