"""The whole investigation, from records to a verdict, in the eight steps of
docs/missing-effects.md.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tractexp.discrepancy.classes import EffectClass, compare_predictions, describe_classes
from tractexp.discrepancy.decide import (
    NONE,
    TIED,
    UNEXPLAINED,
    Verdict,
    chose_by_all,
    decide,
    shows_more,
)
from tractexp.discrepancy.disagreement import Disagreement, disagreement
from tractexp.discrepancy.evidence import Evidence
from tractexp.discrepancy.explain import (
    Nearest,
    choose_next_event,
    explain,
    find_nearest_sets,
    measure_least_error,
)
from tractexp.discrepancy.explanations import Explanations, explanations
from tractexp.discrepancy.gap import GapTest, gap, share_gone
from tractexp.discrepancy.grades import Grader
from tractexp.discrepancy.held_out import judge_held_out
from tractexp.discrepancy.next_event.choose import NextEvent
from tractexp.discrepancy.overlay import (
    Overlay,
    draw_graded,
    find_remainder,
    of_fit,
    on_fitted,
    on_held_out,
)
from tractexp.discrepancy.places import DisagreementInterval, places
from tractexp.discrepancy.precision import estimates
from tractexp.discrepancy.prediction import predict_held_out
from tractexp.discrepancy.proposal.propose import ProposalResult, propose
from tractexp.discrepancy.remainder import Remainder
from tractexp.discrepancy.replication import replicate
from tractexp.discrepancy.rival_sets import compare_rivals
from tractexp.discrepancy.window_search import behind_recorder
from tractexp.domain import domain_of
from tractexp.identification.frequency_course import (
    FREQUENCY_SWING,
    FrequencyCourse,
    find_course,
    is_frequency_unknown,
)
from tractexp.identification.grade import GradedModel
from tractexp.identification.result import at_bound
from tractexp.identification.verdict import UNIDENTIFIED, size
from tractexp.inference.base_fit import BaseFit, base_fit
from tractexp.inference.catalogue import Catalogue, catalogue
from tractexp.inference.context import Context
from tractexp.inference.criteria import Criteria
from tractexp.inference.effort import Effort
from tractexp.inference.fitting import Refit
from tractexp.inference.interval import ParameterEstimate
from tractexp.inference.model_error import Change, Misfit
from tractexp.inference.noise_in_quiet import QuietNoise
from tractexp.inference.problem import Problem
from tractexp.inference.records import Records, check_events
from tractexp.model.model import Model
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
        left = there.residuals(units[1][None], chosen.fit.names)[0]
        noise = QuietNoise.from_context(there, units[1]).estimate_noise(units[1], left)
        return gap(there, units[0], units[1], chosen.fit.names, noise, there.coordinates.before)

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
            if e.verdict.startswith(UNIDENTIFIED) or e.half > size(e.value, *e.parameter.bounds) / 2
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
            for name in at_bound(graded.problem, graded.values)
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
        found = self.context.records.window
        return self.context.load.window if found is None else found.setting

    @property
    def base_grade(self) -> GradedModel:
        """The base model as it was given, as an identification grades it."""
        return self.grader.grade_base()

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

    def misfits(self, graded: GradedModel) -> tuple[Misfit, Misfit | None]:
        """How far off a graded model is on the events that were to be fitted, and on those held
        out.
        """
        split = len(self.grader.train)
        fitted = graded.fits[:split]
        held_out = graded.fits[split:]
        return Misfit.from_played(fitted), Misfit.from_played(held_out) if held_out else None

    def select_misfit(self, graded: GradedModel) -> Misfit:
        """How far off a graded model is on the held-out events; on the fitted ones where there
        are none.
        """
        fitted, held_out = self.misfits(graded)
        return held_out or fitted

    @property
    def graded_change(self) -> Change[Misfit]:
        """What the graded models leave of the held-out events; of the fitted ones where there are
        none.
        """
        return Change(self.select_misfit(self.base_grade), self.select_misfit(self.final_grade))

    @functools.cached_property
    def final_estimates(self) -> list[ParameterEstimate]:
        """The parameters of the model that the investigation ends with."""
        return estimates(self.tests, self.extended_fit.unit, self.names)

    @functools.cached_property
    def overlays(self) -> list[Overlay]:
        """Measured, before and after of every event, the fitted ones first."""
        near = self.nearest
        extended = bool(self.names)
        return [
            *on_fitted(self.context, self.train, near, self.places, extended=extended),
            *on_held_out(self.context, self.withheld, self.validate, self.bare, near),
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
    def frequency_course(self) -> FrequencyCourse | None:
        """The course of a frequency that nobody recorded which explains what no effect does; None
        where there is none, or where an effect explains it.
        """
        uncertainty = self.base_grade.uncertainty
        unknown = is_frequency_unknown(uncertainty.likelihood.problem)
        if not unknown or self.verdict.word != UNEXPLAINED:
            return None
        return find_course(uncertainty, FREQUENCY_SWING)

    @functools.cached_property
    def remainder(self) -> list[Remainder]:
        """What is left where it is more than noise, the loudest first: shapes in what the best
        model leaves.

        On the held-out events only where the fitted ones show none: what explains those may not
        hold beyond them.
        """
        return [] if self.verdict.complete else self._find_remainder(self.overlays)

    @functools.cached_property
    def remainder_of_base(self) -> list[Remainder]:
        """The shapes in what the base model alone leaves, for the nearest candidates may have
        patched something up.

        It is as least squares fit it or as the likelihood does, by whichever shapes tell more:
        least squares spread over a record what happens at one moment.
        """
        if self.names:
            return []
        alone = [
            self._find_remainder([replace(overlay, nearest=None) for overlay in self.overlays])
        ]
        if self.by_likelihood is not self.evidence:
            alone.append(
                self._find_remainder(
                    of_fit(self.context, self.by_likelihood.base.fit, self.last.noise)
                )
            )
        return max(alone, key=_share_of)

    @property
    def headline(self) -> str:
        """What is left in one sentence: the loudest shape of the model whose remainder shapes
        describe best.
        """
        if self.names and self.remainder:
            return f"beside {join_words(self.names)} this is left: {self.remainder[0]}"
        remainders_left = [
            (shapes, base)
            for shapes, base in ((self.remainder, False), (self.remainder_of_base, True))
            if shapes
        ]
        if not remainders_left:
            return ""
        shapes, base = max(remainders_left, key=lambda item: _share_of(item[0]))
        held_out = shapes[0].event in {event.record.name for event in self.withheld}
        base |= self.nearest is None
        whose = "the base model misses this" if base else "the nearest candidates miss this"
        where = " on the held-out events" if held_out else ""
        return f"{whose}{where}: {shapes[0]}"

    def _find_remainder(self, overlays: Sequence[Overlay]) -> list[Remainder]:
        """The shapes in what is left of the fitted events, else of those held out."""
        noise = self.last.noise
        level = self.context.criteria.false_alarms
        fitted, beyond = ([o for o in overlays if o.held_out == there] for there in (False, True))
        return find_remainder(fitted, noise, level) or find_remainder(
            beyond, replace(noise, input_modes=None), level
        )

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
    return parameter.null is not None or nearest != 0


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
    """Find where model and records disagree, name what is missing, add it, and measure the gap.

    Parameters
    ----------
    model : Model
        The base model.
    train, validate : sequences of Event
        The events that are fitted, and those that are held out to judge what is found.
    bounds : {name: (lower, upper)}
        Of the base model's parameters, in their units.
    fixed : {name: value}
        Parameters that are held.
    only : names
        The effects that are tested; none: all.
    substeps : int or None
        Runge-Kutta steps per sample; None: as many as needed.
    criteria : Criteria or None
        The thresholds of the decisions.
    priors : bool
        Whether the motor is held to what machines usually are, where more than noise is left.
    shown : names
        Effects that the base model has because its records show them.
    search : Problem -> (d,)
        The free values at which an identification's search ends; None: there is no search.
    seed : int
        The same seed gives the same bits.
    tell : line -> None
        Called at each stage.

    Returns
    -------
    Findings

    Raises
    ------
    UserError
        For wrong events or names.
    """
    criteria = criteria or Criteria()
    train, validate = (domain_of(model).events(events) for events in (train, validate))
    check_events(train, validate)

    def findings_of(train: Sequence[Event], validate: Sequence[Event]) -> Findings:
        missing = catalogue(model, train, only)
        some = len(missing.candidates)
        others = len(missing.untestable)
        effort.say(f"testing {some} effects, {others} more cannot be tested on these events")

        given = (
            model,
            missing,
            Records.from_events(train),
            bounds or {},
            fixed or {},
            criteria,
            effort,
        )
        context = Context.from_records(*given, substeps, priors=priors)
        grader = Grader(
            model,
            missing,
            tuple(train),
            tuple(validate),
            bounds or {},
            fixed or {},
            substeps,
            priors,
            shown,
            search,
        )
        findings = _findings(base_fit(context), validate, seed, grader)
        if context.kernels.too_coarse(findings.base_values):
            effort.say("the fits lie where the motor is fast: again with shorter steps")
            finer = Context.from_records(*given, context.kernels.box_substeps, priors=priors)
            findings = _findings(base_fit(finer), validate, seed, grader)
        return findings

    with Effort(tell).audible() as effort:
        findings = findings_of(train, validate)
        if findings.verdict.word == UNEXPLAINED and shows_more(findings.evidence, criteria):
            effort.say("only all events together show something: again, fitted to all of them")
            of_all = findings_of([*train, *validate], ())
            findings = (
                replace(of_all, grader=findings.grader, all_fitted=True)
                if of_all.closes_share
                else findings
            )
        return replace(findings, proposed=_proposal(findings, seed))


def _findings(base: BaseFit, validate: Sequence[Event], seed: int, grader: Grader) -> Findings:
    """The investigation from the base model's fit to the verdict."""
    base, first = behind_recorder(base, disagreement(base, seed), seed)
    explained = explanations(base, first, seed)
    criteria = explained.last.criteria
    evidence = compare_rivals(explained, seed)
    evidence = by_likelihood = judge_held_out(evidence, explained, validate, seed)
    verdict = decide(evidence, criteria)
    is_open = evidence.is_mild or shows_more(evidence, criteria)
    if verdict.word == UNEXPLAINED and validate and not is_open:
        evidence = predict_held_out(explained, validate, seed) or by_likelihood
    findings = _conclude(explained, by_likelihood, evidence, validate, grader)
    if len(findings.verdict.kept) != 1:
        return findings
    if evidence.is_predicted or not findings.is_absent:
        return _complete_row(findings, validate)
    chosen, without = findings.verdict.kept[0], grader.grade((), findings.window)
    rows = [replace(row, is_absent=row is chosen) for row in evidence.rows]
    base_row = replace(evidence.base, grade=str(without.adequacy.grade))
    evidence = replace(evidence, base=base_row, rows=tuple(rows))
    return _conclude(explained, by_likelihood, evidence, validate, grader)


def _conclude(
    explained: Explanations,
    by_likelihood: Evidence,
    evidence: Evidence,
    validate: Sequence[Event],
    grader: Grader,
) -> Findings:
    """The findings of a table of evidence."""
    tests, verdict = evidence.base.tests, decide(evidence, explained.last.criteria)
    assert tests is not None
    return Findings(
        base=explained.base,
        places=() if verdict.word == NONE else tuple(places(tests)),
        explanations=explained,
        by_likelihood=by_likelihood,
        evidence=evidence,
        verdict=verdict,
        nearest=find_nearest_sets(verdict, evidence, validate),
        train=_gap(tests.context, evidence, verdict),
        withheld=tuple(validate),
        grader=grader,
        tie_breaker=choose_next_event(verdict, evidence, explained.base.context),
    )


def _complete_row(findings: Findings, validate: Sequence[Event]) -> Findings:
    """The findings decided anew with the grade of the model that has the one set kept, and with
    what each event says of it that is left out, where all took part in choosing it.
    """
    evidence = findings.evidence
    chosen = findings.verdict.kept[0]
    grade = str(findings.final_grade.adequacy.grade)
    row = replace(chosen, grade=grade, open_sizes=findings.open_sizes)
    if chose_by_all(chosen, evidence):
        told = replicate(
            findings.base.context, validate, evidence.base.fit, chosen.reported_fit, evidence.faults
        )
        if told:
            least = float(np.min([one.least_share for one in told]))
            row = replace(row, replicated_share=least)
    rows = tuple(row if one is chosen else one for one in evidence.rows)
    evidence = replace(evidence, rows=rows)
    return replace(findings, evidence=evidence, verdict=decide(evidence, findings.context.criteria))


def _proposal(findings: Findings, seed: int) -> ProposalResult:
    """The term that an unexplained disagreement asks for."""
    base, explained, evidence = findings.base, findings.explanations, findings.by_likelihood
    if findings.verdict.word != UNEXPLAINED:
        return ProposalResult()
    if evidence.is_mild:
        return ProposalResult(why="the held-out events are too mild to show a term")
    return propose(
        base, explained.steps[0], evidence.base.fit, explained.last.noise, findings.withheld, seed
    )


def _share_of(shapes: Sequence[Remainder]) -> float:
    """The share of what is left that these shapes make up."""
    return sum(shape.share for shape in shapes)


def _gap(context: Context, evidence: Evidence, verdict: Verdict) -> GapTest:
    """The gap on the fitted events before and after."""
    at, chosen, base = context.coordinates, verdict.chosen, evidence.base.fit
    after = chosen.reported_fit if chosen else base
    tests = (chosen and chosen.tests) or evidence.last
    assert tests is not None
    fitted = [*at.base, *at.before, *at.parameters(verdict.names)]
    return gap(context, base.unit, after.unit, after.names, tests.noise, fitted)
