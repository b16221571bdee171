"""How sure: the sets of the chosen size in a table, what each gains, and whether any leaves
nothing.

A rival is rejected by its relative likelihood (Akaike 1978). That weighs fits which leave noise
only; sets that leave more are judged by what they predict. What is named must leave nothing that a
perturbation of some balance, or other parameters in each event, would still explain: that is tested
at the best sets that are not rejected.
"""

from dataclasses import replace

from tractexp.discrepancy.decide import MOST_TESTED
from tractexp.discrepancy.disagreement import examine_fit
from tractexp.discrepancy.evidence import Evidence, SetEvidence
from tractexp.discrepancy.explanations import Explanations
from tractexp.inference.fitting import refit, refit_from

RIVAL_SEED_OFFSET = 100  # added to the seed of the draws at rivals


def compare_rivals(explained: Explanations, seed: int) -> Evidence:
    """The table of all refitted sets of the chosen size: the chosen one first, then the best, those
    near it tested.
    """
    first, last, base = explained.steps[0], explained.last, explained.base
    rows = rank_rivals(explained)
    near = [k for k, row in enumerate(rows) if not base.context.criteria.rejects(row.behind)][
        :MOST_TESTED
    ]
    for place, k in enumerate(near):
        fit = rows[k].fit
        tests = (
            last
            if k == 0
            else examine_fit(base.quiet, fit, last.noise, seed + RIVAL_SEED_OFFSET + place)
        )
        rows[k] = replace(rows[k], tests=tests, p_left=tests.p_left)
    bare = SetEvidence(first.fit, (), (), p_left=first.p_left, tests=first)
    return Evidence(bare, tuple(rows), faults=explained.faults, noise=last.noise, last=last)


def rank_rivals(explained: Explanations) -> list[SetEvidence]:
    """Every refitted set of the chosen size under the noise of the last tests: the chosen one, then
    the best first.
    """
    context, noise, chosen = explained.base.context, explained.last.noise, explained.chosen.names
    wanted = [f.start for f in explained.refits.values() if len(f.names) == len(chosen)]
    fits = sorted(refit(context, noise, wanted), key=lambda fit: fit.names != chosen)
    base = refit_from(context, noise, (), explained.steps[0].fit.unit)
    family = context.catalogue.textbook
    return [
        SetEvidence(
            fit,
            fit.names,
            family(fit.names),
            lowered=base.deviance - fit.deviance,
            behind=fit.cost - fits[0].cost,
        )
        for fit in fits
    ]
