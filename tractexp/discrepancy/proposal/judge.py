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
from tractexp.discrepancy.proposal.refit import Fitted
from tractexp.discrepancy.records import Records
from tractexp.noise import Noise
from tractexp.record import Event

JUDGED = 5  # terms that held-out events are asked about


@dataclass(frozen=True, eq=False)
class Before:
    """A model on some events without a term and with it, and how much more than chance explains what is left."""

    bench: Context  # of the events
    without: Curves
    with_it: Curves
    explainable: float  # beside the term, of the deviance

    @property
    def closed(self) -> float:
        """The share of the explainable gap that the term takes away; 0 where there is none."""
        gained = self.without.deviance - self.with_it.deviance
        whole = gained + max(self.explainable, 0.0)
        return gained / whole if whole > 0 else 0.0

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
        left, closed = max(self.train.left, self.validate.left), self.validate.closed
        little = f"it closes {closed:.0%} of the gap on the held-out events, less than {criteria.proposal_closed:.0%}"
        told = {
            (little if closed >= 0 else "it makes the held-out events worse"): closed < criteria.proposal_closed,
            f"it leaves {left:.2g} times the variance of the noise": left > criteria.proposal_left,
            "chance gives the best of the library as much": self.p > criteria.proposal_p,
        }
        return [why for why, true in told.items() if true]


def weighed(found: Context, made: Fitted, events: Sequence[Event], p: Sequence[float]) -> list[Weighed]:
    """The best fits weighed on held-out events, in their order; `p` of each by chance.

    `found` is the bench of the investigation, by which the balances are pushed.
    """
    fits = made.fits[:JUDGED]
    other, units, noise = carried(made.bench, events, [made.bare, *reversed(fits)])
    bare, held = units[0], list(reversed(units[1:]))
    fitted = [*made.bench.coordinates.base, *made.bench.coordinates.before]
    train = _compared(found, made.bench, made.noise, fitted, made.bare.unit, fits, [fit.unit for fit in fits])
    there = found.on(Records.of(events, found.records.window))
    validate = _compared(there, other, noise, [*other.coordinates.before], bare, fits, held)
    return [Weighed(*each) for each in zip(fits, train, validate, p, held, strict=False)]


def _compared(
    found: Context, bench: Context, noise: Noise, fitted: Sequence[int], bare: np.ndarray, fits: Sequence[Refit],
    units: Sequence[np.ndarray],
) -> list[Before]:  # fmt: skip
    """Models with a term, at coordinates `units` (D,), beside the base model at `bare` (D,) on the events of `bench`.

    `found` has the same events; coordinates `fitted` were fitted to them.
    """
    without = curves(bench, bare, noise, ())
    made = [curves(bench, unit, noise, fit.names) for fit, unit in zip(fits, units, strict=True)]
    terms = bench.whiten(noise, np.array([(m.calculated - without.calculated) * bench.known for m in made]))
    told = []
    for fit, unit, with_it in zip(fits, units, made, strict=True):
        pushes = pushed(found, carried_over(found, bench, unit), (), noise)
        changes = np.nan_to_num(np.concatenate([terms, pushes]))
        told.append(Before(bench, without, with_it, beyond_chance(bench, unit, fit.names, noise, fitted, changes)))
    return told


def tied(made: Fitted, chosen: Weighed, others: Sequence[Weighed]) -> list[Weighed]:
    """Those that neither held-out events nor, were they true, the fit of the chosen one denies."""
    bench, criteria = made.bench, made.bench.criteria
    rows = _rows(bench, made, [chosen.fit, *(o.fit for o in others)])
    distances = ((rows[1:] - rows[0]) ** 2).sum(axis=1)
    explained = made.bare.deviance - chosen.fit.deviance
    kept = []
    for other, distance in zip(others, distances.tolist(), strict=True):
        behind, parameters = other.fit.cost - chosen.fit.cost, other.fit.parameters + chosen.fit.parameters
        if other.stands(criteria) and not criteria.rejects(behind, distance, parameters, explained):
            kept.append(other)
    return kept


def _rows(bench: Context, made: Fitted, fits: Sequence[Refit]) -> np.ndarray:
    faults = bench.coordinates.sizes(bench.catalogue.of_measurement)
    return bench.rows(np.array([f.unit for f in fits]), made.noise, faults, [f.names for f in fits])
