"""Everything that an investigation found, and what follows of it."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from tractexp.discrepancy.classes import EffectClass, compare_predictions, describe_classes
from tractexp.discrepancy.decide import (
    NONE,
    TIED,
    UNEXPLAINED,
)
from tractexp.discrepancy.disagreement import Disagreement
from tractexp.discrepancy.evidence import Evidence, Verdict
from tractexp.discrepancy.explain import explain
from tractexp.discrepancy.explanations import Explanations
from tractexp.discrepancy.gap import GapTest, compute_gap, share_gone
from tractexp.discrepancy.grades import Grader
from tractexp.discrepancy.nearest import Nearest, measure_least_error
from tractexp.discrepancy.next_event.choose import NextEvent
from tractexp.discrepancy.overlay import (
    Overlay,
    draw_graded,
    overlay_fit,
    overlay_fitted,
    overlay_held_out,
)
from tractexp.discrepancy.places import DisagreementInterval
from tractexp.discrepancy.precision import list_estimates
from tractexp.discrepancy.proposal.propose import ProposalResult
from tractexp.discrepancy.rest import RemainingShapes, find_shapes, share_of
from tractexp.identification.conclude import list_at_bound
from tractexp.identification.grade import GradedModel
from tractexp.identification.unrecorded_course import find_course
from tractexp.identification.unrecorded_input import list_unrecorded_inputs
from tractexp.identification.verdict import UNIDENTIFIED, choose_scale
from tractexp.inference.base_fit import BaseFit
from tractexp.inference.catalogue import Catalogue
from tractexp.inference.context import Context
from tractexp.inference.fitting import Refit
from tractexp.inference.interval import ParameterEstimate
from tractexp.inference.model_error import ModelChange, ModelMisfit
from tractexp.inference.noise_in_quiet import QuietNoise
from tractexp.parameter import Parameter
from tractexp.record import Event
from tractexp.text.wording import join_words

HELD = "held"  # the verdict on a parameter that the extended model does not search
LEAST_SIZE = 1e-3  # of its range: an effect whose sizes are nearer to their null is not there


@dataclass(frozen=True, eq=False)
class Findings:
    """Everything found, step by step."""

    base: BaseFit
    places: tuple[DisagreementInterval, ...]  # where it is; none where the verdict is none
    explanations: Explanations
    by_likelihood: Evidence
    evidence: Evidence  # the same, or by what sets predict where none leaves noise only
    verdict: Verdict
    nearest: Nearest | None  # where nothing explains
    train: GapTest  # on the fitted events
    withheld: tuple[Event, ...]  # the held-out events
    grader: Grader
    # of a term, where nothing explains
    proposed: ProposalResult = field(default_factory=ProposalResult)
    tie_breaker: NextEvent | None = None  # that would tell tied sets apart
    # whether the held-out events were fitted like the others, since only all show something
    all_fitted: bool = False

    @property
    def context(self) -> Context:
        """The events and models of the fit that was examined first."""
        return self.first.context

    @property
    def catalogue(self) -> Catalogue:
        """The effects that could be tested, and those that could not."""
        return self.context.catalogue

    @property
    def names(self) -> tuple[str, ...]:
        """The effects added."""
        return self.verdict.names

    @functools.cached_property
    def reason(self) -> str:
        """The sentence behind the verdict."""
        sentence = explain(
            self.verdict,
            self.evidence,
            self.nearest,
            self.explanations.base.context,
            all_fitted=self.all_fitted,
        )
        classes = self.effect_classes
        return f"{sentence}; {describe_classes(classes)}" if classes else sentence

    @functools.cached_property
    def effect_classes(self) -> tuple[EffectClass, ...]:
        """The sets that are tied, by what no dip tells apart, and the dip from which they part;
        none where none are tied.
        """
        if self.verdict.word != TIED:
            return ()
        context = self.explanations.base.context
        fits = [row.reported_fit for row in self.verdict.kept]
        error = measure_least_error(self.verdict, self.evidence, context)
        return compare_predictions(context, fits, self.verdict.sets, error)

    @property
    def first(self) -> Disagreement:
        """The tests of the base model."""
        assert self.evidence.base.tests is not None
        return self.evidence.base.tests

    @property
    def last(self) -> Disagreement:
        """The tests once the chosen effects are in."""
        assert self.evidence.last is not None
        return self.evidence.last

    @property
    def tests(self) -> Disagreement:
        """The tests of the model that the investigation ends with."""
        chosen = self.verdict.chosen
        return self.first if chosen is None else chosen.tests or self.last

    @functools.cached_property
    def contributions(self) -> list[tuple[tuple[str, ...], float]]:
        """Names, from none to all of them, one more at a time, and the model's error with them."""
        if not self.names:
            return []
        steps: list[tuple[str, ...]] = [(), self.names]
        if self.evidence.is_predicted:
            steps = [row.fit.names for row in self.evidence.contributions(self.names)]
        return [(names, self.select_misfit(self.grade_of(names)).error.value) for names in steps]

    @property
    def bare(self) -> Refit:
        """The base model alone."""
        return self.evidence.base.fit

    @property
    def extended_fit(self) -> Refit:
        """The model with the names of the verdict added; the base model where there are none."""
        chosen = self.verdict.chosen
        return self.bare if chosen is None else chosen.reported_fit

    @property
    def next_event(self) -> NextEvent | None:
        """What to record next, where explanations are tied or the proposed term has
        near-synonyms.
        """
        proposal = self.proposed.proposal
        return self.tie_breaker or (proposal and proposal.next_event)

    @functools.cached_property
    def validate(self) -> GapTest | None:
        """The gap on the held-out events; None without any, or where nothing is named."""
        chosen = self.verdict.chosen
        there = self.evidence.there
        if chosen is None or there is None:
            return chosen and chosen.gap
        units = [row.held_out_prediction.unit for row in (self.evidence.base, chosen)]
        left = there.residual(units[1], chosen.fit.names)
        noise = QuietNoise.from_context(there, units[1]).estimate_noise(units[1], left)
        return compute_gap(
            there, units[0], units[1], chosen.fit.names, noise, there.coordinates.before
        )

    @functools.cached_property
    def undetermined_values(self) -> dict[str, float]:
        """Parameters of the extended model that the events cannot tell (to half their size), at the
        values found.
        """
        if not self.names:
            return {}
        return {
            e.parameter.name: e.value
            for e in self.final_estimates
            if e.verdict.startswith(UNIDENTIFIED)
            or e.half > choose_scale(e.value, *e.parameter.bounds) / 2
        }

    @property
    def open_sizes(self) -> tuple[str, ...]:
        """Parameters of what was added, of the graded model, that rest on a bound, in words; and
        the sizes of an effect of which no size is known better than its bounds.
        """
        graded = self.final_grade
        own = {p.name: p for p in self.catalogue.parameters(self.names)}
        values = self._final_values
        told = [
            f"{name} rests on its bound, {values[name]:.4g}"
            for name in list_at_bound(graded.problem, graded.values)
            if name in own and is_end_of_range(own[name], values[name])
        ]
        unknown = {
            e.parameter.name for e in self.final_estimates if e.verdict.startswith(UNIDENTIFIED)
        }
        for name in self.names:
            sizes = [p.name for p in self.catalogue.sizes([name])]
            if unknown.issuperset(sizes):
                told.append(f"of {join_words(sizes)} the events know no more than the bounds")
        return tuple(told)

    @property
    def _final_values(self) -> dict[str, float]:
        """The values that the graded model searched, by name."""
        graded = self.final_grade
        return dict(zip(graded.problem.space.names, graded.values.tolist(), strict=True))

    @property
    def is_absent(self) -> bool:
        """Whether all sizes of what was added are at their null in the graded model: then that is
        the base model.
        """
        values = self._final_values
        sizes = self.catalogue.sizes(self.names)
        return all(
            p.name in values and abs(values[p.name] - p.absent) < LEAST_SIZE * np.ptp(p.bounds)
            for p in sizes
        )

    @property
    def window(self) -> float | str | None:
        """The recorder's window that was taken into account, as `model.window` names it."""
        return self.context.window

    @property
    def base_grade(self) -> GradedModel:
        """The base model as it was given, as an identification grades it."""
        return self.grader.grade((), self.grader.base.window)

    @property
    def final_grade(self) -> GradedModel:
        """The model that the investigation ends with, as an identification grades it."""
        return self.grade_of(self.names)

    def grade_of(self, names: Sequence[str]) -> GradedModel:
        """The base model with some of the names added, graded with all that the extended model has
        beside them.
        """
        if not self.names:  # a window is part of the model where nothing is missing behind it
            is_none = self.verdict.word == NONE
            return self.grader.grade((), self.window) if is_none else self.base_grade
        if not names:
            return self.base_grade
        held = self._select_held(names)
        at = self.context.coordinates
        found = (
            {name: at.value(name, self.extended_fit.unit) for name in at.names}
            if names == self.names
            else {}
        )
        return self.grader.grade(names, self.window, held, found, fit_all=self.fitted_to_both)

    def _select_held(self, names: Sequence[str]) -> dict[str, float]:
        """The values that the extended model holds, but those of effects other than `names`."""
        others = self.catalogue.parameters([name for name in self.names if name not in names])
        own = {p.name for p in others}
        return {name: value for name, value in self.undetermined_values.items() if name not in own}

    def misfits(self, graded: GradedModel) -> tuple[ModelMisfit, ModelMisfit | None]:
        """How far off a graded model is on the events that were to be fitted, and on those held
        out.
        """
        split = len(self.grader.train)
        fitted = graded.fits[:split]
        held_out = graded.fits[split:]
        return ModelMisfit.from_played(fitted), ModelMisfit.from_played(
            held_out
        ) if held_out else None

    def select_misfit(self, graded: GradedModel) -> ModelMisfit:
        """How far off a graded model is on the held-out events; on the fitted ones where there
        are none.
        """
        fitted, held_out = self.misfits(graded)
        return held_out or fitted

    @property
    def graded_change(self) -> ModelChange[ModelMisfit]:
        """What the graded models leave of the held-out events; of the fitted ones where there are
        none.
        """
        return ModelChange(
            self.select_misfit(self.base_grade), self.select_misfit(self.final_grade)
        )

    @functools.cached_property
    def final_estimates(self) -> list[ParameterEstimate]:
        """The parameters of the model that the investigation ends with."""
        return list_estimates(self.tests, self.extended_fit.unit, self.names)

    @functools.cached_property
    def overlays(self) -> list[Overlay]:
        """Measured, before and after of every event, the fitted ones first."""
        near = self.nearest
        extended = bool(self.names)
        return [
            *overlay_fitted(self.context, self.train, near, self.places, extended=extended),
            *overlay_held_out(self.context, self.withheld, self.validate, self.bare, near),
        ]

    @property
    def graded_overlays(self) -> list[Overlay]:
        """Measured, before and after of every event, as the graded models calculate them."""
        return draw_graded(self.overlays, self.base_grade, self.final_grade if self.names else None)

    @functools.cached_property
    def graded_parameters(self) -> list[ParameterEstimate]:
        """The parameters of the model that the investigation ends with, as it is graded: those
        searched, then those that it holds.
        """
        declared = {p.name: p for p in self.final_grade.problem.model.parameters}
        held = [
            ParameterEstimate(declared[name], value, np.nan, HELD)
            for name, value in self.undetermined_values.items()
        ]
        return [*self.final_grade.parameters, *held]

    @functools.cached_property
    def unrecorded_course(self) -> dict[str, Any]:
        """The course of an input that nobody recorded which explains what no effect does, and the
        `remedy`; {} where there is none, or where an effect explains it.
        """
        if self.verdict.word != UNEXPLAINED:
            return {}
        uncertainty, courses = self.base_grade.uncertainty, list[dict[str, Any]]()
        for missing in list_unrecorded_inputs():
            if missing.is_unknown(uncertainty.likelihood.problem):
                course = find_course(uncertainty, missing)
                courses += [course | {"remedy": missing.remedy}] if course else []
        return min(courses, key=lambda course: course["error"], default={})

    @functools.cached_property
    def rest(self) -> RemainingShapes:
        """What is left where it is more than noise, in shapes."""
        noise = self.last.noise
        level = self.context.criteria.false_alarms
        overlays = [] if self.verdict.complete else self.overlays
        of_best = find_shapes(overlays, noise, level)
        alone: list[Sequence[Overlay]] = []
        if not self.names:
            alone.append([replace(overlay, nearest=None) for overlay in self.overlays])
            if self.by_likelihood is not self.evidence:
                alone.append(overlay_fit(self.context, self.by_likelihood.base.fit, noise))
        of_base = [find_shapes(overlays, noise, level) for overlays in alone]
        return RemainingShapes(of_best, max(of_base, key=share_of, default=[]))

    @property
    def headline(self) -> str:
        """What is left in one sentence; "" where nothing is."""
        withheld = [event.record.name for event in self.withheld]
        return self.rest.describe(self.names, withheld, has_nearest=self.nearest is not None)

    @property
    def base_values(self) -> np.ndarray:
        """The free parameters of the base model (n, d), alone and as the model that the
        investigation ends with.
        """
        fits = np.stack([self.bare.unit, self.extended_fit.unit])
        return self.context.kernels.bare.space.from_unit(fits[:, self.context.coordinates.base])

    @property
    def fitted_to_both(self) -> bool:
        """Whether the extended model was fitted to the held-out events, too."""
        return self.all_fitted or any(row.is_fitted_to_all for row in self.verdict.kept)

    @property
    def closes_share(self) -> bool:
        """Whether one set alone is kept and closes a share of the model's error on the fitted
        events.
        """
        if len(self.verdict.kept) != 1:
            return False
        return self.graded_change.closed_share >= share_gone(self.context.criteria.ahead)


def is_end_of_range(parameter: Parameter, value: float) -> bool:
    """Whether the bound that a parameter of an effect rests on is where the search ended and not
    where nature does: no time, level or margin is below 0.
    """
    nearest = min(parameter.bounds, key=lambda bound: abs(bound - value))
    is_natural = nearest in parameter.natural_ends or (parameter.null is None and nearest == 0)
    return not is_natural
