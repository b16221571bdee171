"""The sets of an investigation by what they predict, where none leaves noise only."""

from collections.abc import Sequence

import numpy as np

from tractexp.blocks import Report
from tractexp.blocks.chart import Chart
from tractexp.blocks.style import MEASURED, PALETTE
from tractexp.discrepancy.investigate import Findings
from tractexp.discrepancy.precision import effect_sizes
from tractexp.discrepancy.prediction import ErrorPredictions, PredictedTerm, PredictionError
from tractexp.inference.interval import ParameterEstimate
from tractexp.inference.model_error import in_percent
from tractexp.wording import joined

ADDED, TIED, OTHER, BASE = PALETTE[2], PALETTE[4], PALETTE[0], MEASURED
MOST = 16  # sets that are shown beside those named
BAR, ROOM = 24, 1.15  # pixels; of the longest bar, for what stands beside the bars


def predicted(page: Report, findings: Findings, predictions: ErrorPredictions) -> None:
    """The model's error on the held-out events with each set, and by what it divides that of the base model."""
    criteria, bare = findings.context.criteria, predictions.bare
    best = [predictions.term] if predictions.term else []
    every = sorted((*predictions.sets.values(), *best), key=lambda p: p.left)
    every = [one for one in every if np.isfinite(one.error)]
    always = ((), *findings.verdict.sets, *(one.names for one in best))
    rows = [one for k, one in enumerate(every) if k < MOST or one.names in always]
    page.heading("Candidates by what they predict")
    if not rows:
        page.text("No set has a steady state on the held-out events.")
        return
    page.chart(
        _bars(findings, rows),
        "The model's error on the held-out events, in percent of the response, with the sets that predict them best"
        " (green: added, orange: tied with it, gray: the base model). All were fitted to the other events by least"
        " squares. Dashed: what a name, or each of the best sets that have it, undercuts.",
    )
    page.table(
        ["candidate", "model error, held out", "error divided by", "status", "size"],
        [
            [_label(one), in_percent(one.error), f"{np.sqrt(bare.left / one.left):.2f}",
             _status(findings, one), "; ".join(map(str, _sizes(findings, one)))]
            for one in rows
        ],
        f"A name, or each of the best sets that have it, divides the error of the base model by {criteria.divides:g}."
        f" It is ahead of any rival of its size or smaller by {criteria.ahead:g}, and no term of the library is"
        " ahead of it by that, all by more than chance (blocks that share the response, left out in turn)."
        + f" The best of the {len(every)} that were fitted." * (len(rows) < len(every)),
        words=(0, 3, 4),
    )  # fmt: skip


def _label(one: PredictionError) -> str:
    if isinstance(one, PredictedTerm):
        return one.words
    return joined(one.names) or "the base model"


def _bars(findings: Findings, rows: Sequence[PredictionError]) -> Chart:
    errors = [100 * one.error for one in rows]
    colors = [
        BASE if not one.names else ADDED if one.names == findings.names
        else TIED if one.names in findings.verdict.sets else OTHER
        for one in rows
    ]  # fmt: skip
    chart = Chart("model error, held out [%]", [""], pixels=130 + BAR * len(rows))
    chart.bars("", [_label(one) for one in rows], errors, colors, hover=[f"{error:.3g}" for error in errors])
    for bare in (error for one, error in zip(rows, errors, strict=True) if not one.names):
        chart.edge(bare / findings.context.criteria.divides, dash="dash")
    return chart.limits(None, 0.0, ROOM * max(errors))


def _status(findings: Findings, one: PredictionError) -> str:
    if not one.names:
        return ""
    if isinstance(one, PredictedTerm):
        return "the best term of the library"
    if one.names in findings.verdict.sets:
        return "added" if one.names == findings.names else "tied"
    return "not named"


def _sizes(findings: Findings, one: PredictionError) -> list[ParameterEstimate]:
    """How large its effects are, with standard errors where they were reckoned."""
    if isinstance(one, PredictedTerm):
        return []
    tests = next((r.tests for r in findings.survivors.rivals if r.fit.names == one.names), None)
    return effect_sizes(findings.context, one.fit, one.names, tests)
