"""The whole investigation, from records to a verdict, in the eight steps of
docs/missing-effects.md.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from tractexp.discrepancy.decide import (
    NONE,
    UNEXPLAINED,
    chose_by_all,
    decide,
    shows_more,
)
from tractexp.discrepancy.disagreement import examine_base_fit
from tractexp.discrepancy.evidence import Evidence, Verdict
from tractexp.discrepancy.explain import choose_next_event
from tractexp.discrepancy.explanations import Explanations, find_explanations
from tractexp.discrepancy.findings import Findings
from tractexp.discrepancy.gap import GapTest, compute_gap
from tractexp.discrepancy.grades import Grader
from tractexp.discrepancy.held_out import judge_held_out
from tractexp.discrepancy.nearest import find_nearest_sets
from tractexp.discrepancy.places import find_disagreement_intervals
from tractexp.discrepancy.prediction import predict_held_out
from tractexp.discrepancy.proposal.propose import ProposalResult, propose
from tractexp.discrepancy.replication import replicate
from tractexp.discrepancy.rival_sets import compare_rivals
from tractexp.discrepancy.window_search import search_recorder_window
from tractexp.domain import find_domain
from tractexp.inference.base_fit import BaseFit, fit_base_model
from tractexp.inference.catalogue import build_catalogue
from tractexp.inference.context import Context
from tractexp.inference.criteria import Criteria
from tractexp.inference.effort import Effort
from tractexp.inference.problem import Problem
from tractexp.inference.records import Records, check_events
from tractexp.model.model import Model
from tractexp.record import Event


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
    train, validate = (find_domain(model).events(events) for events in (train, validate))
    check_events(train, validate)

    def findings_of(train: Sequence[Event], validate: Sequence[Event]) -> Findings:
        missing = build_catalogue(model, train, only)
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
        findings = _take_steps(fit_base_model(context), validate, seed, grader)
        if context.kernels.too_coarse(findings.base_values):
            effort.say("the fits lie where the motor is fast: again with shorter steps")
            finer = Context.from_records(*given, context.kernels.box_substeps, priors=priors)
            findings = _take_steps(fit_base_model(finer), validate, seed, grader)
        return findings

    with Effort(tell).tell_when_silent() as effort:
        findings = findings_of(train, validate)
        if findings.verdict.word == UNEXPLAINED and shows_more(findings.evidence, criteria):
            effort.say("only all events together show something: again, fitted to all of them")
            of_all = findings_of([*train, *validate], ())
            findings = (
                replace(of_all, grader=findings.grader, all_fitted=True)
                if of_all.closes_share
                else findings
            )
        return replace(findings, proposed=_find_proposal(findings))


def _take_steps(base: BaseFit, validate: Sequence[Event], seed: int, grader: Grader) -> Findings:
    """The investigation from the base model's fit to the verdict."""
    base, first = search_recorder_window(base, examine_base_fit(base, seed), seed)
    explained = find_explanations(base, first, seed)
    criteria = explained.last.criteria
    evidence = compare_rivals(explained, seed)
    evidence = by_likelihood = judge_held_out(evidence, explained, validate, seed)
    verdict = decide(evidence, criteria)
    is_open = evidence.is_mild or shows_more(evidence, criteria)
    if verdict.word == UNEXPLAINED and validate and not is_open:
        evidence = predict_held_out(explained, grader, seed) or by_likelihood
    findings = _conclude(explained, by_likelihood, evidence, validate, grader)
    if len(findings.verdict.kept) != 1:
        return findings
    if evidence.is_predicted or not findings.is_absent:
        return _complete_row(findings, validate)
    chosen = findings.verdict.kept[0]
    without = grader.grade((), findings.window)
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
    tests = evidence.base.tests
    verdict = decide(evidence, explained.last.criteria)
    assert tests is not None
    return Findings(
        base=explained.base,
        places=() if verdict.word == NONE else tuple(find_disagreement_intervals(tests)),
        explanations=explained,
        by_likelihood=by_likelihood,
        evidence=evidence,
        verdict=verdict,
        nearest=find_nearest_sets(verdict, evidence, validate),
        train=_compute_gap(tests.context, evidence, verdict),
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
        least = replicate(
            findings.base.context, validate, evidence.base.fit, chosen.reported_fit, evidence.faults
        )
        row = replace(row, replicated_share=least)
    rows = tuple(row if one is chosen else one for one in evidence.rows)
    evidence = replace(evidence, rows=rows)
    return replace(findings, evidence=evidence, verdict=decide(evidence, findings.context.criteria))


def _find_proposal(findings: Findings) -> ProposalResult:
    """The term that an unexplained disagreement asks for."""
    base = findings.base
    explained = findings.explanations
    evidence = findings.by_likelihood
    if findings.verdict.word != UNEXPLAINED:
        return ProposalResult()
    if evidence.is_mild:
        return ProposalResult(why="the held-out events are too mild to show a term")
    return propose(
        base,
        explained.steps[0],
        evidence.base.fit,
        explained.last.noise,
        findings.withheld,
        findings.grader.grade((), base.context.window),
    )


def _compute_gap(context: Context, evidence: Evidence, verdict: Verdict) -> GapTest:
    """The gap on the fitted events before and after."""
    at = context.coordinates
    chosen = verdict.chosen
    base = evidence.base.fit
    after = chosen.reported_fit if chosen else base
    tests = (chosen and chosen.tests) or evidence.last
    assert tests is not None
    fitted = [*at.base, *at.before, *at.parameters(verdict.names)]
    return compute_gap(context, base.unit, after.unit, after.names, tests.noise, fitted)
