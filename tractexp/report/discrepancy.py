"""The page of an investigation: the verdict, what one sees, what explains it, how large it is, and
how it was found.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.blocks import Report, Table
from tractexp.discrepancy.decide import UNEXPLAINED
from tractexp.discrepancy.findings import Findings
from tractexp.discrepancy.nearest import Nearest
from tractexp.discrepancy.readings import read_shapes
from tractexp.discrepancy.recommend import recommend_next
from tractexp.discrepancy.remainder import Remainder
from tractexp.inference.model_error import format_percent, tell_error
from tractexp.record.identity import Identity, compose_title, describe_identities
from tractexp.report.candidates import add_candidates
from tractexp.report.disagreement import add_noise, add_places
from tractexp.report.explained import answer_clicks
from tractexp.report.extended import (
    add_equations,
    add_laws,
    add_parameters,
    format_estimate,
    format_interval,
)
from tractexp.report.next_event import add_section
from tractexp.report.overlay import add_overlays
from tractexp.report.proposal import add_proposal_section, list_headlines
from tractexp.text.wording import (
    count_noun,
    finish_sentence,
    format_epsilon,
    join_alternatives,
    join_words,
)

if TYPE_CHECKING:
    from tractexp.api.investigation import Investigation as Outcome

KIND = {
    "none": "good",
    "candidate": "plain",
    "named": "good",
    "tied": "plain",
    "unexplained": "bad",
}
ROLES = {"train": "fitted", "validate": "held out"}
CURRENTS = (
    ", as the record's estimator sees them in calculated and recorded currents. epsilon_i: what the"
    " currents of all phases miss in the 0.15 s after the dip begins, rms, over their rms before it"
)


def build_summary(findings: "Outcome") -> Report:
    """The verdict first, then how large the gap is and how much of it is closed, where, and what to
    do next.
    """
    content, left = findings.content, findings.remainder.caption
    names = join_alternatives(content["name_sets"])
    report = Report().text(f"verdict: {findings.verdict.upper()} {names}".rstrip())
    grade, which = content["adequacy"], "extended" if findings.names else "base"
    report.items(
        [findings.reason, *findings.sizes, *([left] if left else []), *findings.proposal_sentences]
    )
    report.items(
        [f"the {which} model is graded {grade['grade'].replace('_', ' ')}: {grade['sentence']}"]
    )
    report.add(build_gap_table(content))
    report.text(*describe_where(content), *describe_nearest(content, findings.sizes_of_nearest))
    return report.text(f"noise: {content['noise']}", f"next: {findings.recommendation}")


def describe_where(content: Mapping[str, Any]) -> list[str]:
    """Where the base model disagrees most, in a line; [] where it does not."""
    if not (places := content["where"]):
        return []
    loudest, others = places[0], len(places) - 1
    span = f"{loudest['start']:.3f} to {loudest['end']:.3f} s"
    stretches = "stretches" if others > 1 else "stretch"
    more = f", and {others} more {stretches}" if others else ""
    return [
        f"where: {loudest['channel']} of {loudest['event']}, {span}, {loudest['share']:.0%} of the"
        f" excess{more}"
    ]


def describe_nearest(content: Mapping[str, Any], sizes: Sequence[str]) -> list[str]:
    """The effects that come nearest where none is accepted, in a line; [] elsewhere."""
    if not (near := content["nearest"]):
        return []
    closed = {role: (near["gap"][role] or {}).get("closed") for role in ROLES}
    shares = join_words(
        [f"{closed[role]:.0%} {on}" for role, on in ROLES.items() if closed[role] is not None]
    )
    return [
        f"nearest, not accepted: {join_words(near['effects'])}; gap closed {shares or 'unknown'};"
        f" {', '.join(sizes)}"
    ]


def build_gap_table(content: Mapping[str, Any]) -> Table:
    """How far off the base model is, and the extended one where an effect was named."""
    gaps, named, rows = content["gap"], bool(content["effects"]), []
    waves = "epsilon_i" in gaps["train"]["before"]
    for role, label in ROLES.items():
        for model, stage in (("base model", "before"), ("extended model", "after"))[: 1 + named]:
            if (one := gaps[role]) is not None:
                closed = one["closed"] if stage == "after" else None
                error = _format_error(one[stage]["model_error"])
                rows.append(
                    [
                        label,
                        model,
                        error,
                        *_describe_misfit(one[stage], waves=waves),
                        "" if closed is None else f"{closed:.0%}",
                    ]
                )
    columns = [
        "events",
        "model",
        "model error",
        "epsilon_p",
        "epsilon_q",
        *["epsilon_i"] * waves,
        "chi2 per sample",
    ]
    caption = (
        "Model error: what is left of the load's response, in S, beyond the noise, with its 95 %"
        " interval."
    )
    caption += f" epsilon: relative error of P and Q, Eq. (20){CURRENTS * waves}."
    caption += (
        " chi2 per sample: of the fits by which effects are ranked, 1 where only noise is left."
    )
    if named:
        columns.append("gap closed")
        caption += " Gap closed: the share of the squared model error that is gone."
    return Table(columns, [row[: len(columns)] for row in rows], "", caption, words=(1,))


def report(
    findings: Findings, content: Mapping[str, Any], identities: Sequence[Identity]
) -> Report:
    """The investigation, for a reader who was not there; `content` is that of
    `discrepancy.json`.
    """
    fitted = (
        f"{count_noun(len(findings.context.events), 'event')} fitted, {len(findings.withheld)} held"
        " out"
    )
    lead = "; ".join(
        [*describe_identities(identities), f"{findings.context.model.title}, {fitted}"]
    )
    title = compose_title(identities, (e.record.name for e in findings.context.events))
    page = Report(f"Missing effect: {title}", lead)
    spoken = [
        [findings.catalogue.label_effect(name) for name in names] for names in findings.verdict.sets
    ]
    head = f"{findings.verdict.word.upper()} {join_alternatives(spoken)}".strip()
    left = [finish_sentence(findings.headline)] if findings.headline else []
    sentences = [
        finish_sentence(findings.reason),
        *left,
        *list_headlines(findings),
        _describe_grade(findings),
    ]
    kind = (
        "plain" if findings.names and not findings.verdict.complete else KIND[findings.verdict.word]
    )
    page.verdict(head, *sentences, f"Next: {recommend_next(findings)}.", kind=kind)
    add_overlays(
        page.heading("Measured, before, after" if findings.names else "Measured and calculated"),
        findings.graded_overlays,
        answer_clicks(findings),
    )
    _add_gap(page, findings, content)
    if findings.verdict.word == UNEXPLAINED:
        add_proposal_section(page, findings)
    if not findings.verdict.complete:
        _add_remainder_section(page, findings)
    if (chosen := findings.next_event) is not None:
        page.heading("What to record next").text(finish_sentence(chosen.sentence()))
        add_section(page, chosen)
    add_laws(page, findings)
    add_candidates(page, findings)
    add_parameters(page, findings)
    if findings.names:
        add_equations(page, findings)
    add_places(page, findings)
    add_noise(page, findings)
    return page


def _describe_grade(findings: Findings) -> str:
    """The grade of the model that the investigation ends with, in a sentence."""
    which = "extended" if findings.names else "base"
    graded = findings.final_grade
    grade, doubt = graded.adequacy, f"; {graded.doubt}" if graded.doubt else ""
    word, promised = grade.grade.replace("_", " "), graded.next_dip.get("sentence", "")
    told = "; ".join(filter(None, [f"{grade.sentence}{doubt}", promised]))
    return f"The {which} model is graded {word}: {told}."


def _add_gap(page: Report, findings: Findings, content: Mapping[str, Any]) -> None:
    """The gap; where nothing explains it, that of the nearest candidates beside it."""
    page.heading("How large the gap is" if not findings.names else "How much smaller the gap is")
    table, near = build_gap_table(content), findings.nearest
    page.add(replace(table, rows=_describe_gap_with_nearest(near)) if near else table)
    if len(steps := content["contributions"]) > 2:
        rows = [
            [join_words(s["effects"]) or "the base model", tell_error({"value": s["model_error"]})]
            for s in steps
        ]
        page.text("What each name contributes:")
        page.table(
            ["with", "model error, not fitted"],
            rows,
            "One more at a time, the one that helps most first.",
        )
    if findings.fitted_to_both:
        page.text(
            "The extended model was fitted to the held-out events, too: what they say of it is no"
            " test of it."
        )
    elif findings.names and findings.evidence.is_predicted:
        page.text("The held-out events took part in choosing: what they say is no test of it.")


def _describe_gap_with_nearest(near: Nearest) -> list[list[str]]:
    """The base model's gap and that of the candidates which come nearest."""
    pairs = (("fitted", near.fitted), ("held out", near.held_out))
    stages = ("base model", "nearest candidates")
    return [
        [
            label,
            stage,
            _format_error(c.error.to_dict()),
            *_describe_misfit(vars(c), waves=near.fitted.before.epsilon_i is not None),
        ]
        for label, both in pairs
        if both
        for stage, c in zip(stages, (both.before, both.after), strict=True)
    ]


def _format_error(entry: Mapping[str, Any]) -> str:
    """A model's error with its interval, as a table has it."""
    ends = [
        format_percent(end) for end in entry["interval"] if end is not None and np.isfinite(end)
    ]
    return tell_error(entry) + (
        f" ({ends[0].removesuffix(' %')} to {ends[1]})" if len(ends) == 2 else ""
    )


def _describe_misfit(misfit: Mapping[str, Any], *, waves: bool) -> list[str]:
    """How far off curves are, as a table has it; of `waves` the currents, too."""
    shown = ["epsilon_p", "epsilon_q", *(["epsilon_i"] if waves else [])]
    chi2 = misfit["chi2_per_sample"]
    told = "" if chi2 is None or not np.isfinite(chi2) else f"{chi2:.3f}"
    return [*(format_epsilon(misfit[name]) for name in shown), told]


def _add_remainder_section(page: Report, findings: Findings) -> None:
    """Add what is left beside the names, or what nothing explains, in words."""
    page.heading("What is left")
    shapes, near = findings.rest.of_best, findings.nearest
    whose = (
        "the base model" if near is None else f"{join_words(near.names)}, the nearest candidates,"
    )
    if findings.names:
        whose = f"the model with {join_words(findings.names)}"
    _add_shapes(page, findings, shapes, whose)
    if near is not None:
        _add_shapes(page, findings, findings.rest.of_base, "the base model alone")
        _add_nearest(page, near)


def _add_shapes(page: Report, findings: Findings, shapes: Sequence[Remainder], whose: str) -> None:
    """Add the shapes of what is left by `whose` model."""
    if not shapes:
        page.text(
            f"Missed by {whose}: nothing of a simple shape, no ringing, decay, step or pulse."
        )
        return
    beyond = {event.record.name for event in findings.withheld}
    where = "held-out" if shapes[0].event in beyond else "fitted"
    page.text(f"Missed by {whose} on the {where} events, the loudest first: {shapes[0]}.")
    rows = [
        [
            s.event,
            s.channel,
            s.kind,
            f"{s.start:.3f}",
            s.when,
            _format_number(s.frequency),
            _format_number(s.time_constant),
            _format_number(s.damping),
            f"{s.size:.2g}",
            s.times,
            f"{s.share:.0%}",
        ]
        for s in shapes
    ]
    page.table(
        [
            "event",
            "channel",
            "kind",
            "from t [s]",
            "when",
            "frequency [Hz]",
            "time constant [s]",
            "damping ratio",
            "size [pu]",
            "of the noise",
            "of the excess",
        ],
        rows,
        "Shapes c exp(-t/tau) cos(2 pi f t + phi) fitted to what is left; the noise is that before"
        " the dip.",
        words=(4,),
    )
    if readings := read_shapes(shapes, findings.context.events[0]):
        page.table(
            ["what is left", "may be", "source", "what would decide", "by"],
            [[r.shape, r.means, r.source, r.decides, r.command] for r in readings],
            "None of them is a finding: the effects of the catalogue were tested and do not"
            " explain.",
            words=(1, 2, 3, 4),
        )


def _add_nearest(page: Report, near: Nearest) -> None:
    """The candidates that come nearest, with their shares and sizes."""
    rows = [[join_words(near.names), *map(_share, near.closed_shares)]]
    rows += [[join_words(names), _share(share), ""] for names, share in near.others]
    page.text("The candidates that come nearest, none of which is accepted:")
    page.table(["nearest candidates", "gap closed, fitted", "held out"], rows, words=(0,))
    with page.fold_blocks(f"How large {join_words(near.names)} would be"):
        page.table(
            ["parameter", "meaning", "unit", "value", "95 % interval", "verdict"],
            [
                [
                    e.parameter.name,
                    e.parameter.about,
                    e.parameter.unit,
                    format_estimate(e),
                    format_interval(*e.interval),
                    e.verdict,
                ]
                for e in near.estimates
            ],
            "As if they were right; something else is missing, so that the intervals may miss the"
            " truth.",
            words=(1, 2, 5),
        )


def _share(closed: float) -> str:
    """The share of a gap, nothing where there was none to speak of."""
    return f"{closed:.0%}" if np.isfinite(closed) else ""


def _format_number(value: float | None) -> str:
    """A number with three digits; "" for none."""
    return "" if value is None else f"{value:.3g}"
