"""What a click on a residual tells: how much the base model leaves there, and how much each of the
candidates that were fitted would.
"""

from typing import NamedTuple

import numpy as np

from tractexp.discrepancy.evidence import SetEvidence
from tractexp.discrepancy.findings import Findings
from tractexp.inference.residual_statistics import list_residual_windows
from tractexp.text.wording import join_words

MOST_TRIED = 8  # sets, those that lower the deviance most
MOST_TOLD = 4  # of them in a sentence, those that leave least there


class Answer(NamedTuple):
    """The explanation of a stretch of time [s]."""

    start: float
    end: float
    sentence: str


def answer_clicks(findings: Findings) -> list[list[Answer]]:
    """By fitted event, of each window and channel what is left there, in times the noise."""
    context, noise = findings.context, findings.train.noise
    drive, problem = context.drive, context.problem
    if not (chosen := _choose_rows(findings)):
        return [[] for _ in problem.events]
    rows = [findings.evidence.base, *chosen]
    names = [join_words(row.fit.names) for row in rows]
    deviation, fits = noise.deviation(drive), [row.reported_fit for row in rows]
    left = [context.residual(fit.unit, fit.names) / deviation for fit in fits]
    answers: list[list[Answer]] = [[] for _ in problem.events]
    for window in list_residual_windows(problem):
        c = drive.labels.index(window.channel)
        loudness = [_measure_loudness(one[c, window.part]) for one in left]
        best = sorted(zip(loudness[1:], names[1:], strict=True))[:MOST_TOLD]
        told = ", ".join(f"{name} {times:.2g} times" for times, name in best)
        sentence = (
            f"{window.channel} from {window.start:.3f} to {window.end:.3f} s: the base model leaves"
            f" {loudness[0]:.2g} times the noise; with {told}"
        )
        if np.isfinite(loudness).all():
            answers[window.event].append(Answer(window.start, window.end, sentence))
    return answers


def _choose_rows(findings: Findings) -> list[SetEvidence]:
    """The sets that lower the deviance most."""
    every = findings.by_likelihood.every
    fitted = [row for row in every if row.fit.names and np.isfinite(row.lowered)]
    return sorted(fitted, key=lambda row: -row.lowered)[:MOST_TRIED]


def _measure_loudness(scaled: np.ndarray) -> float:
    """The rms (n,) of what is left over the noise; nan where nothing was compared."""
    compared = scaled[np.isfinite(scaled)]
    return float(np.sqrt(np.mean(compared**2))) if compared.size else np.nan
