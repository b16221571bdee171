"""Explanations that leave more than noise, where none leaves less: named by what they predict of held-out events."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.discrepancy.disagreement import examined
from tractexp.discrepancy.explanations import Names
from tractexp.discrepancy.gap import Curves, curves, gap
from tractexp.discrepancy.held_out import Assessment, HeldOut, carried, judged_on
from tractexp.discrepancy.least_squares import least_squares_tests
from tractexp.discrepancy.prediction import (
    Prediction,
    PredictionError,
    Predictions,
    predictions,
)  # fmt: skip
from tractexp.discrepancy.survivors import Rival
from tractexp.inference.fitting import Refit, refit
from tractexp.inference.noise_in_quiet import QuietNoise
from tractexp.record import Event

JUDGED = 10  # sets of the search by likelihood that are judged on the held-out events
LOUD = 2.0  # deviance of a sample from which what the base model leaves is more of it than the noise


@dataclass(frozen=True, eq=False)
class PredictedDeviance(Prediction):
    """By the deviance: what is left of it on the held-out events beyond chance, the curves there, and whether the
    fitted events reject the set. `least` is what chance may leave: no more than that is nothing.
    """

    left_over: float
    curves: Curves
    rejected: bool
    least: float

    @property
    def left(self) -> float:
        return self.left_over if self.left_over > self.least else 0.0

    @property
    def error(self) -> float:
        return self.curves.error.value

    def clear_of(self, other: Prediction) -> bool:
        assert isinstance(other, PredictedDeviance)
        gain = other.curves.deviance - self.curves.deviance
        return gain >= self.least or (other.rejected and not self.rejected)


def incomplete(outcome: HeldOut, events: Sequence[Event], seed: int) -> HeldOut:
    """The sets that predict the held-out events, if any does; what else there is stays as it was.

    None without held-out events: a larger set always fits better what it was fitted to. Where what is left is loud it
    is judged by its size, and all is told as least squares fit it, named or not; else by the deviance.
    """
    if not events:
        return outcome
    context = outcome.survivors.explanations.base.context
    context.effort.say("judging what leaves something on the held-out events")
    there, (unit,), noise = carried(context, events, [outcome.bare])
    loud = curves(there, unit, noise).chi2_per_sample > LOUD
    return (_by_size if loud else _by_deviance)(outcome, events, seed)


def _by_deviance(outcome: HeldOut, events: Sequence[Event], seed: int) -> HeldOut:
    """The single effects of the search by likelihood, and the larger sets that the fitted events do not reject.

    None beside faults of the measurement, which what is missing looks like.
    """
    surviving, noise = outcome.survivors, outcome.survivors.explanations.last.noise
    explained, context = surviving.explanations, surviving.explanations.base.context
    least = context.criteria.shown
    rejected = {r.fit.names: r.rejected for r in surviving.rivals}
    fits = {n: f for n, f in explained.refits.items() if n and (len(n) == 1 or not rejected.get(n, True))}
    if outcome.faults or not fits:
        return outcome
    wanted = sorted(fits.values(), key=lambda f: f.cost)[:JUDGED]
    unit = context.coordinates.without_faults
    fitted = refit(context, noise, [(f.names, unit(f.unit, ())) for f in wanted], faults=())
    judged = judged_on(context, events, outcome.bare, fitted[::-1])  # the best last: there the noise is its
    gaps = {f.names: judged[f.names].gap for f in fitted}
    whole = max(gaps.values(), key=lambda one: one.gain)
    sets: dict[Names, PredictedDeviance] = {
        (): PredictedDeviance(outcome.bare, whole.gain + max(whole.left, 0.0), whole.before, True, least)
    }
    for fit in fitted:
        one = gaps[fit.names]
        sets[fit.names] = PredictedDeviance(fit, one.left, one.after, bool(rejected.get(fit.names, False)), least)
    predicted = Predictions(context.catalogue, sets)
    chosen = [p.fit for p in predicted.explaining(context.criteria) if not p.rejected]
    if not chosen or not all(gaps[f.names].helps for f in chosen):
        return outcome

    def rival(fit: Refit) -> Rival:
        tests = examined(explained.base.quiet, fit, noise, seed, plain=True)
        lowered = outcome.bare.deviance - fit.deviance
        return Rival(fit, lowered, fit.cost - chosen[0].cost, rejected=False, tests=tests)

    retained = [rival(c) for c in chosen]
    others = [r for r in surviving.rivals if r.fit.names not in {f.names for f in chosen}]
    return _named(outcome, retained, others, {f.names: judged[f.names] for f in chosen}, predicted)


def _by_size(outcome: HeldOut, events: Sequence[Event], seed: int) -> HeldOut:
    """All sets as least squares fit them; retained are those that predict the held-out events best by the size of the
    model's error, none where none does."""
    explained = outcome.survivors.explanations
    criteria, quiet = explained.base.context.criteria, explained.base.quiet
    predicted = predictions(explained, events)
    there, bare, explaining = predicted.context, predicted.bare, predicted.explaining(criteria)
    leading = explaining or [predicted.nearest(criteria)]
    tests = {p.names: least_squares_tests(quiet, p.fit, predicted.noise, seed) for p in (bare, *leading)}
    rest = [p for p in predicted.ranked(max(map(len, predicted.sets)), criteria.ahead) if p not in leading]

    def rival(one: PredictionError) -> Rival:
        behind = one.fit.cost - leading[0].fit.cost
        return Rival(one.fit, np.nan, behind, one not in explaining, tests.get(one.names))

    def assessed(one: PredictionError) -> Assessment:
        left = there.residuals(one.unit[None], one.names)[0]
        noise = QuietNoise.at(there, one.unit).of(one.unit, left)
        judged = gap(there, bare.unit, one.unit, one.names, noise, there.coordinates.before)
        return Assessment(judged, there, (bare.unit, one.unit))

    rivals = [rival(p) for p in (*leading, *rest)]
    retained, others = rivals[: len(explaining)], rivals[len(explaining) :]
    outcome = replace(
        outcome, first=tests[()], last=tests[leading[0].names], noise=predicted.noise, faults=(), bare=bare.fit
    )
    return _named(outcome, retained, others, {p.names: assessed(p) for p in explaining}, predicted)


def _named(
    outcome: HeldOut, retained: Sequence[Rival], others: Sequence[Rival], assessments: Mapping[Names, Assessment],
    predicted: Predictions,
) -> HeldOut:  # fmt: skip
    """The sets retained in place of those that leave noise only."""
    surviving = replace(outcome.survivors, retained=tuple(retained), rivals=(*retained, *others))
    extended = {r.fit.names: r.fit for r in retained}
    return replace(
        outcome, survivors=surviving, extended=extended, assessments=assessments, together=(), predictions=predicted
    )
