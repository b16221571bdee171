"""Fitted and held-out events together, and explanations fitted to all of them.

What the fitted events leave open, such as the level of a relay between the depths of two dips, may
be wrong on the held-out ones though the effect is there.
"""

import functools
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tractexp.discrepancy.disagreement import examine_base_fit, examine_fit
from tractexp.inference.base_fit import fit_from_starts
from tractexp.inference.context import Context
from tractexp.inference.cores import map_on_cores
from tractexp.inference.fitting import (
    Names,
    Refit,
    key_by_names,
    leave_each_out,
    refit,
    select_best_fits,
)
from tractexp.inference.noise_in_quiet import QuietNoise
from tractexp.inference.wide_fit import refit_widely
from tractexp.noise import Noise
from tractexp.record import Event

# a set fitted to all events, in coordinates of the fitted ones; how often chance leaves as much
JointFit = tuple[Refit, float]


@dataclass(frozen=True, eq=False)
class AllEvents:
    """The context of all events beside that of the fitted ones, with the `noise` and the base model
    `bare` there.

    `faults` are those of the measurement in every explanation, `refits` all sets that were fitted
    to the fitted events.
    """

    fitted: Context
    events: Sequence[Event]  # held out
    noise: Noise
    faults: Names
    bare: Refit
    refits: Mapping[Names, Refit] = field(default_factory=dict)

    @functools.cached_property
    def context(self) -> Context:
        """The context of all events, those held out among them."""
        return self.fitted.move_to_events((*self.fitted.records.recorded, *self.events))

    @functools.cached_property
    def quiet(self) -> QuietNoise:
        """The noise of all events' quiet stretches, beside the base model as it was fitted
        alone.
        """
        return QuietNoise.from_context(
            self.context, self.context.coordinates.widen_coordinates(self.bare.unit)
        )

    @functools.cached_property
    def level(self) -> Noise:
        """The noise of all events."""
        return self.noise.apply_to_events(self.context.problem.power, self.quiet.input_modes)

    @functools.cached_property
    def plain(self) -> Refit:
        """The base model, fitted to all events."""
        return refit(
            self.context,
            self.level,
            [((), self.context.coordinates.widen_coordinates(self.bare.unit))],
            faults=(),
        )[0]

    def fit_jointly(
        self, alone: Sequence[Refit], seed: int, *, anew: bool = False
    ) -> list[JointFit]:
        """Explanations as fitted to the fitted events `alone`, fitted to all: from there, or from
        every setting.
        """
        effort = self.context.effort
        _ = self.plain  # once, before processes are forked
        refitted = map_on_cores(lambda fit: self._refit(fit, anew=anew), alone, effort)
        fits = select_best_fits(itertools.chain(*refitted))
        return map_on_cores(lambda fit: self._test(fit, seed), fits, effort)

    def compare(self, alone: Sequence[Refit], seed: int) -> list[JointFit]:
        """Sets fitted to all events from where they were; what leaves something there, or would be
        rejected beside another, is fitted from every setting, too.
        """
        joint = {one[0].names: one for one in self.fit_jointly(alone, seed)}
        waiting = list(alone)
        while doubtful := self._select_doubtful(waiting, joint):
            for fit, p_left in self.fit_jointly(doubtful, seed, anew=True):
                if fit.cost < joint[fit.names][0].cost:
                    joint[fit.names] = fit, p_left
            waiting = [fit for fit in waiting if fit not in doubtful]
        return list(joint.values())

    def _select_doubtful(
        self, fits: Sequence[Refit], joint: Mapping[Names, JointFit]
    ) -> list[Refit]:
        """Those whose joint fit leaves more than chance does, or would be rejected beside the best
        of all.
        """
        criteria = self.fitted.criteria
        least = min(fit.cost for fit, _ in joint.values())
        doubtful = {
            names
            for names, (fit, p_left) in joint.items()
            if p_left < criteria.false_alarms or criteria.rejects(fit.cost - least)
        }
        return [fit for fit in fits if fit.names in doubtful]

    def without_each(self, fit: Refit) -> dict[str, Refit]:
        """{member: fit} of a set without each of its effects, to the fitted events.

        Each begins from where the set fits, and from where it was found.
        """
        if len(fit.names) < 2:
            return {}
        fewer = leave_each_out(self.fitted, fit)
        at = self.fitted.coordinates
        there = [self.refits[names] for names, _ in fewer if names in self.refits]
        found = [(f.names, at.without_faults(f.unit, self.faults)) for f in there]
        fits = refit(self.fitted, self.noise, [*fewer, *found], self.faults)
        by_names = key_by_names(fits)
        return {left: by_names[names] for left, (names, _) in zip(fit.names, fewer, strict=True)}

    def fit_to_all(self, fits: Mapping[str, Refit]) -> dict[str, Refit]:
        """{member: fit} of given fits, fitted to all events."""
        joint = {
            key: select_best_fits(self._refit(fit, anew=False))[0] for key, fit in fits.items()
        }
        return {key: replace(fit, unit=self._narrow(fit)) for key, fit in joint.items()}

    def p_left(self, local_minima: Sequence[np.ndarray], seed: int) -> float:
        """How often chance leaves as much of all events as the base model does; 1 where it has no
        steady state there.

        The fits begin at `local_minima` (D,), those on the fitted events.
        """
        if not np.isfinite(self.plain.deviance):
            return 1.0
        wide = [
            self.context.coordinates.widen_coordinates(minimum)
            for minimum in (self.bare.unit, *local_minima)
        ]
        return examine_base_fit(fit_from_starts(self.context, wide, wide[1:]), seed).p_left

    def _refit(self, alone: Refit, *, anew: bool) -> list[Refit]:
        """A set fitted to all events, from where it was fitted alone; `anew` from every setting of
        its scanned parameters, too.
        """
        at = self.context.coordinates
        settings = list[Mapping[str, float]]([{}])
        if anew:  # from every setting of the scanned parameters of one of the effects, too
            settings += itertools.chain.from_iterable(
                self.context.catalogue[name].settings for name in alone.names
            )
        wanted = [
            (alone.names, at.place_values(at.widen_coordinates(alone.unit), setting))
            for setting in settings
        ]
        return (refit_widely if anew else refit)(self.context, self.level, wanted, self.faults)

    def _narrow(self, fit: Refit) -> np.ndarray:
        """The coordinates of a fit without the held-out events' own."""
        return fit.unit[: self.fitted.coordinates.dimension]

    def measure_loudness(self, joint: Refit, alone: Refit) -> float:
        """By how much all events speak louder for a set, fitted to them, than the fitted ones alone
        do, of the deviance.
        """
        return (self.plain.deviance - joint.deviance) - (self.bare.deviance - alone.deviance)

    def _test(self, fit: Refit, seed: int) -> JointFit:
        """A set on all events, and p of what it leaves."""
        p_left = examine_fit(self.quiet, fit, self.level, seed).p_left
        return replace(fit, unit=self._narrow(fit)), p_left
