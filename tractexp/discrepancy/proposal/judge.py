"""Whether a fitted term is proposed: held-out events and chance decide, not how well it fits.

Shares are of the gap that can be explained, as in `gap`: what a term gains, over that and what pushes into the balances
and the other terms, or itself in another size, would gain beside it. The deviance in excess of the noise is no measure
of it: its level is estimated, and that and chance move it by more than what is missing may do.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.context import Context
from tractexp.discrepancy.criteria import Criteria
from tractexp.discrepancy.fitting import Refit
from tractexp.discrepancy.gap import Curves, beyond_chance, curves, pushed
from tractexp.discrepancy.held_out import carried
from tractexp.discrepancy.proposal.bed import carried_over
from tractexp.discrepancy.proposal.refit import JUDGED, Fitted
from tractexp.discrepancy.records import Records
from tractexp.noise import Noise
from tractexp.record import Event


@dataclass(frozen=True, eq=False)
class Before:
    """A model on some events without a term and with it, and how much more than chance explains what is left."""

    context: Context  # of the events
    without: Curves
    with_it: Curves
    explainable: float  # beside the term, of the deviance

    @property
    def gain(self) -> float:
        """By how much the term lowers the deviance."""
        return self.without.deviance - self.with_it.deviance

    @property
    def closed(self) -> float:
        """The share of the explainable gap that the term takes away; 0 where there is none."""
        whole = self.gain + max(self.explainable, 0.0)
        return self.gain / whole if whole > 0 else 0.0

    @property
    def left(self) -> float:
        """What is left, of the noise's variance."""
        return self.with_it.chi2_per_sample


@dataclass(frozen=True, eq=False)
class Weighed:
    """A fitted term on the fitted and on the held-out events; `p` is how often noise gives the library's best as much.

    `unit` (D,) are its coordinates on the held-out events.
    """

    fit: Refit
    train: Before
    validate: Before
    p: float
    unit: np.ndarray

    def stands(self, criteria: Criteria) -> bool:
        """Whether it is proposed."""
        return not self.objections(criteria)

    def objections(self, criteria: Criteria) -> list[str]:
        """Why it is not proposed, each as the end of a sentence."""
        closed = self.validate.closed
        least = 1 - 1 / criteria.ahead**2  # of squares
        little = f"it closes {closed:.0%} of the gap on the held-out events, less than {least:.0%}"
        rows = {
            (little if closed >= 0 else "it makes the held-out events worse"): closed < least,
            "the held-out events are too mild to show it": closed >= least and self.validate.gain < criteria.shown,
            "chance gives the best of the library as much": self.p > criteria.proposal_p,
        }
        return [why for why, true in rows.items() if true]


def weighed(original: Context, result: Fitted, events: Sequence[Event], p: Sequence[float]) -> list[Weighed]:
    """The best fits weighed on held-out events, in their order; `p` of each by chance.

    `original` is the context of the investigation, by which the balances are pushed.
    """
    fits = result.fits[:JUDGED]
    other, units, noise = carried(result.context, events, [result.bare, *reversed(fits)])
    bare, held = units[0], list(reversed(units[1:]))
    fitted = [*result.context.coordinates.base, *result.context.coordinates.before]
    train = _compared(
        original, result.context, result.noise, fitted, result.bare.unit, fits, [fit.unit for fit in fits]
    )
    there = original.on(Records.of(events, original.records.window))
    validate = _compared(there, other, noise, [*other.coordinates.before], bare, fits, held)
    return [Weighed(*each) for each in zip(fits, train, validate, p, held, strict=False)]


def _compared(
    original: Context, context: Context, noise: Noise, fitted: Sequence[int], bare: np.ndarray, fits: Sequence[Refit],
    units: Sequence[np.ndarray],
) -> list[Before]:  # fmt: skip
    """Models with a term, at coordinates `units` (D,), beside the base model at `bare` (D,) on the events of `context`.

    `original` has the same events; coordinates `fitted` were fitted to them.
    """
    without = curves(context, bare, noise, ())
    result = [curves(context, unit, noise, fit.names) for fit, unit in zip(fits, units, strict=True)]
    terms = context.whiten(noise, np.array([(m.calculated - without.calculated) * context.valid for m in result]))
    rows = []
    for fit, unit, with_it in zip(fits, units, result, strict=True):
        perturbations = pushed(original, carried_over(original, context, unit), (), noise)
        changes = np.nan_to_num(np.concatenate([terms, perturbations]))
        rows.append(Before(context, without, with_it, beyond_chance(context, unit, fit.names, noise, fitted, changes)))
    return rows


def tied(result: Fitted, chosen: Weighed, others: Sequence[Weighed]) -> list[Weighed]:
    """Those that neither held-out events nor, by its better fit, the chosen one denies."""
    criteria = result.context.criteria
    return [o for o in others if o.stands(criteria) and not criteria.rejects(o.fit.cost - chosen.fit.cost)]
