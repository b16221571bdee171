"""The sets of an investigation by what they predict, where none leaves noise only."""

from collections.abc import Sequence

import numpy as np

from tractexp.blocks import Report
from tractexp.blocks.chart import Chart
from tractexp.blocks.style import MEASURED, PALETTE
from tractexp.discrepancy.evidence import SetEvidence
from tractexp.discrepancy.findings import Findings
from tractexp.discrepancy.precision import estimate_effect_sizes
from tractexp.discrepancy.proposal.library import find_term
from tractexp.inference.interval import ParameterEstimate
from tractexp.inference.model_error import format_percent
from tractexp.text.wording import join_words

ADDED, TIED, OTHER, BASE = PALETTE[2], PALETTE[4], PALETTE[0], MEASURED
MOST_SHOWN_SETS = 16  # sets that are shown beside those named
BAR, ROOM = 24, 1.15  # pixels; of the longest bar, for what stands beside the bars


def add_prediction_section(page: Report, findings: Findings) -> None:
    """The model's error on the held-out events with each set, and by what it divides that of the
    base model.
    """
    criteria, evidence = findings.context.criteria, findings.evidence
    best = [evidence.term] if evidence.term else []
    every = sorted((*evidence.every, *best), key=lambda row: row.held_out_prediction.excess)
    every = [row for row in every if np.isfinite(row.held_out_prediction.error)]
    always = (evidence.base, *findings.verdict.kept, *best)
    rows = [row for k, row in enumerate(every) if k < MOST_SHOWN_SETS or row in always]
    page.heading("Candidates by what they predict")
    page.items(_describe_stalls(findings))
    if not rows:
        page.text("No set has a steady state and survives the held-out events.")
        return
    page.chart(
        _chart_errors(findings, rows),
        "The model's error on the held-out events, in percent of the response, with the sets that"
        " predict them best (green: added, orange: tied with it, gray: the base model). All were"
        " fitted to the other events by least squares. Dashed: what a name, or each of the best"
        " sets that have it, undercuts.",
    )
    best = f" The best of the {len(every)} that were fitted." if len(rows) < len(every) else ""
    page.table(
        ["candidate", "model error, not fitted", "error divided by", "status", "size"],
        [
            [
                _label(findings, row),
                format_percent(row.held_out_prediction.error),
                _format_factor(
                    np.sqrt(
                        evidence.base.held_out_prediction.excess / row.held_out_prediction.excess
                    )
                ),
                _tell_status(findings, row),
                "; ".join(map(str, _tell_sizes(findings, row))),
            ]
            for row in rows
        ],
        "A name, or each of the best sets that have it, divides the error of the base model by"
        f" {criteria.divides:g}. It is ahead of any rival of its size or smaller by"
        f" {criteria.ahead:g}, and no term of the library is ahead of it by that, all by more than"
        f" chance (blocks that share the response, left out in turn).{best}",
        words=(0, 3, 4),
    )


def _format_factor(factor: float) -> str:
    """By what a set divides the base model's error; nothing where that has no size."""
    return f"{factor:.2f}" if np.isfinite(factor) else ""


def _describe_stalls(findings: Findings) -> list[str]:
    """In which sets the motor stalls on held-out events: they are behind all others."""
    labels: dict[tuple[str, ...], list[str]] = {}
    for row in findings.evidence.every:
        if row.held_out_prediction.stalls:
            labels.setdefault(row.held_out_prediction.stalls, []).append(_label(findings, row))
    return [
        f"On {join_words(events)} the motor stalls in this model with {join_words(names)}: behind"
        " all sets that survive."
        for events, names in labels.items()
    ]


def _label(findings: Findings, row: SetEvidence) -> str:
    """A set's names."""
    if row is findings.evidence.term:
        return find_term(row.names[0]).words
    return join_words(row.names) or "the base model"


def _chart_errors(findings: Findings, rows: Sequence[SetEvidence]) -> Chart:
    """The error that each set leaves of the held-out events."""
    errors = [100 * row.held_out_prediction.error for row in rows]
    chart = Chart("model error, not fitted [%]", [""], pixels=130 + BAR * len(rows))
    labels, colors = (
        [_label(findings, row) for row in rows],
        [_color(findings, row) for row in rows],
    )
    chart.bars("", labels, errors, colors, hover=[f"{error:.3g}" for error in errors])
    for row, error in zip(rows, errors, strict=True):
        if row is findings.evidence.base:
            chart.edge(error / findings.context.criteria.divides, dash="dash")
    return chart.limits(None, 0.0, ROOM * max(errors))


def _color(findings: Findings, row: SetEvidence) -> str:
    """The color of a set by its place in the verdict."""
    if row is findings.evidence.base:
        return BASE
    if row is findings.verdict.chosen:
        return ADDED
    return TIED if row in findings.verdict.kept else OTHER


def _tell_status(findings: Findings, row: SetEvidence) -> str:
    """A set's place in the verdict, in words."""
    if row is findings.evidence.base:
        return ""
    if row is findings.evidence.term:
        return "the best term of the library"
    if row in findings.verdict.kept:
        return "added" if row is findings.verdict.chosen else "tied"
    return "not named"


def _tell_sizes(findings: Findings, row: SetEvidence) -> list[ParameterEstimate]:
    """How large its effects are, with standard errors where they were reckoned."""
    if row is findings.evidence.term:
        return []
    return estimate_effect_sizes(findings.context, row.fit, row.names, row.tests)
