"""Which sets predict held-out events best, where every set leaves more than noise.

A set *beats* another if it divides what that leaves, as a root of squares, by `ahead`, and by more
than chance. A *rival* of a set is one of its size or smaller that beats the base model and that it
does not beat.
"""

import itertools
from collections.abc import Sequence

from tractexp.discrepancy.evidence import Evidence, SetEvidence
from tractexp.inference.criteria import Criteria
from tractexp.inference.fitting import Names

# effects together: of some 3,000 data sets that were judged, three were named four times, and never
# the right ones
MOST_NAMED = 2


def find_leading(evidence: Evidence, criteria: Criteria, factor: float) -> list[SetEvidence]:
    """The sets that predict best, where the best divides the error of the base model by the factor;
    else none.
    """
    ahead = [row for row in rank_sets(evidence, criteria) if beats(row, evidence.base, criteria)]
    dividing = [row for row in ahead if compute_factor(row, evidence.base) > factor]
    if not dividing:
        return []
    best = dividing[0]
    alike = [row for row in ahead if not beats(best, row, criteria)]
    common = frozenset.intersection(*(frozenset(row.family) for row in alike))
    shared = [row for row in ahead if frozenset(row.family) == common][:1]
    shared = [row for row in shared if needs_all(row, best, evidence, criteria)]
    shared = [row for row in shared if stands_alone(row, dividing, criteria, factor)]
    if shared and not find_rivals(shared[0], ahead, criteria):
        return shared
    among = [row for row in dividing if row in alike]
    needed = [row for row in among if needs_all(row, best, evidence, criteria)]
    if not needed:
        return []
    chosen = min(needed, key=lambda row: len(row.fit.names))
    return [chosen, *find_rivals(chosen, ahead, criteria)]


def stands_alone(
    shared: SetEvidence, dividing: Sequence[SetEvidence], criteria: Criteria, factor: float
) -> bool:
    """Whether what sets that divide the base model's error share is told without the rest of them.

    Not where three and more divide together alone, which bear out no member; nor where a set of no
    more effects than are named divides what it leaves by the factor again: then one of several is
    missing beside it, as surely as it was itself.
    """
    few = [row for row in dividing if len(row.fit.names) <= MOST_NAMED]
    if not few:
        return False
    return not (compute_factor(few[0], shared) > factor and beats(few[0], shared, criteria))


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
        if row.fit.names:
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
    """What sets are ranked by: what they leave of the held-out events, then their size and
    names.
    """
    return row.held_out_prediction.excess, len(row.fit.names), row.fit.names


def find_rivals(
    one: SetEvidence, ahead: Sequence[SetEvidence], criteria: Criteria
) -> list[SetEvidence]:
    """The rivals of a set among those that beat the base model, without needless supersets."""
    rivals = [row for row in ahead if row is not one and len(row.fit.names) <= len(one.fit.names)]
    rivals = [row for row in rivals if not beats(one, row, criteria)]
    return [row for row in rivals if not any({*r.fit.names} < {*row.fit.names} for r in rivals)]


def needs_all(one: SetEvidence, best: SetEvidence, evidence: Evidence, criteria: Criteria) -> bool:
    """Whether without any of the members of a set more is left than by the best, by the factor of a
    lead, chance aside.
    """
    subsets = itertools.combinations(one.fit.names, len(one.fit.names) - 1)
    fewer = [row for row in map(evidence.row_of, subsets) if row is not None]
    return all(compute_factor(best, row) > criteria.ahead for row in fewer)


def beats(one: SetEvidence, other: SetEvidence, criteria: Criteria) -> bool:
    """Whether a set divides what another leaves by the factor of a lead, and by more
    than chance.
    """
    is_ahead = compute_factor(one, other) > criteria.ahead
    return is_ahead and one.held_out_prediction.compute_lead(other.held_out_prediction) > 0


def compute_factor(one: SetEvidence, other: SetEvidence) -> float:
    """The factor by which a set divides what another leaves, as a root of squares."""
    own = one.held_out_prediction.excess
    others = other.held_out_prediction.excess
    return (others / own) ** 0.5 if own > 0 else float("inf") if others > 0 else 1.0
