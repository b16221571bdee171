"""The model that an investigation ends with: what it is good for, in the words of an identification, and what it holds.

Parameters that the events cannot tell are held at the values found, and told: a model is no better known for having
more of them.
"""

from dataclasses import replace

from tractexp.discrepancy.investigate import Findings
from tractexp.discrepancy.verdict import NONE, TIED
from tractexp.identification.adequacy import Adequacy, Grade, Surprise, graded, loudest_stretch
from tractexp.identification.verdict import UNIDENTIFIED, size


def adequacy(findings: Findings) -> Adequacy:
    """The grade of the extended model, or of the base model where nothing is named, on all events."""
    tests = findings.tests
    ratio, where = loudest_stretch(tests.projection.channels(findings.context.problem)[0], findings.context.problem)
    p = tests.p_left if findings.names else min(tests.p_left, findings.held_out.p_of_all)
    p = 1.0 if findings.verdict.word == NONE else p  # no disagreement: by the same false-alarm rate
    surprise = Surprise(p, tests.loudest, ratio, where)
    held_out = findings.validate and findings.validate.after.error
    grade = graded(surprise, findings.train.after.error, held_out, least_p=findings.context.criteria.adequate_p)
    if grade.grade is Grade.ADEQUATE and findings.verdict.word == TIED:
        return replace(grade, sentence="it describes these events with any of the sets named; which is missing is open")
    return grade


def held(findings: Findings) -> dict[str, float]:
    """Parameters of the extended model that the events cannot tell (to half their size), at the values found."""
    if not findings.names:
        return {}
    return {
        e.parameter.name: e.value
        for e in findings.after
        if e.verdict.startswith(UNIDENTIFIED) or e.half > size(e.value, *e.parameter.bounds) / 2
    }
