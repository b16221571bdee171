"""Whether a fitted term is proposed: held-out events and chance decide, not how well it fits."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.bench import Bench
from tractexp.discrepancy.criteria import Criteria
from tractexp.discrepancy.fitting import Refit
from tractexp.discrepancy.gap import Curves, curves
from tractexp.discrepancy.held_out import carried
from tractexp.discrepancy.proposal.refit import Fitted
from tractexp.record import Event

JUDGED = 5  # terms that held-out events are asked about


@dataclass(frozen=True, eq=False)
class Before:
    """A model on some events without a term and with it."""

    bench: Bench  # of the events
    without: Curves
    with_it: Curves

    @property
    def closed(self) -> float:
        """The share of the deviance in excess of the noise that the term takes away; 0 where there is no excess."""
        excess = self.without.deviance - self.bench.samples
        return (self.without.deviance - self.with_it.deviance) / excess if excess > 0 else 0.0

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
        left = max(self.train.left, self.validate.left)
        told = {
            f"it closes {self.validate.closed:.0%} of the gap on the held-out events, less than"
            f" {criteria.proposal_closed:.0%}": self.validate.closed < criteria.proposal_closed,
            f"it leaves {left:.2g} times the variance of the noise": left > criteria.proposal_left,
            "chance gives the best of the library as much": self.p > criteria.proposal_p,
        }
        return [why for why, true in told.items() if true]


def weighed(made: Fitted, events: Sequence[Event], p: Sequence[float]) -> list[Weighed]:
    """The best fits weighed on held-out events, in their order; `p` of each by chance."""
    fits = made.fits[:JUDGED]
    other, units, noise = carried(made.bench, events, [made.bare, *reversed(fits)])
    bare, held = units[0], list(reversed(units[1:]))
    without = curves(made.bench, made.bare.unit, made.noise, ()), curves(other, bare, noise, ())
    told = []
    for fit, unit, chance in zip(fits, held, p, strict=False):
        train = Before(made.bench, without[0], curves(made.bench, fit.unit, made.noise, fit.names))
        validate = Before(other, without[1], curves(other, unit, noise, fit.names))
        told.append(Weighed(fit, train, validate, chance, unit))
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


def _rows(bench: Bench, made: Fitted, fits: Sequence[Refit]) -> np.ndarray:
    faults = bench.coordinates.sizes(bench.catalogue.of_measurement)
    return bench.rows(np.array([f.unit for f in fits]), made.noise, faults, [f.names for f in fits])
