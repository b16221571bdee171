"""Explanations that leave more than noise, where none leaves less: named by what they predict of
held-out events.

What is left has two measures. Where the disagreement is of the noise's size it is what
perturbations of the balances would still gain of the deviance, with the fits of the search by
likelihood. Where it is far above the noise it is the squared error in S, with every set fitted by
least squares (`least_squares`).
"""

from collections.abc import Sequence
from dataclasses import replace

from tractexp.discrepancy.decide import find_predicting
from tractexp.discrepancy.disagreement import examine_fit
from tractexp.discrepancy.evidence import Evidence, PredictedDeviance, SetEvidence
from tractexp.discrepancy.explanations import Explanations
from tractexp.discrepancy.gap import curves
from tractexp.discrepancy.held_out import carry_fits, compare_on
from tractexp.discrepancy.least_squares import least_squares_tests
from tractexp.discrepancy.prediction import predict_errors
from tractexp.discrepancy.ranking import find_nearest, rank_sets
from tractexp.inference.fitting import refit
from tractexp.record import Event

MOST_JUDGED_SETS = 10  # sets of the search by likelihood that are judged on the held-out events
# deviance of a sample from which what the base model leaves is more of it than the noise
LEAST_LOUD_DEVIANCE = 2.0


def predict_held_out(
    evidence: Evidence, explained: Explanations, events: Sequence[Event], seed: int
) -> Evidence:
    """The table with what each set predicts of the held-out events; as it is without any, since a
    larger set always fits better what it was fitted to. Where what is left is loud, all sets are as
    least squares fit them.
    """
    if not events:
        return evidence
    context = explained.base.context
    context.effort.say("judging what leaves something on the held-out events")
    there, (unit,), noise = carry_fits(context, events, [evidence.base.fit])
    if curves(there, unit, noise).chi2_per_sample > LEAST_LOUD_DEVIANCE:
        return _predict_by_error(explained, events, seed)
    return _predict_by_deviance(evidence, explained, events, seed)


def _predict_by_deviance(
    evidence: Evidence, explained: Explanations, events: Sequence[Event], seed: int
) -> Evidence:
    """The single effects of the search by likelihood, and the larger sets that the fitted events do
    not reject.

    None beside faults of the measurement, which what is missing looks like.
    """
    noise, context, bare = explained.last.noise, explained.base.context, evidence.base.fit
    criteria = context.criteria
    at = context.coordinates
    known = {row.fit.names: row for row in evidence.rows}
    rejected = {names for names, row in known.items() if criteria.rejects(row.behind)}
    fits = {
        names: fit
        for names, fit in explained.refits.items()
        if names and (len(names) == 1 or names in known.keys() - rejected)
    }
    if evidence.faults or not fits:
        return evidence
    wanted = sorted(fits.values(), key=lambda fit: fit.cost)[:MOST_JUDGED_SETS]
    fitted = refit(
        context, noise, [(fit.names, at.without_faults(fit.unit, ())) for fit in wanted], faults=()
    )
    gaps = compare_on(context, events, bare, fitted[::-1])  # the best last: there the noise is its
    whole = max((gaps[fit.names] for fit in fitted), key=lambda gap: gap.gain)
    left_by_base = whole.gain + max(whole.left, 0.0)
    base = replace(
        evidence.base,
        prediction=PredictedDeviance(left_by_base, whole.before, True, criteria.shown),
    )
    rows = []
    for fit in fitted:
        gap = gaps[fit.names]
        is_rejected = fit.names in rejected
        one = PredictedDeviance(gap.left, gap.after, is_rejected, criteria.shown)
        behind = known[fit.names].behind if fit.names in known else 0.0
        lowered = bare.deviance - fit.deviance
        family = context.catalogue.textbook(fit.names)
        rows.append(SetEvidence(fit, fit.names, family, lowered, behind, gap=gap, prediction=one))
    kept = find_predicting(replace(evidence, base=base, rows=tuple(rows)), criteria)
    if not kept:
        return evidence

    def test(row: SetEvidence) -> SetEvidence:
        tests = examine_fit(explained.base.quiet, row.fit, noise, seed, plain=True)
        return replace(row, tests=tests, p_left=tests.p_left)

    tested = [test(row) for row in kept]
    names = {row.fit.names for row in kept}
    compared = [row for row in evidence.rows if row.fit.names not in names]
    others = [
        row for row in rows if row.fit.names not in names | {row.fit.names for row in compared}
    ]
    predicted = {row.fit.names: row for row in rows}
    compared = [
        replace(
            row, fit=predicted[row.fit.names].fit, prediction=predicted[row.fit.names].prediction
        )
        if row.fit.names in predicted
        else row
        for row in compared
    ]
    return replace(evidence, base=base, rows=(*tested, *compared), others=tuple(others))


def _predict_by_error(explained: Explanations, events: Sequence[Event], seed: int) -> Evidence:
    """All sets as least squares fit them: those kept first, or else the nearest, with their tests,
    then the others.
    """
    table = predict_errors(explained, events)
    criteria, quiet, noise = explained.last.criteria, explained.base.quiet, table.noise
    assert noise is not None
    leading = find_predicting(table, criteria) or [find_nearest(table, criteria)]

    def test(row: SetEvidence) -> SetEvidence:
        tests = least_squares_tests(quiet, row.fit, noise, seed)
        return replace(row, tests=tests, p_left=tests.p_left)

    base = test(table.base)
    tested = [test(row) for row in leading]
    rest = [row for row in rank_sets(table, criteria) if row not in leading]
    others = [row for row in table.rows if row not in (*leading, *rest)]
    first = tested[0] if leading[0].fit.names else base
    rows = (*(row for row in tested if row.fit.names), *rest)
    return replace(table, base=base, rows=rows, others=tuple(others), last=first.tests)
