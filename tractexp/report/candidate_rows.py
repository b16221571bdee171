"""Every candidate by its evidence: how much it explains, what became of it, how large it is, and
why.
"""

from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.decide import NONE, TIED, UNEXPLAINED
from tractexp.discrepancy.evidence import SetEvidence
from tractexp.discrepancy.explain import find_status
from tractexp.discrepancy.findings import Findings
from tractexp.discrepancy.judgement import judge_effects
from tractexp.discrepancy.precision import estimate_effect_sizes
from tractexp.inference.chance import format_drawn_p
from tractexp.inference.interval import ParameterEstimate
from tractexp.text.wording import join_words

CHOSEN = "added"
FITTED, ONE_STEP = "refitted", "one step"


@dataclass(frozen=True)
class CandidateRow:
    """One candidate, of one or more effects. `drop` is by how much it lowers the deviance of the
    base model, nan where that cannot be told; `how` tells whether it was refitted for that or
    estimated in one linear step.
    """

    names: tuple[str, ...]
    drop: float
    how: str
    status: str
    sizes: tuple[ParameterEstimate, ...]
    why: str

    @property
    def rank(self) -> int:
        """0 for what was added, 1 for what is tied with it, 2 for the rest."""
        return {CHOSEN: 0, TIED: 1}.get(self.status, 2)


def list_candidates(findings: Findings) -> list[CandidateRow]:
    """All candidates: what was added first, then what is tied with it, then the others; the most
    helpful first.
    """
    sets = [_tell_set(findings, row) for row in findings.evidence.rows if row.names]
    tested = {row.names for row in sets}  # of the chosen size
    rows = [*sets, *(row for row in _list_singles(findings) if row.names not in tested)]
    return sorted(rows, key=lambda row: (row.rank, -np.nan_to_num(row.drop, nan=-1.0), row.names))


def find_chance_level(findings: Findings) -> float:
    """The drop of the deviance from which a name is given: chance gives it to the best of all in 2
    % of cases.
    """
    from scipy.special import chdtri

    return float(
        chdtri(1, findings.first.chance.critical_p(findings.context.criteria.naming_false_alarms))
    )


def explain_other_than_steepest(findings: Findings) -> str:
    """Where the verdict is not the effect that a single linear step favours: one sentence why; ""
    otherwise.
    """
    scores = findings.first.scores
    if (
        not scores
        or scores[0].drop < find_chance_level(findings)
        or findings.names == (scores[0].name,)
    ):
        return ""
    best = scores[0]
    promise = f"{best.name} promises most in one linear step from the base model"
    row = next(
        (r for r in list_candidates(findings) if r.names == (best.name,) and r.how == FITTED), None
    )
    if row is not None:
        promise += f" (deviance lowered by {best.drop:.0f}; refitted, by {row.drop:.0f})"
    if findings.verdict.word == TIED and (best.name,) in findings.verdict.sets:
        return f"{promise}, and is one of the tied explanations."
    if findings.verdict.word in (NONE, UNEXPLAINED):
        return (
            f"{promise}, but that does not make it an explanation:"
            f" {_tell_verdict(findings, best.name)}."
        )
    chosen = next(r for r in list_candidates(findings) if r.rank == 0)
    return (
        f"{promise}, yet the verdict is {join_words(findings.names)}, which lowers the deviance by"
        f" {chosen.drop:.0f}: {_tell_verdict(findings, best.name)}."
    )


def describe_untestable_beside(findings: Findings) -> str:
    """Why an effect that helps the base model may be called not testable: one sentence; "" where
    nothing is added.
    """
    chosen = findings.last.fit.names
    if not chosen:
        return ""
    return (
        f"With {join_words(chosen)} in the model there is less left for the others to explain: one"
        " that helps the base model alone may here be irrelevant, or not testable because a size"
        " that matters would stay in the noise."
    )


def _tell_verdict(findings: Findings, name: str) -> str:
    """The verdict on one effect, as the end of a sentence."""
    row = next((r for r in list_candidates(findings) if r.names == (name,)), None)
    if row is None:
        return "it was not refitted alone"
    return f"it is {row.why}" if row.status == "relevant" else f"it is {row.status}: {row.why}"


def _tell_set(findings: Findings, row: SetEvidence) -> CandidateRow:
    """A refitted set of the chosen size; the faults of the measurement where they alone explain."""
    names = row.fit.names or findings.evidence.faults
    drop = row.lowered if row.fit.names else findings.bare.deviance - row.reported_fit.deviance
    status, why = _tell_fate(findings, row)
    sizes = estimate_effect_sizes(findings.context, row.reported_fit, names, row.tests)
    return CandidateRow(names, max(drop, 0.0), FITTED, status, tuple(sizes), why)


def _tell_fate(findings: Findings, row: SetEvidence) -> tuple[str, str]:
    """The verdict on a refitted set, and why."""
    evidence, verdict = findings.evidence, findings.verdict
    if row in verdict.kept:
        left = f"leaves {'more' if evidence.is_predicted else 'no more'} than chance does"
        helps = (
            " and helps on the held-out events" if row.gap is not None and row.gap.gain > 0 else ""
        )
        return (CHOSEN if row is verdict.chosen else TIED), left + helps
    status = find_status(row, verdict, evidence, findings.context)
    if status == "rejected":
        names = evidence.rows[0].names
        best = names[0] if len(names) == 1 else "the best set"
        return status, f"{best} is better by {row.behind:.0f} of Akaike's criterion"
    if row.tests is None:
        return "not rejected", "among too many that fit alike to be tested further"
    if status == "not adequate":
        return (
            status,
            f"chance leaves as much as it does with a probability of {format_drawn_p(row.p_left)}",
        )
    return "denied", "does not hold on the held-out events"


def _list_singles(findings: Findings) -> list[CandidateRow]:
    """Every effect of the catalogue by itself: refitted where it was, else in one linear step from
    the base model.
    """
    refits, scores = findings.explanations.refits, {s.name: s for s in findings.first.scores}
    base, at = findings.first.fit.deviance, findings.context.coordinates
    rows = []
    for j in judge_effects(findings):
        score, fit = scores.get(j.name), refits.get((j.name,))
        drop = base - fit.deviance if fit else score.drop if score else np.nan
        sizes: list[ParameterEstimate] = []
        for p in findings.catalogue[j.name].sizes if fit or score else ():
            if fit:
                sizes.append(ParameterEstimate(p, at.value(p.name, fit.unit), np.nan))
            # else these events say nothing of it
            elif score and score.deviation[p.name] < np.ptp(p.bounds):
                sizes.append(
                    ParameterEstimate(p, p.absent + score.size[p.name], score.deviation[p.name])
                )
        how = FITTED if fit else ONE_STEP if score else ""
        status = CHOSEN if j.name in findings.names else j.status
        rows.append(CandidateRow((j.name,), max(drop, 0.0), how, status, tuple(sizes), j.why))
    return rows
