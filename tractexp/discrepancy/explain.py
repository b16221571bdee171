"""The verdict in words: the sentence, what comes nearest where nothing explains, and what to record
next.
"""

from collections.abc import Sequence

import numpy as np

from tractexp.discrepancy.decide import (
    CANDIDATE,
    CONFIRMED_SHARE,
    NAMED,
    NONE,
    TIED,
    UNEXPLAINED,
    chose_by_all,
    find_adequate,
    is_confirmed,
    is_denied_in_turn,
)
from tractexp.discrepancy.evidence import SLIGHT_ERROR, Evidence, SetEvidence, Verdict
from tractexp.discrepancy.gap import DENIED, MILD, SHOWN
from tractexp.discrepancy.nearest import Nearest, measure_least_error
from tractexp.discrepancy.next_event.choose import NextEvent, find_next_event
from tractexp.discrepancy.proposal.library import find_term
from tractexp.discrepancy.ranking import (
    MOST_NAMED,
    compute_factor,
    find_leading,
    find_nearest,
    needs_all,
    rank_sets,
)
from tractexp.inference.chance import format_drawn_p
from tractexp.inference.context import Context
from tractexp.inference.model_error import describe_stall, format_percent
from tractexp.text.wording import join_alternatives, join_words, list_figures

CHOSEN_BY = "what is left is more than noise, and the held-out events were used to choose"
CONFIRMED_IN_TURN = "each event, left out in turn, confirms it"


def choose_next_event(verdict: Verdict, evidence: Evidence, context: Context) -> NextEvent | None:
    """What to record to tell tied sets apart."""
    if verdict.word != TIED:
        return None
    assert evidence.noise is not None
    fits = [row.reported_fit for row in verdict.kept]
    labels = [join_words(label_effects(names, context)) for names in verdict.sets]
    error = measure_least_error(verdict, evidence, context)
    return find_next_event(context, evidence.noise, evidence.base.fit, fits, labels, error=error)


def explain(
    verdict: Verdict,
    evidence: Evidence,
    nearest: Nearest | None,
    context: Context,
    *,
    all_fitted: bool = False,
) -> str:
    """The sentence behind a verdict; `all_fitted` tells whether events were fitted that were to be
    held out.
    """
    clauses = [_explain_word(verdict, evidence, nearest, context)]
    clauses += _explain_confirmation(verdict, evidence, all_fitted=all_fitted)
    if any(row.is_fitted_to_all for row in verdict.kept):
        clauses.append(
            "what the fitted events leave open of it was fitted to the held-out ones, too"
        )
    if (window := context.records.window) is not None:
        doubt = "" if window.said else ", though no record says so: ask whoever runs the recorder"
        clauses.append(f"{window.describe()}, which is taken into account{doubt}")
    tests = evidence.base.tests if verdict.chosen is None else verdict.chosen.tests or evidence.last
    if tests is not None and tests.parameters_at_bound:
        clauses.append(f"on a bound: {', '.join(tests.parameters_at_bound)}")
    return "; ".join(clauses)


def _explain_confirmation(verdict: Verdict, evidence: Evidence, *, all_fitted: bool) -> list[str]:
    """What the held-out events say of what is kept, one clause; [] where that is nothing more."""
    outcomes = {row.gap.outcome for row in verdict.kept if row.gap is not None}
    is_open = verdict.word == CANDIDATE and bool(verdict.kept[0].open_sizes)
    if outcomes == {MILD} and not is_open:
        return ["the held-out events are too mild to show it"]
    if verdict.word == NAMED and chose_by_all(verdict.kept[0], evidence):
        return [CONFIRMED_IN_TURN]
    if verdict.word == CANDIDATE:
        return [_explain_doubt(verdict.kept[0], evidence, all_fitted=all_fitted)]
    return []


def _explain_word(
    verdict: Verdict, evidence: Evidence, nearest: Nearest | None, context: Context
) -> str:
    """Why the verdict is what it is, in a sentence."""
    sets = verdict.sets
    if evidence.is_predicted:
        if verdict.word == NONE:
            return _explain_slight(evidence.base)
        if not sets:
            return explain_distance(evidence, context)
        return describe_prediction(verdict, evidence, context)
    if verdict.word in (NAMED, CANDIDATE):
        return _describe_name(sets[0], evidence, context)
    if verdict.word == TIED:
        return _describe_tie([label_effects(names, context) for names in sets])
    return _explain_none(verdict, evidence, nearest, context)


def _explain_none(
    verdict: Verdict, evidence: Evidence, nearest: Nearest | None, context: Context
) -> str:
    """Why nothing is named where sets go by their likelihood, in a sentence."""
    adequate = find_adequate(evidence, context.criteria)
    if verdict.word == UNEXPLAINED and not adequate:
        return explain_rest(evidence, nearest, context)
    if adequate and (evidence.rows[0].fit.names or evidence.faults):
        seemed = " or ".join(join_words(label_effects(row.names, context)) for row in adequate)
        return _explain_denial(verdict.word, seemed, adequate[0], context)
    if verdict.word == UNEXPLAINED:
        return "the fitted events alone show no disagreement, but all events together do"
    return (
        "no disagreement above the noise, at a false-alarm rate of"
        f" {context.criteria.false_alarms:.0%}"
    )


def _explain_slight(base: SetEvidence) -> str:
    """How little the base model leaves, though more than noise."""
    assert base.fitted_error is not None
    return (
        f"the base model misses {format_percent(base.fitted_error.error)} of the response of the"
        f" fitted events and {_format_error(base)} of the held-out ones: more than noise, but no"
        f" effect is sought in less than {SLIGHT_ERROR:.0%}"
    )


def _explain_doubt(row: SetEvidence, evidence: Evidence, *, all_fitted: bool) -> str:
    """Why a set that is kept alone is a candidate and no name."""
    if row.open_sizes:
        return f"{'; '.join(row.open_sizes)}: so it is no name"
    if len(row.fit.names) > MOST_NAMED:
        return f"more than {MOST_NAMED} effects together are no name: chance finds such sets, too"
    if is_confirmed(row, evidence):
        return "the model with it does not describe this load, so it is no name"
    if not chose_by_all(row, evidence):
        doubtful = [name for name, gap in row.without.items() if gap.outcome != SHOWN]
        return f"the held-out events are too mild to show {join_words(doubtful)}"
    if evidence.is_predicted:
        why = "the held-out events took part in choosing it"
    elif all_fitted or row.is_fitted_to_all:
        why = "only all events together show it, so all were fitted"
    else:
        why = "no event was held out to confirm it"
        if row.replicated_share is None:
            return why
    return f"{why}, and {explain_replication(row.replicated_share)}"


def explain_replication(replicated: float | None) -> str:
    """Why events that are left out in turn do not confirm a set."""
    if replicated is None:
        return "none is left to confirm it"
    if np.isnan(replicated):
        return "no event by itself, left out, shows more of it than noise hides"
    return (
        f"of what an event shows of it {max(replicated, 0.0):.0%} is left where that is not fitted:"
        f" {CONFIRMED_SHARE:.0%} of each confirms it"
    )


def label_effects(names: Sequence[str], context: Context) -> list[str]:
    """Effects as a sentence tells them: by the names of the catalogue, and what differs from its
    law or place.
    """
    return [context.catalogue.label_effect(name) for name in names]


def name_subject(names: Sequence[str], context: Context) -> str:
    """Effects before a verb: behind one that says what differs stands a comma."""
    labels = label_effects(names, context)
    comma = "," if ", " in labels[-1] else ""
    return f"{join_words(labels)}{comma}"


def _describe_name(names: Sequence[str], evidence: Evidence, context: Context) -> str:
    """What explains the disagreement, and what it was set against."""
    labels = label_effects(names, context)
    if len(labels) > 1:
        sets = {row.fit.names for row in evidence.rows if len(row.fit.names) == len(names)}
        fitted = len(sets - {tuple(names)})
        sentence = f"{join_words(labels)} explain the disagreement"
        return (
            f"{sentence}, and none of the {fitted} other sets of {len(names)} that were fitted does"
            if fitted
            else sentence
        )
    tested = len(context.catalogue.candidates)
    rest = (
        f"none of the {tested - 1} other effects tested does"
        if tested > 1
        else "no other effect was tested"
    )
    return f"{name_subject(names, context)} explains the disagreement, and {rest}"


def _describe_tie(sets: Sequence[Sequence[str]]) -> str:
    """Several explanations, told as the alternatives they are."""
    each = "either" if len(sets) == 2 else "each"
    return (
        f"{join_alternatives(sets)}: {each} explains the disagreement,"
        " and these events cannot tell them apart"
    )


def describe_prediction(verdict: Verdict, evidence: Evidence, context: Context) -> str:
    """How far the sets that predict best, the base model and the next set are off on the held-out
    events.
    """
    chosen = verdict.kept
    first = chosen[0]
    size = len(first.fit.names)
    most = first.held_out_prediction.excess
    rest = [
        row
        for row in rank_sets(evidence, context.criteria)
        if len(row.fit.names) <= size
        and row not in chosen
        and row.held_out_prediction.excess > most
    ]  # what leaves less does so by chance
    worse = [f"the base model misses {_format_error(evidence.base)}"]
    if rest:
        following = join_words(label_effects(rest[0].names, context))
        worse.append(
            f"the next best of {len(rest)} other sets ({following}) {_format_error(rest[0])}"
        )
    worse.append(_describe_term(evidence))
    labels = join_alternatives([label_effects(names, context) for names in verdict.sets])
    off = list_figures([row.held_out_prediction.error for row in chosen], format_percent)
    if len(chosen) > 1:
        sentence = (
            f"{labels}: they predict the held-out events within {off} of the response, which cannot"
            " tell them apart"
        )
    else:
        sentence = (
            f"{labels} {'predicts' if size == 1 else 'predict'} the held-out events within {off} of"
            " the response"
        )
    return (
        f"{sentence}, where {join_words(worse)}{_describe_shared(first, evidence, context)};"
        f" {CHOSEN_BY}"
    )


def _describe_shared(chosen: SetEvidence, evidence: Evidence, context: Context) -> str:
    """Of a name that does not divide the error by as much as names must: what the best of all sets
    misses, which has it, as the end of a sentence.
    """
    if compute_factor(chosen, evidence.base) > context.criteria.divides:
        return ""
    best = min(evidence.every, key=lambda row: row.held_out_prediction.excess)
    labels = join_words(label_effects(best.names, context))
    return f"; {labels} miss {_format_error(best)}, the least, and all sets that come near have it"


def explain_rest(evidence: Evidence, nearest: Nearest | None, context: Context) -> str:
    """What was tried, how far the nearest of it gets, and what stands out in what it leaves."""
    best = evidence.rows[0]
    assert best.tests is not None
    chance = f"would come about by chance with a probability of {format_drawn_p(best.p_left)}"
    loudest = f"the most surprised of the tests looks for {best.tests.loudest}"
    if nearest is None and not evidence.faults:
        return (
            f"{_deny_all(context)} helps more than chance does: what the base model leaves"
            f" {chance}; {loudest}"
        )
    names = label_effects(best.fit.names, context)
    faults = label_effects(evidence.faults, context)
    sentence = (
        f"{join_words(names)} beside {join_words(faults)}"
        if names and faults
        else join_words(names or faults)
    )
    ending = "s" if len(names or faults) == 1 else ""
    share = f"help{ending}"
    if nearest and np.isfinite(nearest.closed_shares[0]):
        share = f"close{ending} {nearest.closed_shares[0]:.0%} of the gap"
    none = f"{_deny_all(context, len(best.fit.names))} explains it all"
    return f"{none}: {sentence}, the nearest, {share}, but what is left {chance}; {loudest}"


def explain_distance(evidence: Evidence, context: Context) -> str:
    """How far the set that predicts the held-out events best is from dividing what the base model
    leaves of them.
    """
    criteria = context.criteria
    bare = _format_error(evidence.base)
    near = find_nearest(evidence, criteria)
    if not near.fit.names:
        better = "predicts the held-out events better than the base model"
        return f"{_deny_all(context)} {better}, which misses {bare} of the response there"
    if denied := [row for row in evidence.every if is_denied_in_turn(row, criteria, agrees=False)]:
        name = name_subject(denied[0].names, context)
        return f"{name} would be named, but {explain_replication(denied[0].replicated_share)}"
    if evidence.term is not None:  # it beats the set that would be kept
        beaten = find_leading(evidence, criteria, criteria.divides)[0]
        name = name_subject(beaten.names, context)
        misses = f"misses {_format_error(beaten)} of the response of the held-out events"
        return f"{name} would be named, but {misses}, and {_describe_term(evidence)}"
    labels = join_words(label_effects(near.names, context))
    why = f"a name must divide that by {criteria.divides:g}"
    if compute_factor(near, evidence.base) > criteria.divides:
        needed = needs_all(near, near, evidence, criteria)
        why = (
            "that may be chance in so few blocks"
            if needed
            else "one of them alone does hardly worse"
        )
    none = (
        f"{_deny_all(context, len(near.names))} predicts the held-out events well enough to be"
        " named"
    )
    verb = "misses" if len(near.names) == 1 else "miss"
    misses = f"{verb} {_format_error(near)} of the response there"
    return f"{none}: {labels}, the nearest, {misses}, where the base model misses {bare}; {why}"


def _describe_term(evidence: Evidence) -> str:
    """What the best term is, and how far it is off, as the end of a sentence."""
    assert evidence.term is not None
    return (
        f"the best term of the library ({find_term(evidence.term.names[0]).words})"
        f" {_format_error(evidence.term)}"
    )


def _format_error(row: SetEvidence) -> str:
    """The model's error on the held-out events, as a sentence tells it."""
    stalls = row.held_out_prediction.stalls
    return (
        f"all ({describe_stall(stalls)})"
        if stalls
        else format_percent(row.held_out_prediction.error)
    )


def _deny_all(context: Context, most: int = 1) -> str:
    """How a sentence begins that says what no effect does, nor a set of so many where the nearest
    is one.
    """
    together = f", alone or up to {most} together," if most > 1 else ""
    tested = len(context.catalogue.candidates)
    return f"the model and the records disagree, and none of the {tested} effects tested{together}"


def _explain_denial(word: str, seemed: str, best: SetEvidence, context: Context) -> str:
    """What the held-out events have against the explanations of the fitted ones."""
    if word == NONE:
        return (
            f"what seemed to help on the fitted events, {seemed}, is not borne out by the held-out"
            " ones, and what the"
            " base model leaves is no more than chance leaves"
        )
    why = _describe_objection(best, context)
    return (
        f"what explains the fitted events, {seemed}, is not borne out by the held-out ones: {why}"
    )


def _describe_objection(best: SetEvidence, context: Context) -> str:
    """Why the best set is not kept, by what the held-out events say."""
    if best.is_absent:
        return "fitted to all of them it has no size"
    assert best.gap is not None
    if best.gap.outcome == DENIED:
        return "there it fits no better than the base model"
    if needless := [name for name, gap in best.without.items() if gap.outcome == DENIED]:
        return (
            "there it fits no better than without"
            f" {join_words(label_effects(needless, context), 'or')}"
        )
    return (
        "what a fit to all events together leaves would come about by chance with a probability of"
        f" {format_drawn_p(best.p_of_all)}"
    )


def find_status(row: SetEvidence, verdict: Verdict, evidence: Evidence, context: Context) -> str:
    """What became of a set that was compared, in two words."""
    is_outdone = evidence.is_predicted and row not in verdict.kept
    if is_outdone or context.criteria.rejects(row.behind):
        return "rejected"
    return "adequate" if row.p_left >= context.criteria.adequate_p else "not adequate"
