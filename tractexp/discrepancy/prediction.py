"""Which sets of effects predict held-out events best, where none of them leaves noise only.

A formula is not the physics. What the right one leaves is often no noise, and then a test of significance rejects it
as it rejects a wrong one. What can be asked still is how much each set predicts in events that it was not fitted to.

The sets that predict best are those that the best of all is not ahead of (`criteria.ahead`), where that divides what
the base model leaves of the held-out events (`criteria.divides`). What all of them share is named, if it needs each of
its members and has no rival: what stands beside it is open. Else the smallest of them that needs each of its members is
named, or tied with its rivals. A rival is a set of its size or smaller that is ahead of the base model, and that it is
not ahead of. All by more than chance, and none is named where a term of the library is ahead of it.

What is left has two measures. Where the disagreement is of the noise's size it is what pushes into the balances would
still gain of the deviance, with the fits of the search by likelihood. Where it is far above the noise it is the squared
error in S, with every set fitted by least squares (`least_squares`).
"""

import itertools
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from tractexp.discrepancy.criteria import Criteria
from tractexp.discrepancy.explanations import WIDELY, Explanations, Names, searched, wide_starts
from tractexp.discrepancy.families import member_fits
from tractexp.discrepancy.least_squares import residual_noise
from tractexp.discrepancy.proposal.best_term import best_terms
from tractexp.discrepancy.proposal.library import term
from tractexp.inference.base_fit import minima_of
from tractexp.inference.blocks import reach
from tractexp.inference.catalogue import Catalogue
from tractexp.inference.context import Context
from tractexp.inference.cores import each_apart
from tractexp.inference.fitting import Refit, best_of, refit, wide_refits
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.model_error import block_sums, noise_variance
from tractexp.inference.records import Records
from tractexp.noise import Noise
from tractexp.record import Event

FAMILIES = 2  # single effects whose families are tried, and to which a second is added
CARRIED = 12  # sets of the search by likelihood that are fitted again
SHARING = 10.0  # blocks that share the response: where two or three hold all of it, nothing is clear of chance
LEAST = 0.1  # of the noise: a model's squared error is told no finer


@dataclass(frozen=True, eq=False)
class Prediction(ABC):
    """A set of effects as fitted, and what it leaves of held-out events."""

    fit: Refit

    @property
    def names(self) -> Names:
        return self.fit.names

    @property
    @abstractmethod
    def left(self) -> float:
        """Squares beyond the noise, no less than can be told of them."""

    @property
    @abstractmethod
    def error(self) -> float:
        """The model's error, of the response."""

    @abstractmethod
    def clear_of(self, other: "Prediction") -> bool:
        """Whether this one leaves less by more than chance."""

    def divides(self, other: "Prediction", factor: float) -> bool:
        """Whether it divides what the other leaves, as a root of squares, by more than a factor."""
        return other.left > factor**2 * self.left

    def ahead_of(self, other: "Prediction", factor: float) -> bool:
        """The same, and by more than chance."""
        return self.divides(other, factor) and self.clear_of(other)


@dataclass(frozen=True, eq=False)
class PredictionError(Prediction):
    """By the model's error: `squares` (b,) of what is left in S in each block [pu²], noise included, of which `noise`
    (b,) is expected, and of the `response` (b,)."""

    unit: np.ndarray  # (D,) coordinates on the held-out events
    squares: np.ndarray
    noise: np.ndarray
    response: np.ndarray

    @property
    def left(self) -> float:
        noise = float(self.noise.sum())
        return max(float(self.squares.sum()) - noise, LEAST * noise, 1e-12)

    @property
    def error(self) -> float:
        return float(np.sqrt(self.left / max(self.response.sum(), 1e-30)))

    def clear_of(self, other: Prediction) -> bool:
        """By the logarithm of the ratio of squares without each block: a jackknife."""
        assert isinstance(other, PredictionError)
        if not np.isfinite(total := self.squares.sum()) or not np.isfinite(others := other.squares.sum()):
            return bool(np.isfinite(total))
        mine, theirs = total - self.squares, others - other.squares
        without, lead = np.log(np.maximum(theirs, 1e-300) / np.maximum(mine, 1e-300)), float(np.log(others / total))
        return lead > reach(without, lead)


@dataclass(frozen=True, eq=False)
class PredictedTerm(PredictionError):
    """A term of the library in place of a set: its coordinates are those of a context of terms."""

    @property
    def words(self) -> str:
        return term(self.names[0]).words


OneSet = TypeVar("OneSet", bound=Prediction)
OneError = TypeVar("OneError", bound=PredictionError)


@dataclass(frozen=True, eq=False)
class Predictions(Generic[OneSet]):
    """All sets on the held-out events, the base model's among them."""

    catalogue: Catalogue
    sets: Mapping[Names, OneSet]

    @property
    def bare(self) -> OneSet:
        return self.sets[()]

    def ranked(self, most: int, factor: float) -> list[OneSet]:
        """Sets of at most so many effects, the best first; of one family the simplest that the best is not ahead of by
        a factor."""
        families: dict[Names, list[OneSet]] = {}
        for one in sorted(self.sets.values(), key=_rank):
            if 0 < len(one.names) <= most:
                families.setdefault(self.catalogue.textbook(one.names), []).append(one)
        return sorted((_simplest(members, factor) for members in families.values()), key=_rank)

    def explaining(self, criteria: Criteria) -> list[OneSet]:
        """The set that is named, or those that are tied; none where none divides what the base model leaves."""
        return self._leading(criteria, criteria.divides)

    def nearest(self, criteria: Criteria) -> OneSet:
        """The same of what divides that by less, or else what leaves least."""
        return next(iter(self._leading(criteria, criteria.ahead)), min(self.sets.values(), key=_rank))

    def _leading(self, criteria: Criteria, factor: float) -> list[OneSet]:
        """What the sets that predict best share, if it has no rival; else the smallest of them, and its rivals.

        None where the best does not divide what the base model leaves by the factor.
        """
        ranked = self.ranked(max(map(len, self.sets)), criteria.ahead)
        ahead = [p for p in ranked if p.ahead_of(self.bare, criteria.ahead)]
        dividing = [p for p in ahead if p.divides(self.bare, factor)]
        if not dividing:
            return []
        alike = [p for p in ahead if not dividing[0].ahead_of(p, criteria.ahead)]
        common = frozenset.intersection(*map(self._textbook, alike))
        shared = next((p for p in ahead if self._textbook(p) == common), None)
        if shared and self.needs_all(shared, criteria) and not self._rivals(shared, ahead, criteria):
            return [shared]
        needed = (p for p in dividing if p in alike and self.needs_all(p, criteria))
        chosen = min(needed, key=lambda p: len(p.names), default=None)
        return [chosen, *self._rivals(chosen, ahead, criteria)] if chosen else []

    def _textbook(self, one: OneSet) -> frozenset[str]:
        return frozenset(self.catalogue.textbook(one.names))

    def _rivals(self, one: OneSet, ahead: Sequence[OneSet], criteria: Criteria) -> list[OneSet]:
        """What it is not ahead of, of its size or smaller, without needless supersets."""
        rivals = [p for p in ahead if p is not one and len(p.names) <= len(one.names)]
        rivals = [p for p in rivals if not one.ahead_of(p, criteria.ahead)]
        return [p for p in rivals if not any({*q.names} < {*p.names} for q in rivals)]

    def needs_all(self, one: OneSet, criteria: Criteria) -> bool:
        """Whether a set needs each of its members: without any of them more is left by a factor, chance aside."""
        fewer = itertools.combinations(one.names, len(one.names) - 1)
        return all(one.divides(self.sets[names], criteria.ahead) for names in fewer if names in self.sets)

    def contributions(self, names: Names) -> list[OneSet]:
        """The base model, then with one member more at a time, the one that helps most: what each is good for."""
        steps, left = [self.bare], set(names)
        while left:
            wanted = [tuple(sorted((*steps[-1].names, name))) for name in left]
            step = min((self.sets[w] for w in wanted if w in self.sets), key=lambda p: p.left, default=None)
            if step is None:
                break
            steps.append(step)
            left -= set(step.names)
        return steps


def _rank(one: Prediction) -> tuple[float, int, Names]:
    return one.left, len(one.names), one.names


def _simplest(members: Sequence[OneSet], factor: float) -> OneSet:
    """The one with the fewest parameters of those that the first, which leaves least, is not ahead of."""
    return min((one for one in members if not members[0].ahead_of(one, factor)), key=lambda one: one.fit.parameters)


@dataclass(frozen=True, eq=False)
class ErrorPredictions(Predictions[PredictionError]):
    """Those by the model's error; `noise` is that under which they were fitted. Where a set explains `term` is what
    predicts best of the library of terms."""

    context: Context  # of the held-out events
    noise: Noise
    term: PredictedTerm | None = None

    def beaten(self, criteria: Criteria) -> list[PredictionError]:
        """The sets that would explain, were the term not ahead of them."""
        best = super().explaining(criteria)
        return best if best and self.term is not None and self.term.ahead_of(best[0], criteria.ahead) else []

    def explaining(self, criteria: Criteria) -> list[PredictionError]:
        return [] if self.beaten(criteria) else super().explaining(criteria)


def predictions(explained: Explanations, events: Sequence[Event]) -> ErrorPredictions:
    """Fit single effects and sets of two by least squares, and what the search by likelihood ended with; carry all of
    them over to the held-out events. The powers before events are those measured, as in an identification."""
    context = explained.base.context.with_measured_power
    noise = residual_noise(explained.base.context, explained.chosen)
    there = context.on(Records.of(events, context.records.window))
    fits = {f.names: f for f in _fits(context, explained, noise)}
    predicted = each_apart(lambda f: _predicted(there, f), list(fits.values()), context.effort)
    sets = dict(zip(fits, predicted, strict=True))
    result = ErrorPredictions(context.catalogue, sets, there, noise)
    best = result.ranked(max(map(len, fits)), context.criteria.ahead)[:1]
    subsets = [s for p in best for k in range(1, len(p.names)) for s in itertools.combinations(p.names, k)]
    if missing := [s for s in subsets if s not in sets]:
        again = refit(context, noise, [(s, fits[best[0].names].unit) for s in missing], faults=())
        sets |= {f.names: _predicted(there, f) for f in again}
    result = ErrorPredictions(context.catalogue, sets, there, noise)
    if not result.explaining(context.criteria):
        return result
    of_terms, terms = best_terms(context, result.bare.fit, noise)
    beside = of_terms.on(there.records)
    return replace(result, term=min((_predicted(beside, fit, PredictedTerm) for fit in terms), key=_rank))


def _fits(context: Context, explained: Explanations, noise: Noise) -> list[Refit]:
    """The base model and sets of effects, each as it fits best by least squares.

    Faults of the measurement are free while sets are looked for; what is told of them is without.
    """
    base, at = explained.base, context.coordinates
    say = lambda line: context.effort.say(f"{line}, by least squares")  # noqa: E731
    squares = Likelihood.of_squares(context.kernels.bare, noise.levels[0])
    by_likelihood = map(at.at_measured_power, (explained.steps[0].fit.unit, *base.local_minima))
    bare = refit(context, noise, [((), unit) for unit in (*by_likelihood, *minima_of(context, squares))])[0]
    ground = explained.steps[0].at(context, bare, noise)
    refits: dict[Names, Refit] = {(): bare}

    def add(fits: Iterable[Refit]) -> None:
        refits.update({f.names: f for f in best_of([*refits.values(), *fits])})

    add(searched([ground], refits, 1, say))
    add(wide_refits(context, noise, wide_starts(context, bare.unit, refits), WIDELY))
    carried = sorted((f for f in explained.refits.values() if f.names), key=lambda f: f.cost)[:CARRIED]
    if carried:
        add(refit(context, noise, [(f.names, at.at_measured_power(f.unit)) for f in carried]))
    singles = [f for f in best_of(refits.values()) if len(f.names) == 1]
    of_family = {context.catalogue.textbook(f.names)[0] for f in singles[:FAMILIES]}
    add(member_fits(context, noise, refits, of_family))
    of_load = [f for f in singles if f.names[0] in context.catalogue.of_load]  # members of families have no columns
    for single in of_load[:FAMILIES]:
        add(searched([ground, ground.at(context, single, noise)], refits, 2, say))
    return refit(context, noise, [(f.names, at.without_faults(f.unit, ())) for f in refits.values()], faults=())


def _predicted(there: Context, fit: Refit, kind: type[OneError] = PredictionError) -> OneError:
    """A fit on other events."""
    unit = there.coordinates.at_measured_power(fit.unit)
    calculated = there.residuals(unit[None], fit.names)[0] + there.drive.measured
    played = [
        there.domain.comparison(event, calculated[:, there.drive.part(e)]) for e, event in enumerate(there.events)
    ]
    left, noise, response = [], [], []
    for one, sums in zip(played, block_sums(played, SHARING), strict=True):
        own = noise_variance(one.event) * (one.event.record.samples - one.event.start) / len(sums)
        left.append(sums[:, 0] + own)
        noise.append(np.full(len(sums), own))
        response.append(sums[:, 1])
    return kind(fit, unit, np.concatenate(left), np.concatenate(noise), np.concatenate(response))
