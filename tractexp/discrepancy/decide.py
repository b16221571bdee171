"""What it comes to: one of five words, from the table of evidence alone. Nothing is fitted.

A set is *kept* by one of two rules.

1. It leaves nothing of the fitted events but noise, no better set rejects it, and the held-out
   events do not deny it, nor do all events together where that is in doubt (`needs_all_events`).
2. Where every set leaves more than noise: it predicts the held-out events best (`ranking`). The
   best set must divide the error of the base model by `divides`. What all sets share that it does
   not beat is kept if it needs each of its members and has no rival, and if a set of no more
   effects than are named divides so, but not what it leaves by as much again; else the smallest of
   these sets that needs each of its members (without one the best leaves `ahead` times less), and
   its rivals. None is kept where a term of the library beats it.

Several sets kept are tied. One is *named* where an event confirms it that took no part in choosing
it, or each of several that was left out in turn, where it has one or two effects, whose sizes are
known within their bounds, and the model with it is not graded a wrong model; else it is a
*candidate*. An event left out that loses nothing by it denies it, where it goes by what it predicts
or the base model leaves noise alone; in the latter case so does noise that hides it in all events.
Where none is kept the records agree with the base model, or they do not. They do as well where it
leaves less than matters (`SLIGHT_ERROR` of the response, of the fitted and the held-out events), or
where it is graded adequate: a set without a size in the model that is graded is the base model.
"""

import math
from collections.abc import Sequence

from tractexp.discrepancy.evidence import Evidence, SetEvidence, Verdict
from tractexp.discrepancy.gap import DENIED, SHOWN, share_gone
from tractexp.discrepancy.ranking import MOST_NAMED, beats, find_leading
from tractexp.inference.criteria import Criteria
from tractexp.inference.fitting import Names

NONE, CANDIDATE, NAMED, TIED, UNEXPLAINED = "none", "candidate", "named", "tied", "unexplained"
WRONG_MODEL = "wrong_model"  # the grade of a model that has no name
ADEQUATE = "adequate"  # of a model that leaves noise alone
MOST_TESTED = 6  # sets whose rest is tested
CONFIRMED_SHARE = 0.5  # of what an event shows of a set: so much of it confirms the set


def decide(evidence: Evidence, criteria: Criteria) -> Verdict:
    """The verdict on a table of evidence: it fits nothing and writes nothing.

    Parameters
    ----------
    evidence : Evidence
        One row a set of effects, with what is known of each.
    criteria : Criteria
        The thresholds.

    Returns
    -------
    Verdict
    """
    find_kept = find_predicting if evidence.is_predicted else find_explaining
    least_p = min(evidence.base.p_left, evidence.base.p_of_all)
    agrees = least_p >= criteria.adequate_p and bool(find_adequate(evidence, criteria))
    kept = find_kept(evidence, criteria)
    if agrees or evidence.is_predicted:
        kept = [row for row in kept if not is_denied_in_turn(row, criteria, agrees=agrees)]
    if len(kept) > 1:
        word = TIED
    elif kept:
        row = kept[0]
        # of few effects, of sizes that are known within their bounds, and no wrong model
        is_few = len(row.fit.names) <= MOST_NAMED
        is_sound = is_few and not row.open_sizes and row.grade != WRONG_MODEL
        word = NAMED if is_sound and is_confirmed(row, evidence) else CANDIDATE
    else:
        suffices = evidence.base.is_slight or evidence.base.grade == ADEQUATE
        word = NONE if agrees or suffices else UNEXPLAINED
    return Verdict(word, tuple(kept), word != UNEXPLAINED and not evidence.is_predicted)


def shows_more(evidence: Evidence, criteria: Criteria) -> bool:
    """Whether all events show something where the fitted ones show nothing."""
    return evidence.base.p_of_all < criteria.adequate_p


def find_adequate(evidence: Evidence, criteria: Criteria) -> list[SetEvidence]:
    """The sets that leave nothing of the fitted events; none where the set that the search chose
    does not.
    """
    if evidence.is_predicted:
        return []
    left = [row for row in evidence.rows if not criteria.rejects(row.behind)][:MOST_TESTED]
    adequate = [row for row in left if row.p_left >= criteria.adequate_p]
    return adequate if adequate[:1] == left[:1] else []


def find_explaining(evidence: Evidence, criteria: Criteria) -> list[SetEvidence]:
    """The sets kept by rule 1; of each family the best."""
    families: dict[Names, SetEvidence] = {}
    for row in find_adequate(evidence, criteria):
        if row.names and holds(row, criteria):
            families.setdefault(row.family, row)
    return list(families.values())


def holds(row: SetEvidence, criteria: Criteria) -> bool:
    """Whether the held-out events, all events together, and the grade leave a set standing."""
    if row.gap is None or row.is_absent:
        return not row.is_absent
    stands = row.p_of_all >= criteria.adequate_p and not criteria.rejects(row.behind_of_all)
    return stands and DENIED not in {gap.outcome for gap in row.gaps}


def needs_all_events(rows: Sequence[SetEvidence], criteria: Criteria) -> bool:
    """Whether a fit to all events must bear sets out that the fitted events explain.

    All but a single textbook effect without rivals that holds, and that explains as large a share
    of what exceeds the noise on the held-out events as `divides` leaves gone.
    """
    first = rows[0]
    if len(rows) > 1 or len(first.names) > 1 or first.names != first.family or first.gap is None:
        return True
    return first.gap.explained_share < share_gone(criteria.divides) or not holds(first, criteria)


def is_confirmed(row: SetEvidence, evidence: Evidence) -> bool:
    """Whether an event confirms a set that took no part in choosing it: held-out events that show
    it and each of its members; or, where those took part or there are none, each event in turn,
    left out, that shows them.
    """
    if chose_by_all(row, evidence):
        share = row.replicated_share
        return share is not None and share >= CONFIRMED_SHARE
    return all(gap.outcome == SHOWN for gap in row.gaps)


def is_denied_in_turn(row: SetEvidence, criteria: Criteria, *, agrees: bool) -> bool:
    """Whether an event left out loses nothing by a set; or, where the base model `agrees`, noise
    hides it in each, and held-out events are too mild to show it.
    """
    share = row.replicated_share
    if share is None or not math.isnan(share):
        return share is not None and share <= 0
    return agrees and (row.gap is None or row.gap.expected < criteria.shown)


def chose_by_all(row: SetEvidence, evidence: Evidence) -> bool:
    """Whether no event is left that took no part in choosing a set."""
    return evidence.is_predicted or row.is_fitted_to_all or not row.gaps


def find_predicting(evidence: Evidence, criteria: Criteria) -> list[SetEvidence]:
    """The sets kept by rule 2."""
    term, leading = evidence.term, find_leading(evidence, criteria, criteria.divides)
    is_beaten = leading and term is not None and beats(term, leading[0], criteria)
    return [] if is_beaten else leading
