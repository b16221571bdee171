"""Which effects: candidates scored, the best refitted, and one more added as long as chance cannot explain the gain.

Subsets are ranked exhaustively on the linearised problem, because forward selection alone stalls where effects
look alike; the shortlist is refitted nonlinearly from several starts, side by side.
"""

import functools
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.discrepancy.null import Null, null_of
from tractexp.discrepancy.study import Refit, Study
from tractexp.discrepancy.tangent import (
    Column,
    Projection,
    Score,
    Tangent,
    rich_residuals,
    tangent,
)
from tractexp.discrepancy.valleys import DISTINCT
from tractexp.noise.model import Noise

MOST_EFFECTS = 3
SHORTLIST = {1: 10, 2: 8, 3: 6}  # sets of each size that are refitted
CLOSE = 12.0  # of the deviance: a rough refit this near the best is made exact
RARER = 0.1  # by how much a load effect beside one of the measurement chain must be rarer by chance than alone
FURTHER = (1e-5, 1e-9)  # p a second and a third name must undercut: they spoil right ones, or patch up wrong ones
PLAIN = 1e-10  # a score of this p needs no exact threshold
PATCHED = 4  # sets of one size that are tried before a further effect is added
ADEQUATE = 0.003  # p below which a fit leaves something: rarer than 199 draws can tell by themselves
NESTED = 0.1  # a set may be worse than its own subset by no more than this, or the refit did not converge


@dataclass(frozen=True, eq=False)
class Stage:
    """The tests at one fit."""

    fit: Refit
    noise: Noise
    tangent: Tangent
    projection: Projection
    null: Null
    scores: list[Score]

    @functools.cached_property
    def left(self) -> dict[str, float]:
        """How often chance leaves as much as this fit does, by each test."""
        return self.null.surprises(self.projection, self.tangent.study)

    @property
    def p_left(self) -> float:
        """The same by the most surprised test, corrected for their number."""
        return min(1.0, len(self.left) * min(self.left.values()))

    @property
    def adequate(self) -> bool:
        """Whether chance alone may leave as much."""
        return self.p_left >= ADEQUATE

    @property
    def further(self) -> float:
        """The p that one more name must undercut."""
        return FURTHER[min(len(self.fit.names), len(FURTHER)) - 1]

    @property
    def loudest(self) -> str:
        """What stands out most of that which this fit leaves."""
        return min(self.left, key=self.left.__getitem__)

    @property
    def resting(self) -> list[str]:
        """Parameters that rest on a bound: better values lie beyond it."""
        names = {k: name for name, k in self.tangent.study.column.items()}
        return [names[k] for k in self.tangent.held]

    def significant(self, alpha: float) -> bool:
        """Whether any further effect of the load helps more than chance does."""
        level = self.null.critical_p(alpha)
        if self.fit.names:
            level = min(level, self.further)
        elif self.chain(alpha):
            level *= RARER  # small p are uniform under the null
        return bool(self.scores) and self.scores[0].p < level

    def chain(self, alpha: float) -> list[str]:
        """The measurement-chain effects that are not at their null.

        None where the voltage is noisy: whatever smooths the calculated power would seem to be there.
        """
        if self.noise.blurred:
            return []
        critical = self.null.critical_p(alpha)
        level = min(critical, self.further) if self.fit.names else critical
        return sorted(name for name, p in self.projection.chain_p().items() if p[0] < level)


@dataclass(frozen=True, eq=False)
class Explanation:
    """The chosen set of load effects, the tests at each step, and every set that was refitted."""

    stages: list[Stage]  # before the first effect, after the first, ...
    refits: dict[tuple[str, ...], Refit]

    @property
    def chosen(self) -> Refit:
        return self.stages[-1].fit


def stage(study: Study, fit: Refit, noise: Noise, seed: int, plain: bool = False) -> Stage:
    """All tests at one fit, under the noise of what no candidate explains there; `plain` takes it as known."""
    t = tangent(study, fit, noise)
    noise = study.noise_in(rich_residuals(t, t.residual[None])[0], t.residual, t.explaining)
    fit = study.refit(noise, [(fit.names, fit.unit)])[0]
    t = tangent(study, fit, noise)
    projection = t.whitened(noise)
    scores = projection.scores()
    plain = plain or (bool(scores) and scores[0].p < PLAIN)
    return Stage(fit, noise, t, projection, null_of(t, noise, seed, plain), scores)


def explain(
    study: Study, first: Stage, alpha: float, seed: int, tell: Callable[[str], None] = lambda line: None
) -> Explanation:
    """Add effects one by one as long as the best one helps more than chance, searching all sets of each size.

    `first` holds the tests of the base model.
    """
    stages, ground = [first], first
    refits = {(): first.fit}
    while stages[-1].significant(alpha) and len(stages[-1].fit.names) < MOST_EFFECTS:
        size = len(stages[-1].fit.names) + 1
        fits = searched(study, [ground, *stages[1:]], refits, size, tell)
        refits |= {f.names: f for f in fits}
        found = sufficient(study, fits, stages[-1].noise, alpha, seed + size)
        if size == 1 and (found.significant(alpha) or not found.adequate):
            ground, better = elsewhere(study, first, refits, tell)
            if better:
                refits |= {f.names: f for f in better}
                fits = study.best(f for f in refits.values() if f.names)
                found = sufficient(study, fits, first.noise, alpha, seed + size)
        stages.append(found)
    return Explanation(stages, refits)


def searched(
    study: Study, stages: Sequence[Stage], refits: Mapping[tuple[str, ...], Refit], size: int,
    tell: Callable[[str], None],
) -> list[Refit]:  # fmt: skip
    """The most promising sets of one size refitted, the best first. `stages` begin with one without effects."""
    wanted = shortlist(stages, size, study)
    tell(f"refitting {len(wanted)} {'effect' if size == 1 else f'sets of {size}'}{'s' * (size == 1)}")
    noise = stages[-1].noise
    fits = study.rough_refit(noise, [s for n in wanted for s in starts(study, stages, refits, n)])
    near = [f for f in fits if f.cost < fits[0].cost + CLOSE]
    exact = {f.names: f for f in study.refit(noise, [(f.names, f.unit) for f in near])}
    fits = [exact.get(f.names, f) for f in fits]
    return study.best(nested(study, noise, {**refits, **{f.names: f for f in fits}}, fits))


def elsewhere(
    study: Study, first: Stage, refits: Mapping[tuple[str, ...], Refit], tell: Callable[[str], None]
) -> tuple[Stage, list[Refit]]:
    """Single effects that explain more from another valley of the base model, and the base model there.

    Where an effect is missing, a wrong valley may fit better than the right one.
    """
    ground, found = first, study.best(refits.values())
    for valley in study.valleys_but(first.fit.unit):
        fit = study.refit(first.noise, [((), valley)])[0]
        if np.linalg.norm((fit.unit - first.fit.unit)[study.base]) < DISTINCT:
            continue
        t = tangent(study, fit, first.noise)
        projection = t.whitened(first.noise)
        at = replace(first, fit=fit, tangent=t, projection=projection, scores=projection.scores())
        fits = searched(study, [at], {(): fit}, 1, lambda line: tell(f"{line} from another valley of the base model"))
        if fits[0].cost < found[0].cost:
            ground = at
        found = study.best([*found, *fits])
    return ground, [f for f in found if refits.get(f.names) is not f]


def sufficient(study: Study, ranked: Sequence[Refit], noise: Noise, alpha: float, seed: int) -> Stage:
    """The tests at the best fit, or at the first of those close to it that asks for no further effect where it does.

    Formulas are not the physics: of two that fit nearly alike, the one that needs no patch is the better.
    """
    best = stage(study, ranked[0], noise, seed)
    if not best.significant(alpha):
        return best
    for other in [f for f in ranked[1:PATCHED] if f.cost < ranked[0].cost + CLOSE]:
        at = stage(study, other, noise, seed)
        if not at.significant(alpha) and at.p_left > best.p_left:
            return at
    return best


def shortlist(stages: Sequence[Stage], size: int, study: Study) -> list[tuple[str, ...]]:
    """The sets of `size` effects that lower the linearised deviance most: from the base fit, and by adding one."""
    sets: dict[tuple[str, ...], float] = {}
    last = stages[-1]
    for score in last.scores[: SHORTLIST[size]]:
        key = tuple(sorted((*last.fit.names, score.name)))
        sets[key] = last.fit.deviance - score.drop
    if size > 1:
        base = stages[0]
        names = [s.name for s in base.scores if s.drop > 0][:14]
        columns = {s.name: _column(base, s) for s in base.scores}
        for subset in itertools.combinations(sorted(names), size):
            block = np.concatenate([columns[n] for n in subset])
            side = block @ base.projection.r[0]
            drop = side @ np.linalg.pinv(block @ block.T, rcond=1e-9, hermitian=True) @ side
            value = base.fit.deviance - float(drop)
            sets[subset] = min(sets.get(subset, np.inf), value)
    return sorted(sets, key=lambda s: (sets[s], s))[: SHORTLIST[size]]


def _column(base: Stage, score: Score) -> np.ndarray:
    """The projected column of a candidate at its best setting."""
    pairs = zip(base.tangent.columns, base.projection.blocks, strict=True)
    return next(b for c, b in pairs if c.candidate.name == score.name and c.setting == score.setting)


def starts(
    study: Study, stages: Sequence[Stage], refits: Mapping[tuple[str, ...], Refit], names: tuple[str, ...]
) -> list[tuple[tuple[str, ...], np.ndarray]]:
    """Starts for one set: each subset's fit with the others at their one-step size, at their best two settings."""
    made = []
    for left in names:
        rest = tuple(n for n in names if n != left)
        from_fit = refits.get(rest, stages[0].fit)
        at = next((s for s in reversed(stages) if s.fit.names == rest), stages[0])
        missing = [n for n in names if n not in from_fit.names]
        for rank in range(2):
            point = from_fit.unit.copy()
            for name in missing:
                _place(study, at if name in {s.name for s in at.scores} else stages[0], name, rank, point)
            made.append((names, point))
    return made


def _place(study: Study, at: Stage, name: str, rank: int, point: np.ndarray) -> None:
    """Put a candidate at its one-step size, with its `rank`-th best setting, into coordinates (D,)."""
    column, sizes = ranked_settings(at, name)[min(rank, len(ranked_settings(at, name)) - 1)]
    for label, value in column.setting.items():
        point[study.column[label]] = study.to_unit(label, value)
    for p, size in zip(column.candidate.sizes, sizes, strict=True):
        least = column.candidate.relevant(p) * 0.1
        sign = column.candidate.sign(p)
        moved = max(size * sign, least) * sign if sign else size
        low, high = p.bounds
        point[study.column[p.name]] = study.to_unit(p.name, float(np.clip(p.null + moved, low, high)))


def ranked_settings(at: Stage, name: str) -> list[tuple[Column, np.ndarray]]:
    """A candidate's settings by how much they lower the deviance, each with its one-step sizes."""
    drops, _ = at.projection.drops
    rows = []
    for k, (column, block) in enumerate(zip(at.tangent.columns, at.projection.blocks, strict=True)):
        if column.candidate.name == name:
            size = -np.linalg.pinv(block @ block.T, rcond=1e-10, hermitian=True) @ (block @ at.projection.r[0])
            rows.append((float(drops[k, 0]), column, size))
    return [(c, s) for _, c, s in sorted(rows, key=lambda row: -row[0])]


def nested(study: Study, noise: Noise, refits: Mapping[tuple[str, ...], Refit], fits: list[Refit]) -> list[Refit]:
    """Refit from its best subset any set that came out worse than that subset: its search had not converged."""
    again = []
    for fit in fits:
        subsets = [refits[s] for s in refits if set(s) < set(fit.names)]
        best = min(subsets, key=lambda r: r.deviance, default=None)
        if best is not None and fit.deviance > best.deviance + NESTED:
            again.append((fit.names, best.unit))
    if not again:
        return fits
    redone = {f.names: f for f in study.refit(noise, again)}
    return [min(f, redone.get(f.names, f), key=lambda r: r.deviance) for f in fits]
