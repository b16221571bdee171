"""What to do next, in a sentence."""

import numpy as np

from tractexp.discrepancy.decide import CANDIDATE, NAMED, TIED, UNEXPLAINED, shows_more
from tractexp.discrepancy.findings import Findings
from tractexp.discrepancy.gap import SPREAD
from tractexp.discrepancy.proposal.generate import PLUGIN
from tractexp.errors import DATA
from tractexp.identification.adequacy import Grade
from tractexp.text.wording import join_words


def recommend_next(investigation: Findings) -> str:
    """What to do next, one sentence."""
    chosen = investigation.next_event
    if course := investigation.unrecorded_course:
        return f"{course['remedy']}: {course['sentence']}"
    if chosen is not None and investigation.verdict.word == TIED:
        return chosen.sentence()
    if (proposal := investigation.proposed.proposal) is not None:
        sentence = f"ask what on site acts like {proposal.term.words}; {PLUGIN} adds it to a model"
        return sentence if chosen is None else f"{sentence}; {chosen.sentence()}"
    if investigation.verdict.word == UNEXPLAINED:
        return _recommend_for_rest(investigation)
    grade = investigation.final_grade.adequacy.grade
    if investigation.verdict.word == CANDIDATE and grade is not Grade.WRONG_MODEL:
        return recommend_confirmation(investigation)
    if investigation.verdict.word in (NAMED, CANDIDATE):
        return _recommend_use(investigation)
    if investigation.evidence.is_predicted:
        return "use the base model: what it misses is no difference to anyone"
    return (
        "use the base model; what is missing, if anything, is below the limits given for each"
        " effect"
    )


def _recommend_use(investigation: Findings) -> str:
    """What to do next with the extended model."""
    if investigation.final_grade.adequacy.grade is not Grade.ADEQUATE:
        return (
            "find what is missing still: by further events, or with the extended model as the"
            " base model"
        )
    held = investigation.undetermined_values
    rest = f"; these events cannot tell {join_words(list(held))}, which it holds" if held else ""
    return f"use the extended model{rest}; judge it on further events as they come"


def _recommend_for_rest(investigation: Findings) -> str:
    """What to do next where something is missing that no effect and no term explains."""
    if investigation.by_likelihood.is_mild:
        return "hold out a deeper dip, one of those fitted or a new one"
    if shows_more(investigation.by_likelihood, investigation.context.criteria):
        return f"fit the held-out events, too ({DATA.train})"
    return "look at what is left (unexplained.csv) and at what switched at that time"


def recommend_confirmation(findings: Findings) -> str:
    """Which event would confirm a candidate, as a sentence."""
    names = join_words(findings.names)
    evidence = findings.evidence
    if evidence.is_predicted:
        every = [*findings.context.events, *findings.withheld]
        deepest = max(every, key=lambda event: event.depth).record.name
        return (
            f"record a further dip as deep as {deepest} and hold it out, too: those held out took"
            f" part in choosing {names}"
        )
    expected = np.array(findings.train.by_event)
    most = float(expected.max())
    shown = findings.context.criteria.shown
    deepest = findings.context.events[int(expected.argmax())].record.name
    if most - SPREAD * most**0.5 < shown:
        return (
            f"record a deeper dip than those fitted and hold it out: none of them shows {names} by"
            " itself"
        )
    gain = (
        f"{names}, if right, gains a deviance of about {most:.0f} there, and {shown:g} confirms it"
    )
    if len(expected) > 1 and not findings.all_fitted:
        return f"hold out {deepest}, or a further dip as deep: {gain}"
    return f"record a further dip as deep as {deepest} and hold it out: {gain}"
