"""What it comes to: none, named, tied or unexplained, and the sentence behind it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.gap import Curves, closed, curves
from tractexp.discrepancy.held_out import HeldOut, carried
from tractexp.discrepancy.next_event.choose import NextEvent, next_event
from tractexp.discrepancy.prediction import ErrorPredictions, PredictionError
from tractexp.discrepancy.survivors import Rival
from tractexp.inference.chance import by_draws
from tractexp.inference.model_error import in_percent
from tractexp.record import Event
from tractexp.wording import alternatives, joined, listed, percent

CHOSEN_BY = "what is left is more than noise, and the held-out events were used to choose"
NONE, NAMED, TIED, UNEXPLAINED = "none", "named", "tied", "unexplained"


@dataclass(frozen=True, eq=False)
class Nearest:
    """Where nothing explains the disagreement: the set that comes nearest, and what it leaves."""

    rival: Rival
    others: list[tuple[tuple[str, ...], float]]  # the next ones, and what share of the gap they close on fitted events
    curves: tuple[Curves, Curves]  # of the base model and with these, on the fitted events
    carried: tuple[Curves, Curves] | None  # on the held-out ones

    @property
    def names(self) -> tuple[str, ...]:
        return self.rival.fit.names

    @property
    def closed(self) -> tuple[float, float]:
        """The share of the gap that is closed on the fitted and on the held-out events, nan without any."""
        return closed(*self.curves), closed(*self.carried) if self.carried else np.nan


@dataclass(frozen=True, eq=False)
class Verdict:
    """One of four words, the sentence behind it, and what belongs to it.

    `names` are the effects added, `sets` all sets not rejected, `chosen` the set that the extended model has, None
    without one. It is `complete` where nothing but noise is left.
    """

    word: str
    reason: str
    names: tuple[str, ...]
    sets: tuple[tuple[str, ...], ...]
    chosen: Rival | None
    next_event: NextEvent | None  # that would tell tied sets apart
    nearest: Nearest | None  # where nothing explains
    complete: bool


def verdict(outcome: HeldOut, validate: Sequence[Event]) -> Verdict:
    left = outcome.survivors
    explained = left.explanations
    context = explained.base.context
    word = word_of(outcome)
    nearest = _nearest(outcome, validate) if word == UNEXPLAINED else None
    sets = tuple(map(outcome.names_of, outcome.retained)) if word in (NAMED, TIED) else ()
    reason = _reason(word, outcome, sets, nearest)
    judged = [outcome.assessments[r.fit.names].gap for r in outcome.retained if r.fit.names in outcome.assessments]
    if sets and judged and all(there.open for there in judged):
        reason += "; the held-out events are too mild to show it"
    if outcome.together and outcome.retained:
        reason += "; what the fitted events leave open of it was fitted to the held-out ones, too"
    if (window := context.records.window) is not None:
        reason += f"; {window.describe()}, which is taken into account"
    chosen = outcome.retained[0] if sets else None
    at = outcome.first if chosen is None else chosen.tests or outcome.last
    if at.resting:
        reason += f"; on a bound: {', '.join(at.resting)}"
    return Verdict(
        word=word,
        reason=reason,
        names=sets[0] if sets else (),
        sets=sets,
        chosen=chosen,
        next_event=_next_event(outcome, sets) if word == TIED else None,
        nearest=nearest,
        complete=word != UNEXPLAINED and not outcome.leaves_more,
    )


def _next_event(outcome: HeldOut, sets: Sequence[Sequence[str]]) -> NextEvent:
    """What to record to tell all explanations apart that are kept."""
    context = outcome.survivors.explanations.base.context
    fits = [outcome.extended.get(rival.fit.names, rival.fit) for rival in outcome.retained]
    labels = [joined(_spoken(names, outcome)) for names in sets]
    return next_event(context, outcome.noise, outcome.bare, fits, labels)


def word_of(outcome: HeldOut) -> str:
    left = outcome.survivors
    explaining = [rival for rival in outcome.retained if outcome.names_of(rival)]
    if not explaining:
        first = left.explanations.steps[0]
        agree = first.adequate and left.adequate and not outcome.shows_more
        return NONE if agree else UNEXPLAINED
    return NAMED if len(explaining) == 1 else TIED


def _spoken(names: Sequence[str], outcome: HeldOut) -> list[str]:
    """Effects as a sentence tells them: by the names of the catalogue, and what differs from its law or place."""
    catalogue = outcome.survivors.explanations.base.context.catalogue
    return [catalogue.spoken(name) for name in names]


def _reason(word: str, outcome: HeldOut, sets: Sequence[Sequence[str]], nearest: Nearest | None) -> str:
    left = outcome.survivors
    first = left.explanations.steps[0]
    if outcome.leaves_more:
        return _by_size(outcome, sets) if sets else _too_far_off(outcome)
    if word == NAMED:
        return _named(_spoken(sets[0], outcome), len(first.context.catalogue.candidates), _fitted(outcome, sets[0]))
    if word == TIED:
        return _tied([_spoken(names, outcome) for names in sets])
    if word == UNEXPLAINED and not left.adequate:
        return _unexplained(outcome, nearest)
    if not outcome.retained and left.adequate and not left.explanations.empty:
        seemed = " or ".join(joined(_spoken(outcome.names_of(s), outcome)) for s in left.adequate)
        if word == UNEXPLAINED:
            return (
                f"what explains the fitted events, {seemed}, is not borne out by the held-out ones: {_denied(outcome)}"
            )
        return (
            f"what seemed to help on the fitted events, {seemed}, is not borne out by the held-out ones, and what the"
            " base model leaves is no more than chance leaves"
        )
    if word == UNEXPLAINED:
        return "the fitted events alone show no disagreement, but all events together do"
    return f"no disagreement above the noise, at a false-alarm rate of {first.criteria.false_alarms:.0%}"


def _fitted(outcome: HeldOut, names: Sequence[str]) -> int:
    """How many other sets of so many effects were fitted."""
    sets = {r.fit.names for r in outcome.survivors.rivals if len(r.fit.names) == len(names)}
    return len(sets - {tuple(names)})


def _named(names: Sequence[str], tested: int, fitted: int) -> str:
    if len(names) > 1:
        rest = f"none of the {fitted} other sets of {len(names)} that were fitted does" if fitted else ""
        return f"{joined(names)} explain the disagreement{', and ' * bool(rest)}{rest}"
    rest = f"none of the {tested - 1} other effects tested does" if tested > 1 else "no other effect was tested"
    return f"{names[0]}{',' * (', ' in names[0])} explains the disagreement, and {rest}"


def _by_deviance(outcome: HeldOut, sets: Sequence[Sequence[str]]) -> str:
    """What the sets explain on the held-out events, and what became of the others."""
    shares = listed([outcome.assessments[tuple(names)].gap.explained for names in sets], percent)
    spoken = alternatives([_spoken(names, outcome) for names in sets])
    others = sum(bool(r.rejected) for r in outcome.survivors.rivals)
    other = "the other set of its size is" if others == 1 else f"the {others} other sets of its size are"
    rest = f", and {other} rejected" * (len(sets) == 1 and others > 0)
    verb = "explains" if len(sets) == 1 and len(sets[0]) == 1 else "explain"
    tie = ", and these events cannot tell them apart" * (len(sets) > 1)
    return f"{spoken} {verb} {shares} of what exceeds the noise on the held-out events{rest}{tie}; {CHOSEN_BY}"


def _by_size(outcome: HeldOut, sets: Sequence[Sequence[str]]) -> str:
    """How far the sets that predict best, the base model and the next set are off on the held-out events."""
    predicted = outcome.predictions
    if not isinstance(predicted, ErrorPredictions):
        return _by_deviance(outcome, sets)
    chosen = [predicted.sets[tuple(names)] for names in sets]
    size = len(chosen[0].names)
    ranked = predicted.ranked(size, predicted.context.criteria.ahead)
    rest = [p for p in ranked if p.names not in sets and p.left > chosen[0].left]  # what leaves less does so by chance
    off = listed([p.error for p in chosen], in_percent)
    worse = [f"the base model misses {in_percent(predicted.bare.error)}"]
    if rest:
        following = joined(_spoken(rest[0].names, outcome))
        worse.append(f"the next best of {len(rest)} other sets ({following}) {in_percent(rest[0].error)}")
    worse.append(_term(predicted))
    spoken = alternatives([_spoken(names, outcome) for names in sets])
    if len(sets) > 1:
        sentence = (
            f"{spoken}: they predict the held-out events within {off} of the response, which cannot tell them apart"
        )
    else:
        sentence = f"{spoken} predict{'s' * (size == 1)} the held-out events within {off} of the response"
    return f"{sentence}, where {joined(worse)}{_shared(outcome, predicted, chosen[0])}; {CHOSEN_BY}"


def _shared(outcome: HeldOut, predicted: ErrorPredictions, chosen: PredictionError) -> str:
    """Of a name that does not divide the error by as much as names must: what the best of all sets misses, which has
    it, as the end of a sentence."""
    if chosen.divides(predicted.bare, predicted.context.criteria.divides):
        return ""
    best = min(predicted.sets.values(), key=lambda one: one.left)
    spoken = joined(_spoken(best.names, outcome))
    return f"; {spoken} miss {in_percent(best.error)}, the least, and all sets that come near have it"


def _tied(sets: Sequence[Sequence[str]]) -> str:
    """Several explanations, told as the alternatives they are."""
    each = "either" if len(sets) == 2 else "each"
    return f"{alternatives(sets)}: {each} explains the disagreement, and these events cannot tell them apart"


def _unexplained(outcome: HeldOut, nearest: Nearest | None) -> str:
    """What was tried, how far the nearest of it gets, and what stands out in what it leaves."""
    best, explained = outcome.survivors.retained[0], outcome.survivors.explanations
    assert best.tests is not None
    chance = f"would come about by chance with a probability of {by_draws(best.tests.p_left)}"
    loudest = f"the most surprised of the tests looks for {best.tests.loudest}"
    if nearest is None and not explained.faults:
        return f"{_none(outcome)} helps more than chance does: what the base model leaves {chance}; {loudest}"
    names, faults = _spoken(best.fit.names, outcome), _spoken(outcome.faults, outcome)
    sentence = f"{joined(names)} beside {joined(faults)}" if names and faults else joined(names or faults)
    one = len(names or faults) == 1
    share = f"help{'s' * one}"
    if nearest and np.isfinite(nearest.closed[0]):
        share = f"close{'s' * one} {nearest.closed[0]:.0%} of the gap"
    none = f"{_none(outcome, len(best.fit.names))} explains it all"
    return f"{none}: {sentence}, the nearest, {share}, but what is left {chance}; {loudest}"


def _too_far_off(outcome: HeldOut) -> str:
    """How far the set that predicts the held-out events best is from dividing what the base model leaves of them."""
    predicted, rivals = outcome.predictions, outcome.survivors.rivals
    assert isinstance(predicted, ErrorPredictions)
    bare, criteria = in_percent(predicted.bare.error), predicted.context.criteria
    if not rivals[0].fit.names:
        better = "predicts the held-out events better than the base model"
        return f"{_none(outcome)} {better}, which misses {bare} of the response there"
    if beaten := predicted.beaten(criteria):
        name, off = joined(_spoken(beaten[0].names, outcome)), in_percent(beaten[0].error)
        return f"{name} would be named, but misses {off} of the response of the held-out events, and {_term(predicted)}"
    near = predicted.sets[rivals[0].fit.names]
    spoken, off = joined(_spoken(near.names, outcome)), in_percent(near.error)
    why = f"a name must divide that by {criteria.divides:g}"
    if near.divides(predicted.bare, criteria.divides):
        needed = predicted.needs_all(near, criteria)
        why = "that may be chance in so few blocks" if needed else "one of them alone does hardly worse"
    none = f"{_none(outcome, len(near.names))} predicts the held-out events well enough to be named"
    misses = f"miss{'es' * (len(near.names) == 1)} {off} of the response there"
    return f"{none}: {spoken}, the nearest, {misses}, where the base model misses {bare}; {why}"


def _term(predicted: ErrorPredictions) -> str:
    """What the best term is, and how far it is off, as the end of a sentence."""
    assert predicted.term is not None
    return f"the best term of the library ({predicted.term.words}) {in_percent(predicted.term.error)}"


def _none(outcome: HeldOut, most: int = 1) -> str:
    """How a sentence begins that says what no effect does, nor a set of so many where the nearest is one."""
    tested = len(outcome.first.context.catalogue.candidates)
    together = f", alone or up to {most} together," * (most > 1)
    return f"the model and the records disagree, and none of the {tested} effects tested{together}"


def _denied(outcome: HeldOut) -> str:
    """What the held-out events have against the best explanation of the fitted ones."""
    assessment = outcome.assessments[outcome.survivors.adequate[0].fit.names]
    there = assessment.gap
    if not assessment.evident:
        if there.open:
            return "they are too mild to show it, and the fitted ones leave a doubt"
        return "there it fits no better than the base model"
    if assessment.needless:
        return f"there it fits no better than without {joined(_spoken(assessment.needless, outcome), 'or')}"
    return (
        "what a fit to all events together leaves would come about by chance with a probability of"
        f" {by_draws(assessment.p_left)}"
    )


def _nearest(outcome: HeldOut, validate: Sequence[Event]) -> Nearest | None:
    """The best of the sets that were compared; None where that is the base model."""
    rivals, context = outcome.survivors.rivals[:4], outcome.first.context
    if not rivals[0].fit.names:
        return None
    fits = [outcome.bare, *(r.fit for r in rivals)]
    before, *after = (curves(context, f.unit, outcome.last.noise, f.names) for f in fits)
    there = None
    if validate:
        other, units, noise = carried(context, validate, fits[:2])
        pair = curves(other, units[0], noise), curves(other, units[1], noise, fits[1].names)
        there = pair if np.isfinite([one.deviance for one in pair]).all() else None  # else no steady state there
    others = [(r.fit.names, closed(before, one)) for r, one in zip(rivals[1:], after[1:], strict=True)]
    return Nearest(rivals[0], others, (before, after[0]), there)
