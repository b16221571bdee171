"""What held-out events say of explanations that were found without them."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tractexp.discrepancy.all_events import AllEvents
from tractexp.discrepancy.disagreement import Disagreement
from tractexp.discrepancy.explanations import Explanations
from tractexp.discrepancy.gap import GapTest, beyond_chance, gap, pushed, share_gone
from tractexp.discrepancy.prediction import Predictions
from tractexp.discrepancy.survivors import Rival, Survivors
from tractexp.inference.context import Context
from tractexp.inference.fitting import Names, Refit, refit, settled
from tractexp.inference.noise_in_quiet import QuietNoise, white
from tractexp.inference.records import Records
from tractexp.noise import Noise
from tractexp.record import Event


@dataclass(frozen=True, eq=False)
class Assessment:
    """The gap of one explanation on the held-out events, and the coordinates of both models there.

    `explained` is the deviance that it explains of the fitted events. `of_member` is the same against the explanation
    without each of several effects. Where it was fitted to all events, `p_left` tells how often chance leaves as much,
    and `behind` whether the best explanation there rejects it.
    """

    gap: GapTest
    context: Context
    units: tuple[np.ndarray, np.ndarray]
    explained: float = 0.0
    of_member: Mapping[str, "Assessment"] = field(default_factory=dict)
    p_left: float = 1.0
    behind: bool = False

    @property
    def evident(self) -> bool:
        """Whether the held-out events show it, or are too mild to and the fitted ones leave no doubt."""
        return self.gap.helps or (self.gap.open and self.explained >= self.context.criteria.evident)

    @property
    def needless(self) -> list[str]:
        """Those of several effects without which it explains as much."""
        return [name for name, one in self.of_member.items() if not one.evident]

    @property
    def borne_out(self) -> bool:
        """Whether it and each of its effects are evident."""
        return self.evident and not self.needless

    @property
    def helps(self) -> bool:
        """Whether the explanation is worth having beyond the events it was fitted to."""
        return self.borne_out and self.p_left >= self.context.criteria.adequate_p and not self.behind

    @property
    def convincing(self) -> bool:
        """Whether it closes as much of the gap there as a true explanation does."""
        return self.gap.explained >= share_gone(self.context.criteria.divides)


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The explanations that remain, as fitted without the faults of the measurement that do not help.

    `bare` is the base model alone, `extended` each explanation, `assessments` are of held-out events; `first` and
    `last` have the tests of the base model and of the best set. Where none helped as it was fitted, `together` are
    those that were fitted to all events instead. Where none leaves noise only, the survivors are those that predict the
    held-out events well (`leaves_more`), by their `predictions`.
    """

    survivors: Survivors
    first: Disagreement
    last: Disagreement
    noise: Noise  # under which all were fitted
    faults: Names  # of the measurement, in every explanation
    bare: Refit
    extended: Mapping[Names, Refit]
    assessments: Mapping[Names, Assessment] = field(default_factory=dict)
    together: tuple[Refit, ...] = ()
    predictions: Predictions | None = None
    p_of_all: float = 1.0  # how often chance leaves as much as the base model does of all events, where that was asked

    @property
    def leaves_more(self) -> bool:
        """Whether what is retained leaves more than noise."""
        return self.predictions is not None

    @property
    def shows_more(self) -> bool:
        """Whether all events show something where the fitted ones show nothing."""
        return self.p_of_all < self.first.criteria.adequate_p

    @property
    def open(self) -> bool:
        """Whether the held-out events are too mild for all that explains the fitted ones."""
        return bool(self.assessments) and all(one.gap.open for one in self.assessments.values())

    @property
    def retained(self) -> tuple[Rival, ...]:
        """The adequate explanations that the held-out events do not deny, or those that predict them best."""
        if self.leaves_more:
            return self.survivors.retained
        assessments, adequate = self.assessments, self.survivors.adequate
        helping = {s.fit.names for s in adequate if s.fit.names not in assessments or assessments[s.fit.names].helps}
        of_family: dict[Names, Rival] = {}
        for rival in (s for s in adequate if s.fit.names in helping):  # places and laws of a family: by the best's name
            of_family.setdefault(self.survivors.explanations.base.context.catalogue.textbook(rival.fit.names), rival)
        return tuple(of_family.values())

    def names_of(self, rival: Rival) -> Names:
        """The effects of an explanation, with the faults of the measurement beside it."""
        return tuple(sorted((*rival.fit.names, *self.faults)))


def held_out(surviving: Survivors, events: Sequence[Event], seed: int) -> HeldOut:
    """Refit the survivors without needless faults of the measurement, and judge them on held-out events, if any."""
    explained = surviving.explanations
    context, noise = explained.base.context, explained.last.noise
    at = context.coordinates
    bare = refit(context, noise, [((), at.without_faults(explained.steps[0].fit.unit, ()))], faults=())[0]
    faults = telling(explained, bare)
    wanted = [
        (s.fit.names, at.without_faults(s.fit.unit, faults)) for s in (surviving.adequate or surviving.retained[:1])
    ]
    exact = {f.names: f for f in refit(context, noise, wanted, faults=faults)}
    extended = {names: exact[names] for names, _ in wanted}
    as_fitted = HeldOut(surviving, explained.steps[0], explained.last, noise, faults, bare, extended)
    if not events:
        return as_fitted
    both = AllEvents(context, events, noise, faults, bare, explained.refits)
    if not any(s.fit.names or faults for s in surviving.adequate):
        silent = context.domain.calibrated and explained.empty and explained.steps[0].adequate
        if silent and exceeds_noise(both):
            return replace(as_fitted, p_of_all=both.p_left(explained.base.local_minima, seed))
        return as_fitted
    count = len(surviving.adequate)
    context.effort.say(f"judging {count} explanation{'s' * (count > 1)} on the held-out events")
    assessments, again = assess(both, extended, seed)
    joint = {fit.names: fit for fit in again}
    return replace(as_fitted, assessments=assessments, together=tuple(again), extended={**extended, **joint})


def telling(explained: Explanations, bare: Refit) -> Names:
    """The faults of the measurement that stand out, but for those that only mend the formula of an effect.

    Beside an effect of the load they must explain more, together with those left out before, than the part of all that
    is explained to which no formula is exact (`mended`).
    """
    context, noise, fit, faults = explained.base.context, explained.last.noise, explained.chosen, explained.faults
    if not fit.names:
        return faults

    def left(retained: Names) -> float:
        unit = context.coordinates.without_faults(fit.unit, retained)
        return refit(context, noise, [(fit.names, unit)], faults=retained)[0].deviance

    most = left(faults) if faults else 0.0
    while faults:
        fewer = {left(rest): rest for rest in itertools.combinations(faults, len(faults) - 1)}
        if context.criteria.stands_out(min(fewer) - most, bare.deviance - most):
            break
        faults = fewer[min(fewer)]
    return faults


def assess(both: AllEvents, extended: Mapping[Names, Refit], seed: int) -> tuple[dict[Names, Assessment], list[Refit]]:
    """Judge explanations on held-out events, and all that are doubtful or have a rival by a fit to all events, too.

    Of several effects each is judged against the others alone as the whole is against the base model. A single textbook
    effect that has no rival stands if it closes as much of the gap there as a true one does. Any other must leave
    nothing in a fit to all events and not be rejected there by the best one. That fit may also bear out what does not
    help as it was fitted, or leaves more than chance does, since the fitted events may leave a part of it open; it is
    returned as fitted to all.
    """
    context, criteria, fits = both.fitted, both.fitted.criteria, list(extended.values())
    without = {fit.names: both.without_each(fit) for fit in fits}

    def against(bare: Refit, alone: Refit, some: Sequence[Refit]) -> dict[Names, Assessment]:
        there = judged_on(context, both.events, bare, some)
        return {n: replace(one, explained=alone.deviance - extended[n].deviance) for n, one in there.items()}

    def judged(some: Sequence[Refit], fewer: Mapping[Names, Mapping[str, Refit]]) -> dict[Names, Assessment]:
        there = against(both.bare, both.bare, some)
        for fit in some:
            alone, rest = without[fit.names], fewer[fit.names]
            of_member = {name: against(rest[name], alone[name], [fit])[fit.names] for name in rest}
            there[fit.names] = replace(there[fit.names], of_member=of_member)
        return there

    assessments = judged(fits, without)
    if both.undoubted(fits) and assessments[fits[0].names].convincing and assessments[fits[0].names].helps:
        return assessments, []
    joint = {t.fit.names: t for t in both.compared(fits, seed)}
    best = min(t.fit.cost for t in joint.values())
    helping = {names for names, one in assessments.items() if one.borne_out}
    sufficing = {names for names in helping if assessments[names].gap.left <= criteria.shown}
    for names, fitted in joint.items():
        behind = criteria.rejects(fitted.fit.cost - best)
        assessments[names] = replace(assessments[names], p_left=fitted.p_left, behind=behind)
    again = [
        fitted.fit for names, fitted in joint.items()
        if names not in sufficing and not assessments[names].behind and fitted.confirmed(criteria)
    ]  # fmt: skip
    joint_without = {fit.names: both.fitted_to_all(without[fit.names]) for fit in again}
    return assessments | (judged(again, joint_without) if again else {}), again


def exceeds_noise(both: AllEvents) -> bool:
    """Whether perturbations of the base model would gain more on the held-out events than noise leaves there."""
    there, (unit,), noise = carried(both.fitted, both.events, [both.bare])
    left = beyond_chance(there, unit, (), noise, there.coordinates.before, pushed(there, unit, (), noise))
    return left > both.fitted.criteria.shown


def judged_on(
    context: Context, events: Sequence[Event], bare: Refit, extended: Sequence[Refit]
) -> dict[Names, Assessment]:
    """Compare a model and extended ones, as they were fitted, on held-out events, by the noise of the last."""
    other, units, noise = carried(context, events, [bare, *extended])
    before = other.coordinates.before
    return {
        fit.names: Assessment(gap(other, units[0], u, fit.names, noise, before, bare.names), other, (units[0], u))
        for fit, u in zip(extended, units[1:], strict=True)
    }


def carried(
    context: Context, events: Sequence[Event], fits: Sequence[Refit]
) -> tuple[Context, list[np.ndarray], Noise]:
    """Carry fits over to held-out events: everything keeps its trained value but P0 and Q0 of each event.

    Returns the context of those events, the coordinates of each fit there, and the noise of the last one that has a
    steady state there.
    """
    other = context.on(Records.of(events, context.records.window))
    at = other.coordinates.at_measured_power
    units = [settled(other, at(fit.unit), white(other), fit.names) for fit in fits]
    noise = white(other)
    for unit, fit in zip(reversed(units), reversed(fits), strict=True):
        if np.isfinite(left := other.residuals(unit[None], fit.names)[0]).all():
            noise = QuietNoise.at(other, unit).of(unit, left)
            break
    return other, [settled(other, u, noise, fit.names) for u, fit in zip(units, fits, strict=True)], noise
