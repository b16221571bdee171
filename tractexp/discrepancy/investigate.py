"""The whole investigation, from records to a verdict, in the eight steps of docs/missing-effects.md."""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tractexp.discrepancy.criteria import Criteria
from tractexp.discrepancy.disagreement import Disagreement, disagreement
from tractexp.discrepancy.explanations import Explanations, explanations
from tractexp.discrepancy.gap import GapTest, gap
from tractexp.discrepancy.grades import Grader
from tractexp.discrepancy.held_out import Assessment, HeldOut, held_out
from tractexp.discrepancy.incomplete import incomplete
from tractexp.discrepancy.next_event.choose import NextEvent
from tractexp.discrepancy.overlay import Overlay, left, of_fit, on_fitted, on_held_out
from tractexp.discrepancy.places import DisagreementInterval, places
from tractexp.discrepancy.precision import estimates
from tractexp.discrepancy.proposal.propose import ProposalResult, propose
from tractexp.discrepancy.remainder import Remainder
from tractexp.discrepancy.survivors import Survivors, survivors
from tractexp.discrepancy.verdict import NAMED, NONE, UNEXPLAINED, Verdict, verdict, word_of
from tractexp.discrepancy.window_search import behind_recorder
from tractexp.domain import domain_of
from tractexp.identification.grade import GradedModel, Misfit
from tractexp.identification.verdict import UNIDENTIFIED, size
from tractexp.inference.base_fit import BaseFit, base_fit
from tractexp.inference.catalogue import Catalogue, catalogue
from tractexp.inference.context import Context
from tractexp.inference.effort import Effort
from tractexp.inference.fitting import Refit
from tractexp.inference.interval import ParameterEstimate
from tractexp.inference.problem import Problem
from tractexp.inference.records import Records, check_events
from tractexp.model.model import Model
from tractexp.record import Event
from tractexp.wording import joined


@dataclass(frozen=True, eq=False)
class Findings:
    """Everything found, step by step."""

    base: BaseFit
    places: tuple[DisagreementInterval, ...]  # where it is; none where the verdict is none
    explanations: Explanations
    survivors: Survivors
    by_likelihood: HeldOut
    held_out: HeldOut  # the same, or by least squares where names go by the model's error
    verdict: Verdict
    train: GapTest  # on the fitted events
    withheld: tuple[Event, ...]  # the held-out events
    grader: Grader
    proposed: ProposalResult = field(default_factory=ProposalResult)  # of a term, where nothing explains
    all_fitted: bool = False  # whether the held-out events were fitted like the others, since only all show something

    @property
    def context(self) -> Context:
        return self.first.context

    @property
    def catalogue(self) -> Catalogue:
        return self.context.catalogue

    @property
    def names(self) -> tuple[str, ...]:
        """The effects added."""
        return self.verdict.names

    @property
    def first(self) -> Disagreement:
        """The tests of the base model."""
        return self.held_out.first

    @property
    def last(self) -> Disagreement:
        """The tests once the chosen effects are in."""
        return self.held_out.last

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
        predicted, ends = self.held_out.predictions, [(), self.names]
        sets = ends if predicted is None else [one.names for one in predicted.contributions(self.names)]
        return [(names, self.judged(self.grade_of(names)).error.value) for names in sets]

    @property
    def bare(self) -> Refit:
        """The base model alone."""
        return self.held_out.bare

    @property
    def extended(self) -> Refit:
        """The model with the names of the verdict added; the base model where there are none."""
        chosen = self.verdict.chosen
        return self.bare if chosen is None else self.held_out.extended[chosen.fit.names]

    @property
    def next_event(self) -> NextEvent | None:
        """What to record next, where explanations are tied or the proposed term has near-synonyms."""
        proposal = self.proposed.proposal
        return self.verdict.next_event or (proposal and proposal.next_event)

    @property
    def assessment(self) -> Assessment | None:
        """What the held-out events say of the names."""
        chosen = self.verdict.chosen
        return chosen and self.held_out.assessments.get(chosen.fit.names)

    @property
    def validate(self) -> GapTest | None:
        """The gap on the held-out events."""
        return None if self.assessment is None else self.assessment.gap

    @functools.cached_property
    def held(self) -> dict[str, float]:
        """Parameters of the extended model that the events cannot tell (to half their size), at the values found."""
        if not self.names:
            return {}
        return {
            e.parameter.name: e.value
            for e in self.after
            if e.verdict.startswith(UNIDENTIFIED) or e.half > size(e.value, *e.parameter.bounds) / 2
        }

    @property
    def window(self) -> float | str | None:
        """The recorder's window that was taken into account, as `model.window` names it."""
        found = self.context.records.window
        return self.context.load.window if found is None else found.setting

    @property
    def base_grade(self) -> GradedModel:
        """The base model as it was given, as an identification grades it."""
        return self.grader.grade_base()

    @property
    def final_grade(self) -> GradedModel:
        """The same of the model that the investigation ends with."""
        return self.grade_of(self.names)

    def grade_of(self, names: Sequence[str]) -> GradedModel:
        """The base model with some of the names added, graded with all that the extended model has beside them."""
        if not self.names:
            return self.grader.grade((), self.window)
        if not names:
            return self.base_grade
        own = {p.name for p in self.catalogue.parameters([name for name in self.names if name not in names])}
        held = {name: value for name, value in self.held.items() if name not in own}
        return self.grader.grade(names, self.window, held, fit_all=self.fitted_to_both)

    def misfits(self, graded: GradedModel) -> tuple[Misfit, Misfit | None]:
        """How far off a graded model is on the events that were to be fitted, and on those that were to be held out."""
        split = len(self.grader.train)
        fitted, held_out = graded.fits[:split], graded.fits[split:]
        return Misfit.of(fitted), Misfit.of(held_out) if held_out else None

    def judged(self, graded: GradedModel) -> Misfit:
        """The same on the held-out events, where there are any."""
        fitted, held_out = self.misfits(graded)
        return held_out or fitted

    @functools.cached_property
    def before(self) -> list[ParameterEstimate]:
        """The parameters of the base model alone."""
        return estimates(self.first, self.bare.unit, ())

    @functools.cached_property
    def after(self) -> list[ParameterEstimate]:
        """The parameters of the model that the investigation ends with."""
        return estimates(self.tests, self.extended.unit, self.names)

    @functools.cached_property
    def overlays(self) -> list[Overlay]:
        """Measured, before and after of every event, the fitted ones first."""
        near, extended = self.verdict.nearest, bool(self.names)
        return [
            *on_fitted(self.context, self.train, near, self.places, extended=extended),
            *on_held_out(self.context, self.withheld, self.assessment, self.bare, near),
        ]

    @functools.cached_property
    def remainder(self) -> list[Remainder]:
        """What is left where it is more than noise, the loudest first: shapes in what the best model leaves.

        On the held-out events only where the fitted ones show none: what explains those may not hold beyond them.
        """
        return [] if self.verdict.complete else self._left(self.overlays)

    @functools.cached_property
    def remainder_of_base(self) -> list[Remainder]:
        """The same of what the base model alone leaves: the nearest candidates may have patched something up.

        As least squares fit it or as the likelihood does, by whichever shapes tell more: least squares spread over a
        record what happens at one moment.
        """
        if self.names:
            return []
        alone = [self._left([replace(overlay, nearest=None) for overlay in self.overlays])]
        if self.by_likelihood is not self.held_out:
            alone.append(self._left(of_fit(self.context, self.by_likelihood.bare, self.last.noise)))
        return max(alone, key=_share_of)

    @property
    def headline(self) -> str:
        """What is left in one sentence: the loudest shape of the model whose remainder shapes describe best."""
        if self.names and self.remainder:
            return f"beside {joined(self.names)} this is left: {self.remainder[0]}"
        remainders_left = [
            (shapes, base) for shapes, base in ((self.remainder, False), (self.remainder_of_base, True)) if shapes
        ]
        if not remainders_left:
            return ""
        shapes, base = max(remainders_left, key=lambda item: _share_of(item[0]))
        held_out = shapes[0].event in {event.record.name for event in self.withheld}
        base |= self.verdict.nearest is None
        whose = "the base model misses this" if base else "the nearest candidates miss this"
        return f"{whose}{' on the held-out events' * held_out}: {shapes[0]}"

    def _left(self, overlays: Sequence[Overlay]) -> list[Remainder]:
        noise, level = self.last.noise, self.context.criteria.false_alarms
        fitted, beyond = ([o for o in overlays if o.held_out == there] for there in (False, True))
        return left(fitted, noise, level) or left(beyond, replace(noise, input_modes=None), level)

    @property
    def base_values(self) -> np.ndarray:
        """The free parameters of the base model (n, d), alone and as the model that the investigation ends with."""
        fits = np.stack([self.bare.unit, self.extended.unit])
        return self.context.kernels.bare.space.from_unit(fits[:, self.context.coordinates.base])

    @property
    def fitted_to_both(self) -> bool:
        """Whether the extended model was fitted to the held-out events, too."""
        return self.all_fitted or bool(self.held_out.together and self.held_out.retained)

    @property
    def evident(self) -> bool:
        """Whether one set of names explains so much of the fitted events that no held-out one need show it."""
        word, chosen = self.verdict.word, self.verdict.chosen
        return word == NAMED and chosen is not None and chosen.lowered >= self.context.criteria.evident


def investigate(
    model: Model,
    train: Sequence[Event],
    validate: Sequence[Event] = (),
    bounds: Mapping[str, Sequence[float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    *,
    only: Sequence[str] = (),
    substeps: int | None = None,
    criteria: Criteria | None = None,
    priors: bool = False,
    shown: Sequence[str] = (),
    search: Callable[[Problem], np.ndarray] | None = None,
    seed: int = 0,
    tell: Callable[[str], None] = lambda line: None,
) -> Findings:
    """Find where model and records disagree, name what is missing, add it, and measure how the gap shrinks.

    `bounds` {name: (lower, upper)} and `fixed` {name: value} are of the base model's parameters, `only` names the
    effects that are tested (none: all), `substeps` the Runge-Kutta steps per sample (None: as many as needed).

    Of grades are `priors`, `shown`, effects that the base model has because its records show them, and `search`, which
    gives the free values (d,) that an identification's search ends at. Raises `UserError` for wrong events or names.
    """
    criteria = criteria or Criteria()
    train, validate = (domain_of(model).events(events) for events in (train, validate))
    check_events(train, validate)

    def findings_of(train: Sequence[Event], validate: Sequence[Event]) -> Findings:
        missing = catalogue(model, train, only, criteria.frequency_swing)
        some, others = len(missing.candidates), len(missing.untestable)
        effort.say(f"testing {some} effects, {others} more cannot be tested on these events")

        given = model, missing, Records.of(train), bounds or {}, fixed or {}, criteria, effort
        context = Context.of(*given, substeps)
        grader = Grader(
            model, missing, tuple(train), tuple(validate), bounds or {}, fixed or {}, substeps, priors, shown, search
        )
        findings = _findings(base_fit(context), validate, seed, grader)
        if context.kernels.too_coarse(findings.base_values):
            effort.say("the fits lie where the motor is fast: again with shorter steps")
            finer = Context.of(*given, context.kernels.box_substeps)
            findings = _findings(base_fit(finer), validate, seed, grader)
        return findings

    with Effort(tell).audible() as effort:
        findings = findings_of(train, validate)
        if findings.verdict.word == UNEXPLAINED and findings.held_out.shows_more:
            effort.say("only all events together show something: again, fitted to all of them")
            of_all = findings_of([*train, *validate], ())
            findings = _without_confirmation(of_all, findings) if of_all.evident else findings
        return replace(findings, proposed=_proposal(findings, seed))


def _without_confirmation(findings: Findings, before: Findings) -> Findings:
    """The same, where events were fitted that were to be held out, as they were `before`."""
    why = "only all events together show it, so all were fitted, and none is left to confirm it"
    said = replace(findings.verdict, reason=f"{findings.verdict.reason}; {why}")
    return replace(findings, verdict=said, grader=before.grader, all_fitted=True)


def _findings(base: BaseFit, validate: Sequence[Event], seed: int, grader: Grader) -> Findings:
    """The investigation from the base model's fit to the verdict."""
    base, first = behind_recorder(base, disagreement(base, seed), seed)
    explained = explanations(base, first, seed)
    outcome = by_likelihood = held_out(survivors(explained, seed), validate, seed)
    if word_of(outcome) == UNEXPLAINED and not outcome.open:
        outcome = incomplete(outcome, validate, seed)
    said = verdict(outcome, validate)
    return Findings(
        base=explained.base,
        places=() if said.word == NONE else tuple(places(outcome.first)),
        explanations=explained,
        survivors=outcome.survivors,
        by_likelihood=by_likelihood,
        held_out=outcome,
        verdict=said,
        train=_gap(outcome.first.context, outcome, said),
        withheld=tuple(validate),
        grader=grader,
    )


def _proposal(findings: Findings, seed: int) -> ProposalResult:
    """The term that an unexplained disagreement asks for."""
    base, explained, outcome = findings.base, findings.explanations, findings.by_likelihood
    if findings.verdict.word != UNEXPLAINED:
        return ProposalResult()
    if outcome.open:
        return ProposalResult(why="the held-out events are too mild to show a term")
    return propose(base, explained.steps[0], outcome.bare, explained.last.noise, findings.withheld, seed)


def _share_of(shapes: Sequence[Remainder]) -> float:
    """The share of what is left that these shapes make up."""
    return sum(shape.share for shape in shapes)


def _gap(context: Context, outcome: HeldOut, said: Verdict) -> GapTest:
    """The gap on the fitted events before and after."""
    at = context.coordinates
    chosen = said.chosen
    after = outcome.extended[chosen.fit.names] if chosen else outcome.bare
    noise = ((chosen and chosen.tests) or outcome.last).noise
    fitted = [*at.base, *at.before, *at.parameters(said.names)]
    return gap(context, outcome.bare.unit, after.unit, after.names, noise, fitted)
