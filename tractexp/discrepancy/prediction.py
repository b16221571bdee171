"""What each set of effects predicts of held-out events, where none leaves noise alone of those
fitted: every set fitted by least squares, and judged by the squared error in S.

A formula is not the physics. What the right one leaves is often no noise, and then a test of
significance rejects it as it rejects a wrong one. What can be asked still is how much each set
predicts in events that it was not fitted to.
"""

import functools
import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from tractexp.discrepancy.decide import find_predicting
from tractexp.discrepancy.disagreement import Disagreement, examine_least_squares
from tractexp.discrepancy.evidence import (
    SLIGHT_ERROR,
    Evidence,
    PredictedError,
    SetEvidence,
)
from tractexp.discrepancy.explanations import (
    WIDELY,
    Explanations,
    Names,
    list_starts,
    list_wide_starts,
    refit_sets,
    search_effect_sets,
)
from tractexp.discrepancy.families import fit_members
from tractexp.discrepancy.grades import Grader, fit_as_graded
from tractexp.discrepancy.proposal.library import list_terms
from tractexp.discrepancy.proposal.refit import MOST_JUDGED_TERMS, fit_terms
from tractexp.discrepancy.proposal.screen import ScreeningFit, screen_terms
from tractexp.discrepancy.proposal.term_context import build_term_context, carry_over
from tractexp.discrepancy.ranking import MOST_NAMED, find_nearest, rank_sets
from tractexp.inference.catalogue import Catalogue
from tractexp.inference.context import Context
from tractexp.inference.cores import map_on_cores
from tractexp.inference.fitting import Refit, key_by_names, refit, select_best_fits
from tractexp.inference.model_error import estimate_noise_variance, sum_blocks
from tractexp.inference.noise_in_quiet import assume_residual_noise
from tractexp.inference.wide_fit import refit_sets_widely
from tractexp.noise import Noise

MOST_TRIED_FAMILIES = 2  # single effects whose families are tried, and to which a second is added
BEST_SINGLES = 4  # single effects that predict best, of which all pairs are tried
CARRIED = 12  # sets of the search by likelihood that are fitted again
# blocks that share the response: where two or three hold all of it, nothing is clear of chance
SHARING = 10.0


def predict_held_out(explained: Explanations, grader: Grader, seed: int) -> Evidence | None:
    """The table of all sets by what they predict: those kept first, or else the nearest, with their
    tests, then the others. None where noise hides so much of the base model's error there that no
    set could divide it by as much as a name must.
    """
    explained.base.context.effort.say("judging what leaves something on the held-out events")
    table = predict_errors(explained, grader)
    if table is None:
        return None
    criteria = explained.last.criteria
    quiet = explained.base.quiet
    noise = table.noise
    assert noise is not None
    leading = find_predicting(table, criteria) or [find_nearest(table, criteria)]

    def test(row: SetEvidence) -> SetEvidence:
        tests = examine_least_squares(quiet, row.fit, noise, seed)
        return replace(row, tests=tests, p_left=tests.p_left)

    base = test(table.base)
    tested = [test(row) for row in leading]
    rest = [row for row in rank_sets(table, criteria) if row not in leading]
    others = [row for row in table.rows if row not in (*leading, *rest)]
    first = tested[0] if leading[0].fit.names else base
    rows = (*(row for row in tested if row.fit.names), *rest)
    return replace(table, base=base, rows=rows, others=tuple(others), last=first.tests)


def predict_errors(explained: Explanations, grader: Grader) -> Evidence | None:
    """The table of single effects, of sets of two, of a third beside the best two, and of what the
    search by likelihood ended with, by the model's error on the held-out events. The powers before
    events are those measured, as in an identification, and the base model is as that estimates it.
    Of the base model alone where it leaves less than matters. None as of `predict_held_out`.
    """
    plain = explained.base.context.with_measured_power
    context = plain.held_to_usual
    noise = assume_residual_noise(plain, explained.chosen)
    criteria = context.criteria
    family = context.catalogue.textbook
    bare = fit_as_graded(context, noise, grader.grade((), context.window))
    if context.prior:  # its rows stand beside what the base model leaves, as in an identification
        noise = assume_residual_noise(plain, bare)
    there = context.move_to_events(grader.validate)

    def fill(fits: Sequence[Refit]) -> list[SetEvidence]:
        predicted = map_on_cores(functools.partial(predict, there), fits, context.effort)
        return [
            SetEvidence(fit, fit.names, family(fit.names), prediction=one)
            for fit, one in zip(fits, predicted, strict=True)
        ]

    def complete(table: Evidence, best: Sequence[SetEvidence]) -> Evidence:
        missing = _find_missing_subsets(table, best)
        fits = refit(context, noise, missing, faults=())
        return replace(table, rows=(*table.rows, *fill(fits)))

    (alone,) = fill([bare])
    alone = replace(alone, fitted_error=predict(context, bare))
    if alone.is_slight:
        return Evidence(alone, (), noise=noise, there=there)
    if alone.held_out_prediction.largest_factor <= criteria.divides:
        return None
    ground, refits = _search_all_sets(context, explained, noise, bare)
    sets = [fit for fit in refits.values() if fit.names]
    rows = fill(_fit_without_faults(context, noise, sets))
    table = Evidence(alone, tuple(rows), noise=noise, there=there)
    pairs = search_best_pairs(ground, refits, rank_sets(table, criteria))
    refits |= key_by_names(pairs)
    table = replace(table, rows=(*rows, *fill(_fit_without_faults(context, noise, pairs))))
    best = rank_sets(table, criteria)[:1]
    table = complete(table, best)
    if further := search_third(ground, refits, best):
        rows = fill(_fit_without_faults(context, noise, further))
        table = complete(replace(table, rows=(*table.rows, *rows)), rows)
    if not find_predicting(table, criteria):
        return table
    return replace(table, term=_find_best_term(context, table))


def search_best_pairs(
    ground: Disagreement, refits: dict[Names, Refit], ranked: Sequence[SetEvidence]
) -> list[Refit]:
    """All pairs of the single effects of the load that predict best: a search by what fits best may
    pass them over.
    """
    context = ground.context
    of_load = context.catalogue.of_load
    singles = [row for row in ranked if len(row.family) == 1 and row.family[0] in of_load]
    names = [name for row in singles[:BEST_SINGLES] for name in row.fit.names]
    pairs = [tuple(sorted(pair)) for pair in itertools.combinations(names, 2)]
    wanted = [pair for pair in pairs if pair not in refits]
    begin = [start for pair in wanted for start in list_starts([ground], refits, pair)]
    if not begin:
        return []
    _say(context)("refitting sets of the effects that predict best")
    return refit_sets(context, ground.noise, begin)


def _find_missing_subsets(
    table: Evidence, best: Sequence[SetEvidence]
) -> list[tuple[Names, np.ndarray]]:
    """Subsets of the best set that were not fitted, each with where to start."""
    subsets = [
        (s, row.fit.unit)
        for row in best
        for k in range(1, len(row.fit.names))
        for s in itertools.combinations(row.fit.names, k)
    ]
    return [(names, unit) for names, unit in subsets if table.row_of(names) is None]


def _find_best_term(context: Context, table: Evidence) -> SetEvidence:
    """The term of the library that predicts best beside the base model, fitted as the sets are
    whose rival it is.
    """
    noise = table.noise
    there = table.there
    assert noise is not None
    assert there is not None
    context.effort.say("looking for a term of the library that predicts better")
    under = build_term_context(context).with_measured_power.held_to_usual
    ground = ScreeningFit.from_coordinates(
        under, carry_over(under, context, table.base.fit.unit), noise
    )
    found = fit_terms(ground, screen_terms(ground, list_terms()), [])
    best = _fit_without_faults(found.context, noise, found.fits[:MOST_JUDGED_TERMS])
    beside = found.context.move_to_records(there.records)
    rows = [SetEvidence(fit, fit.names, fit.names, prediction=predict(beside, fit)) for fit in best]
    return min(rows, key=lambda row: (row.held_out_prediction.excess, row.names))


def search_third(
    ground: Disagreement, refits: dict[Names, Refit], best: Sequence[SetEvidence]
) -> list[Refit]:
    """A third effect beside two that predict best, from where these fit; none where they leave no
    more of the held-out events than anyone cares about.

    Two weak ones beside a strong one may show together only.
    """
    context = ground.context
    if not best or len(best[0].fit.names) < MOST_NAMED:
        return []
    pair = refits.get(best[0].fit.names, best[0].fit)
    families = context.catalogue.textbook(pair.names)
    of_load = context.catalogue.of_load
    if best[0].held_out_prediction.error < SLIGHT_ERROR or not {*families} <= {*of_load}:
        return []
    beside = ground.score_fit(context, pair, ground.noise)
    return search_effect_sets([ground, beside], refits, len(pair.names) + 1, _say(context))


def _fit_without_faults(context: Context, noise: Noise, fits: Iterable[Refit]) -> list[Refit]:
    """Sets as they fit without the faults of the measurement, which are free while sets are looked
    for.
    """
    at = context.coordinates
    wanted = [(fit.names, at.without_faults(fit.unit, ())) for fit in fits]
    return refit(context, noise, wanted, faults=())


def _say(context: Context) -> Callable[[str], None]:
    """Tells what is done, and how."""
    return lambda line: context.effort.say(f"{line}, by least squares")


def _search_all_sets(
    context: Context, explained: Explanations, noise: Noise, bare: Refit
) -> tuple[Disagreement, dict[Names, Refit]]:
    """The tests of the base model by least squares, and the best fits of it and of sets of effects,
    with the faults of the measurement free: from where it fits without them, too.
    """
    at = context.coordinates
    say = _say(context)
    known = explained.steps[0].fit.unit, *explained.base.local_minima
    starts = [bare.unit, *map(at.at_measured_power, known)]
    bare = refit(context, noise, [((), start) for start in starts])[0]
    ground = explained.steps[0].score_fit(context, bare, noise)
    refits: dict[Names, Refit] = {(): bare}

    def add(fits: Iterable[Refit]) -> None:
        refits.update(key_by_names(select_best_fits([*refits.values(), *fits])))

    add(search_effect_sets([ground], refits, 1, say))
    add(refit_sets_widely(context, noise, list_wide_starts(context, bare.unit, refits), WIDELY))
    carried = sorted((f for f in explained.refits.values() if f.names), key=lambda f: f.cost)[
        :CARRIED
    ]
    if carried:
        add(refit(context, noise, [(f.names, at.at_measured_power(f.unit)) for f in carried]))
    singles = [f for f in select_best_fits(refits.values()) if len(f.names) == 1]
    of_family = {context.catalogue.textbook(f.names)[0] for f in singles[:MOST_TRIED_FAMILIES]}
    add(fit_members(context, noise, refits, of_family))
    for single in select_grounds(context.catalogue, refits.values()):
        add(search_effect_sets([ground, ground.score_fit(context, single, noise)], refits, 2, say))
    return ground, refits


def select_grounds(catalogue: Catalogue, refits: Iterable[Refit]) -> list[Refit]:
    """The single effects of the load beside which a second is sought: of the families that fit
    best, each by the law that fits best. A weaker effect shows beside the right law of a stronger.
    """
    grounds: dict[str, Refit] = {}
    for fit in select_best_fits(refits):
        family = catalogue.textbook(fit.names)
        if len(family) == 1 and family[0] in catalogue.of_load:
            grounds.setdefault(family[0], fit)
    return [*grounds.values()][:MOST_TRIED_FAMILIES]


def predict(there: Context, fit: Refit) -> PredictedError:
    """What a fit leaves of other events."""
    unit = there.coordinates.at_measured_power(fit.unit)
    played = there.cut_playbacks(there.calculate(unit, fit.names))
    left = []
    noise = []
    response = []
    for one, sums in zip(played, sum_blocks(played, SHARING), strict=True):
        own = (
            estimate_noise_variance(one.event)
            * (one.event.record.samples - one.event.start)
            / len(sums)
        )
        known = sums[:, 0] + own
        with np.errstate(over="ignore"):
            # without a steady state, and of a load that diverges, all is left, too
            lost = one.stalls or not np.isfinite(known.sum())
        left.append(np.full(len(sums), np.inf) if lost else known)
        noise.append(np.full(len(sums), own))
        response.append(sums[:, 1])
    stalls = tuple(one.event.record.name for one in played if one.stalls)
    return PredictedError(
        np.concatenate(left), np.concatenate(noise), np.concatenate(response), unit, stalls
    )
