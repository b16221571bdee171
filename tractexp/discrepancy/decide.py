"""What it comes to: one of five words, from the table of evidence alone. Nothing is fitted here and
nothing is said.

A set is *kept* by one of two rules.

1. It leaves nothing of the fitted events but noise, no better set rejects it, and the held-out
   events do not deny it.
2. Where every set leaves more than noise: it predicts the held-out events best. The best set must
   divide the error of the base model by `divides`. What all sets share that it does not *beat* is
   kept if it needs each of its members and has no rival; else the smallest of these sets that needs
   each of its members, and its rivals. A rival is a set of its size or smaller that beats the base
   model and that it does not beat. A set *beats* another if it divides its error by `ahead`, and by
   more than chance. None is kept where a term of the library beats it.

Several sets kept are tied. One is *named* where an event confirms it that took no part in choosing
it, and the model with it is not graded a wrong model; else it is a *candidate*. Held-out events
confirm a set of rule 1 that they show. Those of rule 2 chose it among others; they confirm it if
the fitted events alone put it first, too. Where none is kept the records agree with the base model,
or they do not.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

from tractexp.discrepancy.criteria import Criteria
from tractexp.discrepancy.evidence import Evidence, SetEvidence
from tractexp.inference.fitting import Names

NONE, CANDIDATE, NAMED, TIED, UNEXPLAINED = "none", "candidate", "named", "tied", "unexplained"
WRONG_MODEL = "wrong_model"  # the grade of a model that has no name
MOST_TESTED = 6  # sets whose rest is tested


@dataclass(frozen=True, eq=False)
class Verdict:
    """The word, and the sets kept: the one that the extended model has first. `complete`: nothing
    but noise is left.
    """

    word: str
    kept: tuple[SetEvidence, ...]
    complete: bool

    @property
    def chosen(self) -> SetEvidence | None:
        """The set that the extended model has."""
        return self.kept[0] if self.kept else None

    @property
    def sets(self) -> tuple[Names, ...]:
        """The names of all sets kept."""
        return tuple(row.names for row in self.kept)

    @property
    def names(self) -> Names:
        """The effects added."""
        return self.sets[0] if self.kept else ()


def decide(evidence: Evidence, criteria: Criteria) -> Verdict:
    """The verdict on a table of evidence."""
    find_kept = find_predicting if evidence.is_predicted else find_explaining
    kept = find_kept(evidence, criteria)
    if len(kept) > 1:
        word = TIED
    elif kept:
        word = (
            NAMED if is_confirmed(kept[0], evidence) and kept[0].grade != WRONG_MODEL else CANDIDATE
        )
    else:
        word = NONE if agrees(evidence, criteria) else UNEXPLAINED
    return Verdict(word, tuple(kept), word != UNEXPLAINED and not evidence.is_predicted)


def agrees(evidence: Evidence, criteria: Criteria) -> bool:
    """Whether the base model leaves nothing but noise, and the best set, too."""
    least_p = min(evidence.base.p_left, evidence.base.p_of_all)
    return least_p >= criteria.adequate_p and bool(find_adequate(evidence, criteria))


def shows_more(evidence: Evidence, criteria: Criteria) -> bool:
    """Whether all events show something where the fitted ones show nothing."""
    return evidence.base.p_of_all < criteria.adequate_p


def is_too_mild(evidence: Evidence) -> bool:
    """Whether the held-out events are too mild for all that explains the fitted ones."""
    gaps = [row.gap for row in evidence.rows if row.gap is not None]
    return bool(gaps) and all(gap.is_mild for gap in gaps)


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
    """Whether the held-out events, and all events together, leave a set standing."""
    if row.gap is None:
        return True
    stands = row.p_of_all >= criteria.adequate_p and not criteria.rejects(row.behind_of_all)
    return stands and not any(gap.is_denied for gap in row.gaps)


def is_confirmed(row: SetEvidence, evidence: Evidence) -> bool:
    """Whether an event confirms a set that took no part in choosing it."""
    if evidence.is_predicted:
        return is_first_on_fitted(row, evidence)
    return bool(row.gaps) and all(gap.is_shown for gap in row.gaps)


def is_first_on_fitted(one: SetEvidence, evidence: Evidence) -> bool:
    """Whether no set of another family and of its size fits the fitted events better."""
    rivals = [
        row
        for row in evidence.every
        if len(row.fit.names) == len(one.fit.names)
        and row.family != one.family
        and row.prediction is not None
    ]
    return all(one.fit.cost <= row.fit.cost for row in rivals)


def find_predicting(evidence: Evidence, criteria: Criteria) -> list[SetEvidence]:
    """The sets kept by rule 2."""
    leading = find_leading(evidence, criteria, criteria.divides)
    if not leading or (evidence.term is not None and beats(evidence.term, leading[0], criteria)):
        return []
    kept = [row for row in leading if not criteria.rejects(row.behind)]
    return kept if all(row.gap is None or row.gap.is_shown for row in kept) else []


def find_leading(evidence: Evidence, criteria: Criteria, factor: float) -> list[SetEvidence]:
    """The sets that predict best, where the best divides the error of the base model by the factor;
    else none.
    """
    ahead = [row for row in rank_sets(evidence, criteria) if beats(row, evidence.base, criteria)]
    dividing = [row for row in ahead if divides(row, evidence.base, factor)]
    if not dividing:
        return []
    alike = [row for row in ahead if not beats(dividing[0], row, criteria)]
    common = frozenset.intersection(*(frozenset(row.family) for row in alike))
    shared = next((row for row in ahead if frozenset(row.family) == common), None)
    if (
        shared
        and needs_all(shared, evidence, criteria)
        and not find_rivals(shared, ahead, criteria)
    ):
        return [shared]
    needed = [row for row in dividing if row in alike and needs_all(row, evidence, criteria)]
    if not needed:
        return []
    chosen = min(needed, key=lambda row: len(row.fit.names))
    return [chosen, *find_rivals(chosen, ahead, criteria)]


def find_nearest(evidence: Evidence, criteria: Criteria) -> SetEvidence:
    """The set that is told where none is kept: the same of what divides the error by less, or what
    leaves least.
    """
    leading = find_leading(evidence, criteria, criteria.ahead)
    return leading[0] if leading else min(evidence.every, key=_rank)


def rank_sets(evidence: Evidence, criteria: Criteria) -> list[SetEvidence]:
    """The sets by what they leave, the least first; of one family the simplest that the best of it
    does not beat.
    """
    families: dict[Names, list[SetEvidence]] = {}
    for row in sorted(evidence.every, key=_rank):
        if row.fit.names and row.prediction is not None:
            families.setdefault(row.family, []).append(row)
    simplest = [
        min(
            (row for row in rows if not beats(rows[0], row, criteria)),
            key=lambda row: row.fit.parameters,
        )
        for rows in families.values()
    ]
    return sorted(simplest, key=_rank)


def _rank(row: SetEvidence) -> tuple[float, int, Names]:
    left = float("inf") if row.prediction is None else row.predicted.left
    return left, len(row.fit.names), row.fit.names


def find_rivals(
    one: SetEvidence, ahead: Sequence[SetEvidence], criteria: Criteria
) -> list[SetEvidence]:
    """What a set does not beat, of its size or smaller, without needless supersets."""
    rivals = [row for row in ahead if row is not one and len(row.fit.names) <= len(one.fit.names)]
    rivals = [row for row in rivals if not beats(one, row, criteria)]
    return [row for row in rivals if not any({*r.fit.names} < {*row.fit.names} for r in rivals)]


def needs_all(one: SetEvidence, evidence: Evidence, criteria: Criteria) -> bool:
    """Whether more is left without any of the members of a set, by the factor of a lead, chance
    aside.
    """
    subsets = itertools.combinations(one.fit.names, len(one.fit.names) - 1)
    fewer = [
        row
        for row in map(evidence.row_of, subsets)
        if row is not None and row.prediction is not None
    ]
    return all(divides(one, row, criteria.ahead) for row in fewer)


def divides(one: SetEvidence, other: SetEvidence, factor: float) -> bool:
    """Whether a set divides what another leaves, as a root of squares, by more than a factor."""
    return other.predicted.left > factor**2 * one.predicted.left


def beats(one: SetEvidence, other: SetEvidence, criteria: Criteria) -> bool:
    """Whether a set divides what another leaves by the factor of a lead, and by more
    than chance.
    """
    return divides(one, other, criteria.ahead) and one.predicted.is_clear_of(other.predicted)
