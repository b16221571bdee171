"""Which effects: candidates scored, the best refitted, and one more added as long as chance cannot
explain the gain.

Subsets are ranked exhaustively on the linearised problem, because forward selection alone stalls
where effects look alike; the shortlist is refitted nonlinearly from several starts, side by side.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.disagreement import Disagreement, examine_base_fit, examine_fit
from tractexp.discrepancy.families import compare_members, is_worth
from tractexp.discrepancy.ranking import MOST_NAMED
from tractexp.discrepancy.window_search import replace_faults_by_window
from tractexp.inference.base_fit import BaseFit
from tractexp.inference.context import Context
from tractexp.inference.cores import map_on_cores
from tractexp.inference.fit_effort import (
    BOX_APART,
    BOX_POINTS,
    BOX_STARTS,
    NEAR_BEST,
    NESTED_TOLERANCE,
)
from tractexp.inference.fitting import (
    Names,
    Refit,
    Start,
    key_by_names,
    leave_each_out,
    move_off_bounds,
    refit,
    refit_from,
    refit_roughly,
    refit_worse_than_subsets,
    select_best_fits,
)
from tractexp.inference.multistart import DISTINCT
from tractexp.inference.score_test import Score
from tractexp.inference.wide_fit import refit_sets_widely
from tractexp.noise import Noise
from tractexp.parameter import best_distinct, spread_evenly

MOST_STEPS = 6  # of adding and leaving out
SHORTLIST = {1: 10, 2: 8, 3: 4}  # sets of each size that are refitted
COMBINED = 14  # effects whose sets are ranked exhaustively
PATCHED = 4  # sets of one size that are tried before a further effect is added
WIDELY = 3  # single effects with thresholds or times that are searched to the end
RANKS = 2  # settings of a candidate to start from
FAMILY_SEED_OFFSET = 50  # added to the seed of the draws at members of families
LEAST_START = 0.1  # smallest relevant sizes that a start moves at least

Refits = Mapping[Names, Refit]


@dataclass(frozen=True, eq=False)
class Explanations:
    """The tests before the first effect, after the first, and so on, and the best fit of every set
    that was tried.
    """

    base: BaseFit
    steps: tuple[Disagreement, ...]
    refits: Refits

    @property
    def last(self) -> Disagreement:
        """The tests at the chosen set."""
        return self.steps[-1]

    @property
    def chosen(self) -> Refit:
        """The set that the search ended at."""
        return self.last.fit

    @property
    def faults(self) -> Names:
        """The faults of the measurement beside the chosen set."""
        return self.last.faults


def find_explanations(
    base: BaseFit, first: Disagreement, seed: int, window_settled: bool = False
) -> Explanations:
    """Add effects one by one as long as the best one helps more than chance, searching all sets of
    each size.

    Begun anew behind the recorder's window, where one takes the place of faults of the measurement.
    """
    steps = [first]
    refits: dict[Names, Refit] = {(): first.fit}
    while steps[-1].asks_for_more and is_worth_another(steps) and len(steps) < MOST_STEPS:
        size = len(steps[-1].fit.names) + 1
        ground = examine_beneath(first, steps[-1].fit) if size > 1 else first
        fits = search_effect_sets([ground, *steps[1:]], refits, size, base.context.effort.say)
        refits |= key_by_names(fits)
        if not window_settled and (
            behind := replace_faults_by_window(base, first.fit, fits[0], steps[-1].noise, seed)
        ):
            return find_explanations(
                behind, examine_base_fit(behind, seed), seed, window_settled=True
            )
        tests = find_sufficient(base, fits, steps[-1].noise, seed + size)
        if size == 1:
            if wider := search_widely(base, first, refits, tests):
                refits |= key_by_names(wider)
                fits = select_best_fits(f for f in refits.values() if f.names)
                tests = find_sufficient(base, fits, first.noise, seed + size)
            tests = try_families(base, tests, refits, seed)
        else:
            tests = drop_needless(base, tests, refits, seed + size)
        steps.append(tests)
    if len(steps) == 1:
        tests = try_families(base, first, refits, seed)
        steps += [tests] if tests is not first else []
    return Explanations(base, tuple(steps), refits)


def is_worth_another(steps: Sequence[Disagreement]) -> bool:
    """Whether one more effect is tried beside those of the last tests; not where one led back to
    the same set.
    """
    same = len(steps) > 1 and steps[-2].fit.names == steps[-1].fit.names
    return len(steps[-1].fit.names) < MOST_NAMED and not same


def drop_needless(
    base: BaseFit, tests: Disagreement, refits: dict[Names, Refit], seed: int
) -> Disagreement:
    """The tests with an effect less, where its size at the null costs no more than a further name
    must gain.

    A larger set may have led to a better place of its own subset than any start of that. Adds to
    `refits`.
    """
    fit = tests.fit
    context = base.context
    if len(fit.names) < 2:
        return tests
    fewer = refit(context, tests.noise, leave_each_out(context, fit))[0]
    if is_worth(fit, fewer, context.criteria.further_name_p):
        return tests
    refits[fewer.names] = fewer
    return drop_needless(base, examine_fit(base.quiet, fewer, tests.noise, seed), refits, seed)


def try_families(
    base: BaseFit, tests: Disagreement, refits: dict[Names, Refit], seed: int
) -> Disagreement:
    """The tests at a member of a family that leaves nothing and explains more than these; else
    these. Adds to `refits`.

    None is tried at a `further_name_p` of 0, and none of waveforms: no criterion was calibrated
    with members.
    """
    if not base.context.domain.calibrated or not base.context.criteria.further_name_p:
        return tests
    tests, fits = compare_members(base, tests, refits, seed + FAMILY_SEED_OFFSET)
    refits |= key_by_names(fits)
    return tests


def search_effect_sets(
    steps: Sequence[Disagreement], refits: Refits, size: int, say: Callable[[str], None]
) -> list[Refit]:
    """The most promising sets of one size refitted, single effects from all over the base model's
    box, too; the best first. `steps` begin with one without effects.
    """
    context = steps[0].context
    noise = steps[-1].noise
    if not (wanted := shortlist_sets(steps, size)):
        return []
    one, many = ("effect", "effects") if size == 1 else (f"set of {size}", f"sets of {size}")
    say(f"refitting {len(wanted)} {one if len(wanted) == 1 else many}")
    fits = refit_sets(context, noise, [s for n in wanted for s in list_starts(steps, refits, n)])
    if size == 1:
        boxes = map_on_cores(lambda fit: start_all_over(context, fit), fits, context.effort)
        fits = select_best_fits([*fits, *refit_sets(context, noise, list(itertools.chain(*boxes)))])
    return select_best_fits(
        refit_worse_than_subsets(context, noise, {**refits, **key_by_names(fits)}, fits)
    )


def refit_sets(context: Context, noise: Noise, begin: Sequence[Start]) -> list[Refit]:
    """The sets of these starts refitted, those near the best exactly; the best first."""
    fits = refit_roughly(context, noise, begin)
    # the best itself is near, though it diverges and its cost is infinite
    near = [f for f in fits if f.cost <= fits[0].cost + NEAR_BEST]
    exact = key_by_names(refit(context, noise, [f.start for f in near]))
    return [exact.get(f.names, f) for f in fits]


def examine_beneath(first: Disagreement, fit: Refit) -> Disagreement:
    """The tests of the base model at the local minimum of a fit with an effect, where its best fit
    is another.
    """
    context = first.context
    start = context.coordinates.remove_effects(fit.unit, fit.names)
    bare = refit_from(context, first.noise, (), start)
    away = np.linalg.norm((bare.unit - first.fit.unit)[context.coordinates.base])
    return first.score_fit(context, bare, first.noise) if away > DISTINCT else first


def search_widely(
    base: BaseFit, first: Disagreement, refits: Refits, best: Disagreement
) -> list[Refit]:
    """Single effects that have thresholds or times, searched from all their settings.

    None where the best so far leaves nothing.
    """
    if best.suffices:
        return []
    context = base.context
    singles: Refits = {f.names: f for f in select_best_fits(refits.values()) if len(f.names) == 1}
    fits = refit_sets_widely(
        context, first.noise, list_wide_starts(context, refits[()].unit, singles), WIDELY
    )
    return [f for f in fits if f.deviance < singles[f.names].deviance - NESTED_TOLERANCE]


def list_wide_starts(context: Context, bare: np.ndarray, refits: Refits) -> list[list[Start]]:
    """Starts for each single effect that has thresholds or times: its fit, and all settings beside
    the base model.
    """
    singles = [f for f in refits.values() if len(f.names) == 1]
    unlike = [f for f in singles if len(context.catalogue[f.names[0]].settings) > 1]
    grounds = bare, *move_off_bounds(context, bare)
    return [
        [f.start, *(s for unit in grounds for s in _list_every_setting(context, f, unit))]
        for f in unlike
    ]


def _list_every_setting(context: Context, fit: Refit, unit: np.ndarray) -> list[Start]:
    """Starts for a single effect at coordinates (D,): of the size that it was fitted with, at all
    its settings.
    """
    at = context.coordinates
    sized = unit.copy()
    sized[at.sizes(fit.names)] = fit.unit[at.sizes(fit.names)]
    return [
        (fit.names, at.place_values(sized, setting))
        for setting in context.catalogue[fit.names[0]].settings
    ]


def find_sufficient(
    base: BaseFit, ranked: Sequence[Refit], noise: Noise, seed: int
) -> Disagreement:
    """The tests at the best fit, or at the first of those close to it that asks for no further
    effect where it does.

    Formulas are not the physics: of two that fit nearly alike, the one that needs no patch is the
    better.
    """
    best = examine_fit(base.quiet, ranked[0], noise, seed)
    if not best.asks_for_more:
        return best
    for other in [f for f in ranked[1:PATCHED] if f.cost < ranked[0].cost + NEAR_BEST]:
        there = examine_fit(base.quiet, other, noise, seed)
        if not there.asks_for_more and there.p_left > best.p_left:
            return there
    return best


def shortlist_sets(steps: Sequence[Disagreement], size: int) -> list[Names]:
    """The sets of `size` effects that lower the linearized deviance most.

    They begin at the base fit and at sets that have one effect less; of more effects than are
    named, at the latter alone.
    """
    first = steps[0]
    last = steps[-1]
    sets: dict[Names, float] = {}
    own = last.context.catalogue.textbook(last.fit.names)
    for score in [s for s in last.scores if s.name not in own][: SHORTLIST[size]]:
        sets[tuple(sorted((*last.fit.names, score.name)))] = last.fit.deviance - score.drop
    if 1 < size <= MOST_NAMED:
        names = [s.name for s in first.scores if s.drop > 0][:COMBINED]
        columns = {s.name: _find_column(first, s) for s in first.scores}
        for subset in itertools.combinations(sorted(names), size):
            block = np.concatenate([columns[n] for n in subset])
            side = block @ first.projection.r[0]
            drop = side @ np.linalg.pinv(block @ block.T, rcond=1e-9, hermitian=True) @ side
            sets[subset] = min(sets.get(subset, np.inf), first.fit.deviance - float(drop))
    return sorted(sets, key=lambda s: (sets[s], s))[: SHORTLIST[size]]


def _find_column(at: Disagreement, score: Score) -> np.ndarray:
    """The projected column of a candidate at its best setting."""
    pairs = zip(at.tangent.columns, at.projection.blocks, strict=True)
    return next(
        b for c, b in pairs if c.candidate.name == score.name and c.setting == score.setting
    )


def list_starts(steps: Sequence[Disagreement], refits: Refits, names: Names) -> list[Start]:
    """Starts for one set: each subset's fit with the others at their one-step size, at their best
    two settings. Members of families, which have no column, begin where they were fitted.
    """
    begin: list[Start] = []
    columns = steps[0].projection.ranked_scores
    for left in names:
        rest = tuple(n for n in names if n != left)
        from_fit = refits.get(rest, steps[0].fit)
        at = next((s for s in reversed(steps) if s.fit.names == rest), steps[0])
        missing = [n for n in names if n not in from_fit.names]
        if not columns.keys() >= {*missing}:
            continue
        for rank in range(RANKS):
            point = from_fit.unit
            for name in missing:
                point = _place_candidate(
                    at if name in {s.name for s in at.scores} else steps[0], name, rank, point
                )
            begin.append((names, point))
    return begin


def start_all_over(context: Context, fit: Refit) -> list[Start]:
    """Starts of one effect from all over the base model's box, by one simulation each: the effect
    as it was fitted, but of relevant size.

    Where an effect is missing, a wrong local minimum of the base model may fit better than the
    right one. There a right effect may have no size at all.
    """
    at = context.coordinates
    candidate = context.catalogue[fit.names[0]]
    points = spread_evenly(BOX_POINTS, len(at.base))
    units = np.repeat(fit.unit[None], BOX_POINTS, axis=0)
    units[:, at.base] = points
    for p, column in zip(candidate.sizes, at.sizes(fit.names), strict=True):
        size = at.value(p.name, fit.unit) - p.absent
        units[:, column] = at.to_unit(p.name, candidate.compute_sized_value(p, size, least=1.0))
    problem, values = context.kernels.select_problem(fit.names, units)
    context.effort.spend(BOX_POINTS)
    chosen = best_distinct(points, problem.objective(values), BOX_APART, BOX_STARTS, norm=2)
    return [(fit.names, units[k]) for k in chosen]


def _place_candidate(at: Disagreement, name: str, rank: int, unit: np.ndarray) -> np.ndarray:
    """Coordinates (D,) with a candidate at its one-step size and its `rank`-th best setting."""
    ranked = at.projection.ranked_scores[name]
    candidate = at.context.catalogue[name]
    score = ranked[min(rank, len(ranked) - 1)]
    values = dict(score.setting)
    for p in candidate.sizes:
        values[p.name] = candidate.compute_sized_value(p, score.size[p.name], LEAST_START)
    return at.context.coordinates.place_values(unit, values)
