"""Whether a fitted term is proposed: held-out events and chance decide, not how well it fits.

The share explained is that of names, with what the other terms, or itself in another size, would
gain beside it among the rest. The deviance in excess of the noise is no measure of it: its level is
estimated, and that and chance move it by more than what is missing may do.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.gap import (
    SHOWN,
    Curves,
    GapTest,
    compute_curves,
    compute_gap,
    compute_pushed_changes,
    share_gone,
)
from tractexp.discrepancy.grades import fit_as_graded
from tractexp.discrepancy.held_out import carry_fits
from tractexp.discrepancy.proposal.refit import MOST_JUDGED_TERMS, TermFits
from tractexp.discrepancy.proposal.term_context import carry_over
from tractexp.identification.grade import GradedModel
from tractexp.inference.context import Context
from tractexp.inference.criteria import Criteria
from tractexp.inference.fitting import Refit, refit
from tractexp.inference.model_error import ModelChange
from tractexp.inference.noise_in_quiet import assume_residual_noise
from tractexp.noise import Noise
from tractexp.record import Event

# How often noise may give the best term of the whole library as much: a guard against the library's
# size alone, since held-out events do the rest.
PROPOSED_P = 0.01


@dataclass(frozen=True, eq=False)
class TermAssessment:
    """A fitted term on the fitted and on the held-out events; `p` is how often noise gives the best
    of all as much.
    """

    fit: Refit
    train: GapTest
    validate: GapTest
    p: float

    def objections(self, criteria: Criteria) -> list[str]:
        """Why it is not proposed, each as the end of a sentence; none where it is."""
        gap = self.validate
        least = share_gone(criteria.ahead)
        little = (
            f"it explains {gap.explained_share:.0%} of what exceeds the noise on the held-out"
            f" events, less than {least:.0%}"
        )
        enough = gap.explained_share >= least
        rows = {
            (little if gap.gain > 0 else "it makes the held-out events worse"): not enough,
            "the held-out events are too mild to show it": enough and gap.outcome != SHOWN,
            "chance gives the best of the library as much": self.p > PROPOSED_P,
        }
        return [why for why, true in rows.items() if true]


def assess_terms(
    original: Context, result: TermFits, events: Sequence[Event], p: Sequence[float]
) -> list[TermAssessment]:
    """The best fits judged on held-out events, in their order; `p` of each by chance.

    `original` is the context of the investigation, by which the balances are pushed.
    """
    fits = result.fits[:MOST_JUDGED_TERMS]
    other, units, noise = carry_fits(result.context, events, [result.bare, *reversed(fits)])
    bare = units[0]
    held = list(reversed(units[1:]))
    fitted = [*result.context.coordinates.base, *result.context.coordinates.before]
    train = _assess_models(
        original,
        result.context,
        result.noise,
        fitted,
        result.bare.unit,
        fits,
        [fit.unit for fit in fits],
    )
    there = original.move_to_events(events)
    validate = _assess_models(there, other, noise, [*other.coordinates.before], bare, fits, held)
    return [TermAssessment(*each) for each in zip(fits, train, validate, p, strict=False)]


def _assess_models(
    original: Context,
    context: Context,
    noise: Noise,
    fitted: Sequence[int],
    bare: np.ndarray,
    fits: Sequence[Refit],
    units: Sequence[np.ndarray],
) -> list[GapTest]:
    """Models with a term, at coordinates `units` (D,), beside the base model at `bare` (D,) on the
    events of `context`.

    `original` has the same events; coordinates `fitted` were fitted to them.
    """
    without = context.residual(bare)
    apart = [
        (context.residual(unit, fit.names) - without) * context.valid
        for fit, unit in zip(fits, units, strict=True)
    ]
    terms = context.whiten(noise, np.array(apart))

    def assess_fit(fit: Refit, unit: np.ndarray) -> GapTest:
        perturbations = compute_pushed_changes(
            original, carry_over(original, context, unit), (), noise
        )
        changes = np.nan_to_num(np.concatenate([terms, perturbations]))
        return compute_gap(context, bare, unit, fit.names, noise, fitted, changes=changes)

    return [assess_fit(fit, unit) for fit, unit in zip(fits, units, strict=True)]


def measure_changes(
    result: TermFits, fit: Refit, events: Sequence[Event], graded: GradedModel
) -> tuple[ModelChange[Curves], ModelChange[Curves]]:
    """What the base model, as it is graded, and that with a term leave of the fitted and of
    held-out events, the latter fitted by least squares.

    The term was looked for by the likelihood of the noise, which may give up some of the error in S
    for what is told more surely: by those fits a term that is there may seem to make it worse.
    """
    context = result.context.with_measured_power.held_to_usual
    at = context.coordinates
    found = at.without_faults(fit.unit, ())
    base = fit_as_graded(context, result.noise, graded)
    noise = assume_residual_noise(context, base)
    nested = found.copy()  # from the base model's, so that the term leaves no more
    nested[at.base] = base.unit[at.base]
    nested[at.sizes(fit.names)] = at.null[at.sizes(fit.names)]
    (best,) = refit(context, noise, [(fit.names, found), (fit.names, nested)], faults=())
    there = context.move_to_events(events)
    fitted, held_out = (
        ModelChange(
            *(
                compute_curves(seen, seen.coordinates.at_measured_power(one.unit), noise, one.names)
                for one in (base, best)
            )
        )
        for seen in (context, there)
    )
    return fitted, held_out


def list_tied_terms(
    result: TermFits, chosen: TermAssessment, others: Sequence[TermAssessment]
) -> list[TermAssessment]:
    """Those that neither held-out events nor, by its better fit, the chosen one denies."""
    criteria = result.context.criteria
    return [
        o
        for o in others
        if not o.objections(criteria) and not criteria.rejects(o.fit.cost - chosen.fit.cost)
    ]
