"""The part of an investigation's page that tells a proposed term, or why there is none."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tractexp.blocks import Report
from tractexp.blocks.chart import Chart
from tractexp.discrepancy.discrepancy_json import adopt_term
from tractexp.discrepancy.findings import Findings
from tractexp.discrepancy.gap import GapTest
from tractexp.discrepancy.proposal.generate import PLUGIN
from tractexp.discrepancy.proposal.judge import TermAssessment
from tractexp.discrepancy.proposal.library import Term
from tractexp.discrepancy.proposal.propose import Proposal, to_dict
from tractexp.discrepancy.proposal.wording import describe_chance, describe_proposal
from tractexp.inference.model_error import tell_error
from tractexp.report.extended import format_interval
from tractexp.text.wording import (
    finish_sentence,
    format_probability,
    format_share,
    format_with_error,
    join_words,
)

MISSED, TERM = "#9A9A9A", "#0072B2"
EVENTS = 4  # whose charts are shown at once


def list_headlines(findings: Findings) -> list[str]:
    """The sentences on a proposal in the box at the top."""
    return [
        finish_sentence(s) for s in describe_proposal(to_dict(findings.proposed, PLUGIN), None)[:2]
    ]


def add_proposal_section(page: Report, findings: Findings) -> None:
    """The term, its size, where and when it acts, what it explains, and what looks like it."""
    page.heading("Proposal")
    proposal = findings.proposed.proposal
    if proposal is None:
        page.text(f"No term is proposed: {findings.proposed.why}.")
        _add_tried_terms(page, findings.proposed.tried)
        return
    page.text(
        f"{finish_sentence(proposal.term.words)}"
        " No effect of the catalogue has this term; it was found"
        " by a screen."
    )
    page.equation(proposal.term.latex)
    if proposal.term.clock:
        page.text(
            "It is not a function of the voltage: something happened by itself, and need not happen"
            " again."
        )
    _add_numbers(page, proposal)
    _add_explanation(page, proposal)
    _plot_term(page, proposal)
    _add_rivals(page, proposal)
    page.text(
        f"The file {PLUGIN} beside this page is the term as an effect. In that folder, this makes a"
        " package of it, and says how it is tested, installed and chosen:"
    )
    page.code(adopt_term(Path(PLUGIN)))
    with page.fold_blocks("The plugin file"):
        page.code(proposal.source)
    _add_tried_terms(page, findings.proposed.tried)


def _add_numbers(page: Report, proposal: Proposal) -> None:
    """Add the term's parameters."""
    rows = [
        [
            p.name,
            p.symbol.replace("\\varphi", "φ"),
            p.about,
            p.unit,
            format_with_error(k.value, k.error),
            format_interval(*k.interval),
        ]
        for k in proposal.estimates
        for p in (k.parameter,)
    ]
    page.table(
        ["parameter", "in the equation", "meaning", "unit", "value", "95 % interval"],
        rows,
        "Intervals by the curvature of the fit to the fitted events, the base model and the faults"
        " of the measurement left free beside it.",
        words=(1, 2, 3),
    )
    page.table(
        ["event", "from t [s]", "to t [s]", "channel", "largest change [pu]"],
        [
            [a["event"], f"{a['start']:.3f}", f"{a['end']:.3f}", a["channel"], f"{a['most']:+.3g}"]
            for a in proposal.acting
        ],
        "When it acts: where it changes what is calculated by more than a tenth of the most it"
        " does.",
        words=(3,),
    )


def _add_explanation(page: Report, proposal: Proposal) -> None:
    """Add what the term explains, fitted and held out."""
    rows = [
        [
            role,
            *(tell_error(vars(c.error)) for c in (change.before, change.after)),
            format_share(judged.explained_share),
        ]
        for role, change, judged in zip(
            ("fitted", "held out"),
            proposal.changes,
            (proposal.judged.train, proposal.judged.validate),
            strict=True,
        )
    ]
    page.table(
        ["events", "model's error without it", "with it", "explained"],
        rows,
        "Errors are of the response, both models as least squares fit them; explained is the"
        " term's part of what it gains and what pushes into the balances or the other terms tried"
        f" would gain beside it, beyond chance; {describe_chance(proposal.judged.p)}.",
    )


def _plot_term(page: Report, proposal: Proposal) -> None:
    """Add a chart for each event: what the base model misses, and what the term makes of it."""
    of_events = proposal.judged.train, proposal.judged.validate
    for role, judged in zip(("fitted", "held out"), of_events, strict=True):
        page.text(
            "What the base model misses, and what the model with the term draws beyond it"
            f" ({role}):"
        )
        page.charts(
            [_plot_missed_part(judged, e) for e in range(min(len(judged.by_event), EVENTS))]
        )


def _plot_missed_part(judged: GapTest, e: int) -> Chart:
    """The chart of what the base model misses of an event, beside what the term adds."""
    bench = judged.context
    assert bench is not None
    event = bench.events[e]
    part = bench.drive.part(e)
    base = judged.before.calculated[:, part]
    missed = np.where(bench.valid[:, part], bench.drive.measurements[:, part] - base, np.nan)
    more = judged.after.calculated[:, part] - base
    t = event.record.t[event.record.samples - base.shape[1] :]
    # a delta winding has no zero sequence
    measured = [c for c in range(len(base)) if bench.valid[c, part].any()]
    chart = Chart(f"t [s], {event.record.name}", [f"{bench.drive.names[c]} [pu]" for c in measured])
    for row, c in enumerate(measured):
        chart.line("measured less base model", t, missed[c], MISSED, row, width=1.0)
        chart.line("with the term less base model", t, more[c], TERM, row)
    return chart


def _add_rivals(page: Report, proposal: Proposal) -> None:
    """Add the terms that cannot be told from it."""
    if proposal.ties:
        page.table(
            ["also possible", "explained of the fitted events", "of the held-out events"],
            [[t.words, format_share(a), format_share(b)] for t, a, b in proposal.ties],
            "These events cannot tell them from the term proposed.",
        )
    if proposal.alike:
        names = join_words([f"{name} ({share:.0%})" for name, share in proposal.alike])
        page.text(
            "Textbook effects that look like it, with the share of its change each could have made:"
            f" {names}. None of them is adequate by itself."
        )
    else:
        page.text("No textbook effect of the catalogue could have made half of its change.")


def _add_tried_terms(page: Report, tried: Sequence[tuple[Term, TermAssessment]]) -> None:
    """The best of the library as held-out events judged them."""
    if not tried:
        return
    with page.fold_blocks("The best terms of the library, judged"):
        page.table(
            [
                "term",
                "explained, fitted",
                "explained, held out",
                "left, fitted",
                "left, held out",
                "chance",
            ],
            [
                [
                    t.words,
                    *(format_share(g.explained_share) for g in gaps),
                    *(f"{g.after.chi2_per_sample:.2f}" for g in gaps),
                    format_probability(w.p),
                ]
                for t, w in tried
                for gaps in ((w.train, w.validate),)
            ],
            "Shares explained, and what is left over the variance of the noise.",
        )
