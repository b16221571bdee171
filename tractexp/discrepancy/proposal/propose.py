"""The story of a proposal: screen the library at the base fit, refit the best, let held-out events
and chance judge.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tractexp.discrepancy.disagreement import Disagreement
from tractexp.discrepancy.gap import Curves
from tractexp.discrepancy.next_event.choose import NextEvent, find_next_event
from tractexp.discrepancy.proposal import generate
from tractexp.discrepancy.proposal.judge import (
    TermAssessment,
    assess_terms,
    list_tied_terms,
    measure_changes,
)
from tractexp.discrepancy.proposal.library import Term, list_terms
from tractexp.discrepancy.proposal.refit import TermFits, compute_term_errors, fit_terms
from tractexp.discrepancy.proposal.screen import ScreeningFit, compute_library_p, screen_terms
from tractexp.discrepancy.proposal.term_context import build_term_context, carry_over, list_sizes
from tractexp.identification.grade import GradedModel
from tractexp.inference.base_fit import BaseFit
from tractexp.inference.fitting import Refit
from tractexp.inference.interval import ParameterEstimate
from tractexp.inference.model_error import ModelChange
from tractexp.noise import Noise
from tractexp.noise.span import project_out
from tractexp.record import Event
from tractexp.text.wording import join_words

LEAST_ACTING_SHARE = 0.1  # of the largest change: from where a term is said to act
LOOKS_LIKE = 0.5  # of a term's change that a textbook effect could have made


@dataclass(frozen=True, eq=False)
class Proposal:
    """A term that held-out events confirm."""

    term: Term
    estimates: tuple[ParameterEstimate, ...]
    judged: TermAssessment
    # what it leaves of the fitted and of the held-out events by least squares
    changes: tuple[ModelChange[Curves], ModelChange[Curves]]
    # when it acts, a row an event: between which times of the record [s] it changes the load, in
    # which channel the most, and by how much [pu]
    acting: tuple[dict[str, Any], ...]
    # with the shares they explain on fitted and on held-out events
    ties: tuple[tuple[Term, float, float], ...]
    # textbook effects, and the share of its change that each could have made
    alike: tuple[tuple[str, float], ...]
    source: str  # of a plugin file
    next_event: NextEvent | None  # that would tell the terms apart

    @property
    def values(self) -> dict[str, float]:
        """{parameter: value} of the terms."""
        return {k.parameter.name: k.value for k in self.estimates}


@dataclass(frozen=True, eq=False)
class ProposalResult:
    """What became of the search for a term: a proposal, or the sentence why there is none."""

    proposal: Proposal | None = None
    why: str = ""
    tried: tuple[tuple[Term, TermAssessment], ...] = field(default=())


def propose(
    base: BaseFit,
    first: Disagreement,
    bare: Refit,
    noise: Noise,
    validate: Sequence[Event],
    graded: GradedModel,
    among: Sequence[Term] = (),
) -> ProposalResult:
    """Search a term for what the model lacks; `bare` is the base model's fit, `noise` that of the
    last tests, `graded` the base model as it is graded.

    `among` are the terms that are tried, by default the whole library.
    """
    context = base.context
    if not validate:
        return ProposalResult(
            why="a term is proposed only where a held-out event confirms it, and none was held out"
        )
    under = build_term_context(context)
    ground = ScreeningFit.from_coordinates(under, carry_over(under, context, bare.unit), noise)
    context.effort.say("screening a library of terms")
    screened = screen_terms(ground, among or list_terms())
    context.effort.say("refitting the most promising terms")
    result = fit_terms(
        ground, screened, [carry_over(under, context, v) for v in base.minima_but(bare.unit)[:1]]
    )
    context.effort.say("judging terms on the held-out events")
    p = [
        compute_library_p(result.term(fit), result.bare.deviance - fit.deviance, len(screened))
        for fit in result.fits
    ]
    ranked = assess_terms(context, result, validate, p)
    tried = tuple((result.term(w.fit), w) for w in ranked)
    standing = [w for w in ranked if not w.objections(context.criteria)]
    if not standing:
        objections = join_words(ranked[0].objections(context.criteria))
        return ProposalResult(
            None,
            f"of the terms tried the best is {result.term(ranked[0].fit).words}, but {objections}",
            tried,
        )
    return ProposalResult(_build_proposal(result, first, standing, validate, graded), "", tried)


def _build_proposal(
    result: TermFits,
    first: Disagreement,
    standing: Sequence[TermAssessment],
    held: Sequence[Event],
    graded: GradedModel,
) -> Proposal:
    """The proposal of the best term that stands, with those that it cannot be told from."""
    chosen, *others = standing
    term = result.term(chosen.fit)
    values = result.values(chosen.fit)
    errors = compute_term_errors(result, chosen.fit)
    estimates = tuple(
        ParameterEstimate(p, values[p.name], errors[p.name]) for p in term.parameters(values)
    )
    records = join_words([e.record.name for e in result.context.events])
    alternatives = list_tied_terms(result, chosen, others)
    return Proposal(
        term=term,
        estimates=estimates,
        judged=chosen,
        changes=measure_changes(result, chosen.fit, held, graded),
        acting=tuple(_find_acting_places(result, chosen.fit)),
        ties=tuple(
            (result.term(o.fit), o.train.explained_share, o.validate.explained_share)
            for o in alternatives
        ),
        alike=tuple(find_alike(result, chosen.fit, first)),
        source=generate.write_source(term, values, records),
        next_event=_choose_next_event(result, [chosen.fit, *(o.fit for o in alternatives)]),
    )


def _choose_next_event(result: TermFits, fits: Sequence[Refit]) -> NextEvent | None:
    """What to record to tell a term from its near-synonyms."""
    if len(fits) == 1:
        return None
    return find_next_event(
        result.context, result.noise, result.bare, fits, [result.term(fit).words for fit in fits]
    )


def change(result: TermFits, fit: Refit) -> np.ndarray:
    """What a term adds to what is calculated (C, N) [pu], all else as it was fitted with it."""
    without = result.context.coordinates.place_values(
        fit.unit, {label: 0.0 for _, label in list_sizes(result.term(fit))}
    )
    with_it, alone = result.context.residuals(np.array([fit.unit, without]), fit.names)
    return with_it - alone


def _find_acting_places(result: TermFits, fit: Refit) -> list[dict[str, Any]]:
    """Where in each event a term changes a channel by more than a tenth of the most it does."""
    context = result.context
    added = change(result, fit)
    terms = []
    for event, part in zip(context.events, context.drive.parts, strict=True):
        own = added[:, part]
        channel, _ = np.unravel_index(np.abs(own).argmax(), own.shape)
        seen = np.flatnonzero((np.abs(own) > LEAST_ACTING_SHARE * np.abs(added).max()).any(axis=0))
        if len(seen):
            t = event.record.t[event.record.samples - own.shape[1] :]
            most = float(own[channel][np.abs(own[channel]).argmax()])
            terms.append(
                {
                    "event": event.record.name,
                    "start": float(t[seen[0]]),
                    "end": float(t[seen[-1]]),
                    "channel": context.drive.names[channel],
                    "most": most,
                }
            )
    return terms


def find_alike(result: TermFits, fit: Refit, first: Disagreement) -> list[tuple[str, float]]:
    """Textbook effects that could make most of what a term changes, the base model giving way: best
    first.
    """
    context = result.context
    rows = context.whiten(result.noise, change(result, fit)[None])
    projection = first.projection
    wide = np.pad(rows, ((0, 0), (0, len(projection.Q) - rows.shape[1])))
    s = project_out(wide, projection.Q.T)[0]
    shares: dict[str, float] = {}
    for column, block in zip(projection.columns, projection.blocks, strict=True):
        gram = block @ block.T
        if np.diag(gram).max(initial=0.0) > 1e-12:
            side = block @ s
            share = float(
                side @ np.linalg.pinv(gram, rcond=1e-10, hermitian=True) @ side / max(s @ s, 1e-300)
            )
            shares[column.candidate.name] = max(shares.get(column.candidate.name, 0.0), share)
    return sorted(
        ((n, v) for n, v in shares.items() if v >= LOOKS_LIKE), key=lambda pair: -pair[1]
    )[:4]


def to_dict(proposed: ProposalResult, plugin: str) -> Mapping[str, object] | None:
    """The proposal as `discrepancy.json` has it; `plugin` is the path of its file."""
    if (proposal := proposed.proposal) is None:
        return None
    judged = ("train", proposal.judged.train), ("validate", proposal.judged.validate)
    return {
        "terms": [
            _name_term(proposal.term)
            | {
                "function_of_voltage": proposal.term.clock is None,
                "parameters": {k.parameter.name: k.plain() for k in proposal.estimates},
            }
        ],
        "explained": {role: gap.explained_share for role, gap in judged},
        "left": {role: gap.after.chi2_per_sample for role, gap in judged},
        "p": proposal.judged.p,
        "when": list(proposal.acting),
        "ties": [
            _name_term(t) | {"explained": {"train": near, "validate": held}}
            for t, near, held in proposal.ties
        ],
        "alike": dict(proposal.alike),
        "plugin": plugin,
    }


def _name_term(term: Term) -> dict[str, object]:
    """A term as machines and people call it."""
    clock = term.clock and term.clock.name
    names = {"balance": term.balance.name, "signal": term.signal.name, "clock": clock}
    return {**names, "words": term.words, "latex": term.latex}
