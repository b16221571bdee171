"""The score test at a fit under one noise, all nuisances projected out: what each candidate,
perturbation or event of its own would gain.

Notation of the score test with nuisances (Rao 1948; Neyman 1959): r whitened residuals, N nuisance
columns with their prior, M = I - N (N'N)^-1 N', s = M W dy/deta of a candidate. Adding the
candidate lowers the deviance by (s'r)^2/s's; the one-step estimate of its size is -s'r/s's with
standard deviation 1/|s|.
"""

import functools
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from tractexp.inference import residual_statistics
from tractexp.inference.catalogue import Candidate
from tractexp.inference.goodness_of_fit import LEAST_DISTINCT_SHARE, SMALLEST_P
from tractexp.inference.problem import Problem
from tractexp.inference.residual_statistics import PER_EVENT
from tractexp.noise.span import compute_basis


@dataclass(frozen=True, eq=False)
class CandidateColumn:
    """A candidate with one setting of its scanned parameters.

    Attributes
    ----------
    candidate : Candidate
        The effect.
    setting : {name: value}
        Of the parameters that are no sizes.
    raw : (k, C, N)
        Changes of the residual [pu] per unit of each size.
    """

    candidate: Candidate
    setting: dict[str, float]
    raw: np.ndarray


@dataclass(frozen=True)
class Score:
    """What the score test says of one candidate at one setting.

    Attributes
    ----------
    name : str
        Of the effect.
    drop : float
        Of the deviance.
    p : float
        Of this drop alone, not corrected for the others.
    size, deviation : {name: value}
        One-step estimates of its sizes, and their standard deviations.
    setting : {name: value}
        Of its other parameters.
    """

    name: str
    drop: float  # of the deviance
    p: float  # of this drop alone, not corrected for the others
    size: dict[str, float]  # one-step estimates
    deviation: dict[str, float]
    setting: dict[str, float]


@dataclass(frozen=True, eq=False)
class ScoreTest:
    """Whitened and with the nuisances projected out; `r` has one row per residual (one, or the
    bootstrap's).
    """

    columns: tuple[CandidateColumn, ...]
    faults: Mapping[str, list[int]]  # which nuisances belong to which fault of the measurement
    groups: np.ndarray  # (c,) which balance a push goes into
    Q: np.ndarray
    R: np.ndarray
    r: np.ndarray  # (b, R)
    along: np.ndarray  # (b, k) the residuals' part along the nuisances
    departure: np.ndarray  # (k,) where the nuisances stand, off their prior mean
    blocks: list[np.ndarray]  # per column (k, R)
    split: np.ndarray  # (e, R) what each parameter changes in one event alone
    perturbed: np.ndarray  # (c, R)

    def replace_residuals(self, white: np.ndarray) -> "ScoreTest":
        """The score test of other residuals, such as draws, in place of the fit's own.

        Parameters
        ----------
        white : (b, C N)
            Whitened residuals; they stand at no departure from a prior mean.

        Returns
        -------
        ScoreTest
        """
        rows = np.pad(white, ((0, 0), (0, len(self.Q) - white.shape[1])))
        along = rows @ self.Q
        rows -= along @ self.Q.T
        return replace(self, r=rows, along=along, departure=np.zeros_like(self.departure))

    @functools.cached_property
    def drops(self) -> tuple[np.ndarray, np.ndarray]:
        """Drop of the deviance (columns, b) by adding each column, sizes in their allowed
        direction, and its p.
        """
        drops = []
        ps = []
        for column, block in zip(self.columns, self.blocks, strict=True):
            signs = np.array([column.candidate.sign(p) for p in column.candidate.sizes])
            drop, p = compute_signed_drop(block, self.r, signs)
            drops.append(drop)
            ps.append(p)
        shape = (len(self.blocks), len(self.r))
        return np.array(drops).reshape(shape), np.array(ps).reshape(shape)

    @functools.cached_property
    def ranked_scores(self) -> dict[str, list[Score]]:
        """Each candidate at all its settings, the best first, for the fit's own residual."""
        by_name: dict[str, list[Score]] = {}
        drops, ps = (row[:, 0].tolist() for row in self.drops)
        for column, block, drop, p in zip(self.columns, self.blocks, drops, ps, strict=True):
            gram = block @ block.T
            inverse = np.linalg.pinv(gram, rcond=1e-10, hermitian=True)
            size = -inverse @ (block @ self.r[0])
            spread = np.where(np.diag(gram) > 0, np.sqrt(np.maximum(np.diag(inverse), 0.0)), np.inf)
            labels = [p.name for p in column.candidate.sizes]
            name = column.candidate.name
            sizes, deviations = (
                dict(zip(labels, row.tolist(), strict=True)) for row in (size, spread)
            )
            by_name.setdefault(name, []).append(
                Score(name, drop, p, sizes, deviations, column.setting)
            )
        return {name: sorted(scores, key=lambda s: -s.drop) for name, scores in by_name.items()}

    def scores(self) -> list[Score]:
        """The candidates by p, each at its best setting, for the fit's own residual."""
        return sorted(
            (scores[0] for scores in self.ranked_scores.values()), key=lambda s: (s.p, -s.drop)
        )

    def fault_p(self) -> dict[str, np.ndarray]:
        """{name: p (b,)} of each fault of the measurement: its estimate over its standard
        deviation, prior included.
        """
        result = {}
        inverse = np.linalg.pinv(self.R, rcond=1e-12)  # N'N = R'R
        estimate = -self.along @ inverse.T  # departures of the nuisances, (b, k)
        covariance = inverse @ inverse.T
        for name, members in self.faults.items():
            whole = estimate[:, members] + self.departure[members]
            inner = np.linalg.pinv(
                covariance[np.ix_(members, members)], rcond=1e-12, hermitian=True
            )
            result[name] = chdtrc(len(members), np.einsum("bi,ij,bj->b", whole, inner, whole))
        return result

    def variance_component(self) -> np.ndarray:
        """How much injected perturbations of all balances and windows still find, (b,).

        It is the structured test of adequacy: a score test of a variance component (Lin 1997).
        """
        power = np.einsum("cr,cr->c", self.perturbed, self.perturbed)
        counted = power > 1e-8 * power.max(initial=1e-300)
        z = (self.r @ self.perturbed[counted].T) ** 2
        groups = self.groups[counted]
        scale = np.array([power[counted][groups == g].mean() for g in groups])
        return (z / scale).sum(axis=1)

    @property
    def least_p(self) -> np.ndarray:
        """The smallest p (b,) of all candidates."""
        return np.maximum(self.drops[1].min(axis=0, initial=1.0), SMALLEST_P)

    def channels(self, problem: Problem) -> np.ndarray:
        """The residuals (b, C, N), without the rows of the prior."""
        drive = problem.drive
        return self.r[:, : drive.measurements.size].reshape(len(self.r), drive.channels, -1)

    def statistics(self, problem: Problem) -> dict[str, np.ndarray]:
        """{test: statistic} of what no candidate accounts for: a sum (b,), or the largest of
        many (b, k).
        """
        by_test = {
            "pushes into the balances": self.variance_component(),
            "a further effect": -np.log(self.least_p)[:, None],
            **residual_statistics.compute_residual_statistics(self.channels(problem), problem),
        }
        if len(problem.events) > 1:
            by_test[PER_EVENT] = (
                (self.r @ compute_basis(self.split, LEAST_DISTINCT_SHARE, 1e-12).T) ** 2
            ).sum(axis=1)
        return by_test


def compute_signed_drop(
    block: np.ndarray, r: np.ndarray, signs: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """By how much a least-squares multiple of some rows that keeps signs lowers squares.

    Parameters
    ----------
    block : (k, R)
        Whitened columns of a candidate, one a size, nuisances projected out.
    r : (b, R)
        Whitened residuals.
    signs : (k,)
        1 or -1 of a size that can go one way only, 0 of another.

    Returns
    -------
    (b,) array
        The drop of |r|².
    (b,) array
        Its p. A size on its bound loses half of its chi-square: p is that of a chi-bar-square.

    Notes
    -----
    Source: Self and Liang 1987.

    Examples
    --------
    >>> drop, p = compute_signed_drop(np.array([[1.0, 0.0]]), np.array([[3.0, 1.0]]), np.array([0]))
    >>> drop.tolist(), p.round(4).tolist()
    ([9.0], [0.0027])
    """
    gram = block @ block.T
    top = np.diag(gram).max(initial=0.0)
    if not top > 1e-12:
        return np.zeros(len(r)), np.ones(len(r))
    side = r @ block.T  # (b, k)
    inverse = np.linalg.pinv(gram, rcond=1e-10, hermitian=True)
    size = -side @ inverse
    drop = -np.einsum("bi,bi->b", size, side)
    if len(signs) == 1:
        if signs[0]:
            drop = np.where(size[:, 0] * signs[0] > 0, drop, 0.0)
            return drop, np.where(drop > 0, 0.5 * chdtrc(1, drop), 1.0)
        return drop, chdtrc(1, drop)
    wrong = ((size * signs) < 0).any(axis=1)
    if wrong.any():
        single = np.where(
            (-side * signs >= 0) | (signs == 0), side**2 / np.maximum(np.diag(gram), 1e-300), 0.0
        )
        drop = np.where(wrong, single.max(axis=1), drop)
    return drop, chdtrc(len(signs), drop)
