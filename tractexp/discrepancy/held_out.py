"""What held-out events say of explanations that were found without them."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tractexp.discrepancy.bench import Bench
from tractexp.discrepancy.cores import each_apart
from tractexp.discrepancy.criteria import Criteria
from tractexp.discrepancy.disagreement import examined
from tractexp.discrepancy.explanations import Explanations
from tractexp.discrepancy.fitting import Refit, best_of, refit, settled, wide_refit
from tractexp.discrepancy.gap import Gap, gap
from tractexp.discrepancy.noise_in_quiet import QuietNoise, white
from tractexp.discrepancy.records import Records
from tractexp.discrepancy.survivors import Rival, Survivors
from tractexp.noise import Noise
from tractexp.record import Event

Names = tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Judged:
    """The gap of one explanation on the held-out events, and the coordinates of both models there.

    `p_left` tells how often chance leaves as much as a fit to all events does, where that was asked.
    """

    gap: Gap
    bench: Bench
    units: tuple[np.ndarray, np.ndarray]
    p_left: float = 1.0

    @property
    def helps(self) -> bool:
        """Whether the explanation is worth having beyond the events it was fitted to."""
        criteria = self.bench.criteria
        least = criteria.stands if self.gap.telling else criteria.adequate_p  # a mild event denies nothing
        return self.gap.helps and self.p_left >= least

    @property
    def convincing(self) -> bool:
        """Whether it closes as much of the gap there as a true explanation does."""
        return self.gap.closed >= self.bench.criteria.convincing


@dataclass(frozen=True, eq=False)
class Together:
    """An explanation fitted to fitted and held-out events together, in coordinates of the fitted ones."""

    fit: Refit
    louder: float  # by how much all events speak louder for it than the fitted ones alone, of the deviance
    p_left: float  # how often chance leaves as much as it does

    def confirmed(self, criteria: Criteria, doubted: bool) -> bool:
        """Whether all events bear it out. Where the base model is `doubted` they need only bear with it."""
        least = -criteria.quieter if doubted else criteria.shown
        return self.louder > least and self.p_left >= criteria.adequate_p


@dataclass(frozen=True, eq=False)
class HeldOut:
    """The explanations that remain, as fitted without the faults of the measurement that do not help.

    `bare` is the base model alone, `extended` each explanation, `judged` what the held-out events say of it. Where none
    helped as it was fitted, `together` are those that were fitted to all events instead.
    """

    survivors: Survivors
    noise: Noise
    faults: Names  # of the measurement, in every explanation
    bare: Refit
    extended: Mapping[Names, Refit]
    judged: Mapping[Names, Judged] = field(default_factory=dict)
    together: tuple[Refit, ...] = ()

    @property
    def kept(self) -> tuple[Rival, ...]:
        """The adequate explanations that the held-out events do not deny."""
        helping = (
            s for s in self.survivors.adequate if s.fit.names not in self.judged or self.judged[s.fit.names].helps
        )
        of_family: dict[Names, Rival] = {}
        for rival in helping:  # the best first: places and laws of one family are told by one name
            of_family.setdefault(self.survivors.explanations.base.bench.catalogue.textbook(rival.fit.names), rival)
        return tuple(of_family.values())


def held_out(surviving: Survivors, events: Sequence[Event], seed: int) -> HeldOut:
    """Refit the survivors without needless faults of the measurement, and judge them on held-out events, if any."""
    explained = surviving.explanations
    bench, noise = explained.base.bench, explained.last.noise
    at = bench.coordinates
    bare = refit(bench, noise, [((), at.without_faults(explained.steps[0].fit.unit, ()))], faults=())[0]
    faults = telling(explained, bare)
    wanted = [(s.fit.names, at.without_faults(s.fit.unit, faults)) for s in (surviving.adequate or surviving.kept[:1])]
    exact = {f.names: f for f in refit(bench, noise, wanted, faults=faults)}
    as_fitted = HeldOut(surviving, noise, faults, bare, {names: exact[names] for names, _ in wanted})
    if not events or not any(s.fit.names or faults for s in surviving.adequate):
        return as_fitted
    count = len(surviving.adequate)
    bench.effort.say(f"judging {count} explanation{'s' * (count > 1)} on the held-out events")
    judged, again = weighed(bench, events, as_fitted, seed, doubted=not explained.steps[0].adequate)
    extended = {**as_fitted.extended, **{f.names: f for f in again}}
    return replace(as_fitted, judged=judged, together=tuple(again), extended=extended)


def telling(explained: Explanations, bare: Refit) -> Names:
    """The faults of the measurement that stand out, but for those that only mend the formula of an effect.

    Beside an effect of the load they must explain more, together with those left out before, than the part of all that
    is explained to which no formula is exact (`alike`).
    """
    bench, noise, fit, faults = explained.base.bench, explained.last.noise, explained.chosen, explained.faults
    if not fit.names:
        return faults

    def left(kept: Names) -> float:
        unit = bench.coordinates.without_faults(fit.unit, kept)
        return refit(bench, noise, [(fit.names, unit)], faults=kept)[0].deviance

    most = left(faults) if faults else 0.0
    while faults:
        fewer = {left(rest): rest for rest in itertools.combinations(faults, len(faults) - 1)}
        if min(fewer) - most > bench.criteria.alike * (bare.deviance - most):
            break
        faults = fewer[min(fewer)]
    return faults


def weighed(
    bench: Bench, events: Sequence[Event], as_fitted: HeldOut, seed: int, *, doubted: bool
) -> tuple[dict[Names, Judged], list[Refit]]:
    """Judge explanations on held-out events; where none helps as it was fitted, also those that all events confirm.

    Where the base model is `doubted` all events need only bear with them: the held-out ones may not show them at all.
    Several effects at once, chosen among hundreds of sets, must also leave nothing in a fit to all events, and so must
    a single one that closes less of the gap there than a true one does, and one of another place or law.
    """
    extended = list(as_fitted.extended.values())
    judged = judged_on(bench, events, as_fitted.bare, extended)
    helping = [fit for fit in extended if judged[fit.names].gap.helps]
    if not helping:
        fits = together(bench, events, as_fitted, extended, seed, anew=True)
        again = [fitted.fit for fitted in fits if fitted.confirmed(bench.criteria, doubted)]
        return judged | (judged_on(bench, events, as_fitted.bare, again) if again else {}), again
    found = bench.catalogue
    doubtful = [
        f for f in helping
        if len(f.names) + len(as_fitted.faults) > 1 or f.names != found.textbook(f.names)
        or not judged[f.names].convincing
    ]  # fmt: skip
    for fitted in together(bench, events, as_fitted, doubtful, seed) if doubtful else ():
        judged[fitted.fit.names] = replace(judged[fitted.fit.names], p_left=fitted.p_left)
    return judged, []


def judged_on(bench: Bench, events: Sequence[Event], bare: Refit, extended: Sequence[Refit]) -> dict[Names, Judged]:
    """Compare the base model and extended ones, as they were fitted, on held-out events."""
    other, units, noise = carried(bench, events, [bare, *extended])
    return {
        fit.names: Judged(gap(other, units[0], u, fit.names, noise, other.coordinates.before), other, (units[0], u))
        for fit, u in zip(extended, units[1:], strict=True)
    }


def carried(bench: Bench, events: Sequence[Event], fits: Sequence[Refit]) -> tuple[Bench, list[np.ndarray], Noise]:
    """Carry fits over to held-out events: everything keeps its trained value but P0 and Q0 of each event.

    Returns the bench of those events, the coordinates of each fit there, and the noise of the last one.
    """
    other, d = bench.on(Records.of(events, bench.records.window)), len(bench.coordinates.names)
    units = []
    for fit in fits:
        unit = other.coordinates.null.copy()
        unit[:d] = fit.unit[:d]
        units.append(settled(other, unit, white(other), fit.names))
    noise = QuietNoise.at(other, units[-1]).of_fit(units[-1], fits[-1].names)
    return other, [settled(other, u, noise, fit.names) for u, fit in zip(units, fits, strict=True)], noise


def together(
    bench: Bench,
    events: Sequence[Event],
    as_fitted: HeldOut,
    extended: Sequence[Refit],
    seed: int,
    *,
    anew: bool = False,
) -> list[Together]:
    """Explanations fitted to fitted and held-out events together, from every setting if `anew`.

    What the fitted events leave open, such as the level of a relay between the depths of two dips, may be wrong on
    the held-out ones though the effect is there.
    """
    whole = bench.on(Records.of((*bench.records.recorded, *events), bench.records.window))
    bare, d, before = as_fitted.bare, len(bench.coordinates.names), len(bench.coordinates.before)
    plain = _widened(whole, bare.unit)
    quiet = QuietNoise.at(whole, plain)
    noise = as_fitted.noise.on(whole.profile, quiet.blur)
    first = refit(whole, noise, [((), plain)], faults=())[0]

    def refitted(fit: Refit) -> list[Refit]:
        start, settings = _widened(whole, fit.unit), _settings(whole, fit.names) if anew else [{}]
        wanted = [(fit.names, whole.coordinates.placed(start, setting)) for setting in settings]
        return (wide_refit if anew else refit)(whole, noise, wanted, as_fitted.faults)

    def told(fit: Refit) -> Together:
        alone = next(e for e in extended if e.names == fit.names)
        louder = (first.deviance - fit.deviance) - (bare.deviance - alone.deviance)
        p_left = examined(quiet, fit, noise, seed, plain=True).p_left
        unit = np.r_[fit.unit[:d], fit.unit[whole.coordinates.before][:before]]
        return Together(replace(fit, unit=unit), louder, p_left)

    return each_apart(told, best_of(better for fit in extended for better in refitted(fit)))


def _widened(bench: Bench, unit: np.ndarray) -> np.ndarray:
    """Coordinates of the fitted events as those of a bench with more events after them."""
    wide = bench.coordinates.null.copy()
    wide[: len(unit)] = unit
    return wide


def _settings(bench: Bench, names: Sequence[str]) -> list[dict[str, float]]:
    """No change, and every setting of the scanned parameters of one of the effects."""
    return [{}, *itertools.chain.from_iterable(bench.catalogue[name].settings for name in names)]
