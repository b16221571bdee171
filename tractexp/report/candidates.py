"""The candidates of an investigation by their evidence, and the sets that were compared."""

from collections.abc import Mapping, Sequence

import numpy as np

from tractexp.blocks import Report
from tractexp.blocks.chart import Chart
from tractexp.blocks.style import MEASURED, PALETTE
from tractexp.discrepancy.decide import TIED
from tractexp.discrepancy.explain import find_status
from tractexp.discrepancy.findings import Findings
from tractexp.discrepancy.judgement import judge_effects
from tractexp.inference.chance import format_drawn_p
from tractexp.report.candidate_rows import (
    CHOSEN,
    FITTED,
    ONE_STEP,
    CandidateRow,
    describe_untestable_beside,
    explain_other_than_steepest,
    find_chance_level,
    list_candidates,
)
from tractexp.report.predicted import BAR, add_prediction_section
from tractexp.text.wording import join_words

COLORS = {CHOSEN: PALETTE[2], TIED: PALETTE[4]}
REFITTED, ESTIMATED = PALETTE[0], MEASURED
BAR_ROOM = 1.2  # of the longest bar, for what stands beside the bars
MOST_SETS = 12  # that are compared in a table


def add_candidates(page: Report, findings: Findings) -> None:
    """Add the table and the chart of all candidates: by the deviance that each lowers, or where
    names go by the model's error, by that.
    """
    if findings.evidence.is_predicted:
        return add_prediction_section(page, findings)
    rows = list_candidates(findings)
    labels = _number_sets(rows)
    page.heading("Candidates by their evidence")
    finite = [row for row in rows if np.isfinite(row.drop)]
    if finite:
        page.chart(_chart_drops(findings, finite, labels), _caption_drops(findings, finite))
    for sentence in (explain_other_than_steepest(findings), describe_untestable_beside(findings)):
        if sentence:
            page.text(sentence)
    entries = [
        [
            f"{labels[r]}: {join_words(r.names)}" if len(r.names) > 1 else labels[r],
            "" if np.isnan(r.drop) else f"{r.drop:.1f}",
            r.status,
            "; ".join(map(str, r.sizes)),
            r.why,
        ]
        for r in rows
    ]
    chosen = findings.last.fit.names
    single = (
        f"; that of an effect outside of it is what the events say with {join_words(chosen)} in the"
        " model"
    )
    page.table(
        ["candidate", "deviance lowered by", "status", "size", "why"],
        entries,
        f"Status of a refitted set is that among the sets of its size{single if chosen else ''}."
        " Sizes have their standard error where it was reckoned.",
        words=(0, 2, 3, 4),
    )
    _add_sets(page, findings)
    if chosen:
        _add_further_gains(page, findings)


def _number_sets(rows: Sequence[CandidateRow]) -> dict[CandidateRow, str]:
    """A candidate's name; sets of several are numbered, because a chart has no room for all their
    names.
    """
    sets = [row for row in rows if len(row.names) > 1]
    return {row: f"set {sets.index(row) + 1}" if row in sets else row.names[0] for row in rows}


def _chart_drops(
    findings: Findings, rows: Sequence[CandidateRow], labels: Mapping[CandidateRow, str]
) -> Chart:
    """Each candidate's drop of the deviance as a bar, colored by its status."""
    colors = [COLORS.get(r.status, REFITTED if r.how == FITTED else ESTIMATED) for r in rows]
    entries = [_describe_bar(row) for row in rows]
    chance = find_chance_level(findings)
    chart = Chart("deviance", [""], pixels=130 + BAR * len(rows))
    chart.bars("", [labels[r] for r in rows], [r.drop for r in rows], colors, hover=entries)
    return chart.edge(chance, dash="dash").limits(
        None, 0.0, BAR_ROOM * max(chance, *(r.drop for r in rows))
    )


def _describe_bar(row: CandidateRow) -> str:
    """The text at the pointer over a bar."""
    drop = f"{row.drop:.{0 if row.drop >= 100 else 1}f}"
    return f"{drop}, {row.status}" if row.rank < 2 else drop


def _caption_drops(findings: Findings, rows: Sequence[CandidateRow]) -> str:
    """The caption with the meaning of the colors."""
    colors = []
    if findings.names:
        colors.append("green: added")
    if any(r.status == TIED for r in rows):
        colors.append("orange: tied with it")
    if any(r.how == FITTED and r.rank == 2 for r in rows):
        colors.append("blue: refitted")
    if any(r.how == ONE_STEP for r in rows):
        colors.append("gray: estimated in one linear step")
    chance = f"{find_chance_level(findings):.1f}, what chance gives to the most helpful of all in"
    return (
        f"By how much each alone lowers the deviance of the base model ({', '.join(colors)})."
        f" Dashed: {chance} {findings.context.criteria.naming_false_alarms:.0%} of cases."
    )


def _add_sets(page: Report, findings: Findings) -> None:
    """Add the table of sets that were refitted."""
    rows = [
        [
            join_words(r.fit.names) or "the base model",
            f"{r.fit.deviance:.1f}",
            f"{r.behind:.1f}",
            find_status(r, findings.verdict, findings.evidence, findings.context),
            "" if r.tests is None else format_drawn_p(r.p_left),
        ]
        for r in findings.evidence.rows[:MOST_SETS]
    ]
    with page.fold_blocks("How the refitted sets compare"):
        page.table(
            ["set", "deviance", "behind", "verdict", "chance leaves as much"],
            rows,
            "Every set of this size that was refitted; behind is that of Akaike's criterion. A set"
            " is rejected when its relative likelihood is below"
            f" {findings.context.criteria.rejected:g}; it is adequate when chance may leave as much"
            " as it does.",
            words=(3, 4),
        )


def _add_further_gains(page: Report, findings: Findings) -> None:
    """Add what the other effects would gain once the chosen ones are in the model."""
    rows = []
    for j in judge_effects(findings):
        size = ""
        if j.score is not None:
            size = ", ".join(
                f"{n} {v:.3g} ± {j.score.deviation[n]:.2g}" for n, v in j.score.size.items()
            )
        rows.append(
            [j.name, j.status, "" if j.score is None else f"{j.score.drop:.1f}", size, j.why]
        )
    names = join_words(findings.last.fit.names)
    with page.fold_blocks(f"What each effect would add to a model that has {names}"):
        page.table(
            ["effect", "status", "deviance lowered by", "one-step size", "why"],
            rows,
            "Scores with all nuisances projected out; sizes are departures from the null.",
            words=(1, 3, 4),
        )
