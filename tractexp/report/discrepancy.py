"""The page of an investigation: the verdict, what one sees, what explains it, how large it is, and how it was found."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.blocks import Report, Table
from tractexp.blocks.chart import Chart
from tractexp.discrepancy.chance import by_draws
from tractexp.discrepancy.discrepancy_json import recommendation, use_of
from tractexp.discrepancy.evidence import (
    CHOSEN,
    FITTED,
    KEPT,
    ONE_STEP,
    Evidence,
    beside,
    chance_level,
    evidence,
    why_not_the_most_helpful,
)
from tractexp.discrepancy.forms import CATALOGUE, FittedLaw, forms
from tractexp.discrepancy.investigate import Findings
from tractexp.discrepancy.judgement import judgements
from tractexp.discrepancy.precision import ParameterEstimate, estimates
from tractexp.discrepancy.recommended import adequacy, held
from tractexp.discrepancy.remainder import Remainder
from tractexp.discrepancy.verdict import UNEXPLAINED, Nearest
from tractexp.identification.model_error import in_percent
from tractexp.model.sites import KINDS
from tractexp.report.next_event import section
from tractexp.report.overlay import overlaid
from tractexp.report.proposal import headlines, proposed
from tractexp.wording import as_sentence, epsilon, in_words, joined, percent, with_error

if TYPE_CHECKING:
    from tractexp.api.discrepancy import Investigation as Outcome

KIND = {"none": "good", "named": "good", "tied": "plain", "unexplained": "bad"}
COLORS = {CHOSEN: "#009E73", KEPT: "#E69F00"}
REFITTED, ESTIMATED = "#0072B2", "#9A9A9A"
CURVE, TEXTBOOK = "#0072B2", "#D55E00"
BAR, ROOM = 24, 1.2  # pixels; of the longest bar, for what stands beside the bars
NOISE_OF_WAVES = (
    "It is estimated before the dip and at the end of the record, from what the fit leaves there: harmonics that no"
    " equation explains count as noise; noise of the voltage is passed on as the model does. Beside it each channel may"
    " keep a small offset, and how steep the voltage is at the samples of an edge is known no better than two curves"
    " through them agree."
)
MOST_SETS = 12  # that are compared in a table
CURRENTS = (
    ", as the record's estimator sees them in calculated and recorded currents. epsilon_i: what the currents of all"
    " phases miss in the 0.15 s after the dip begins, rms, over their rms before it"
)


def summary(findings: "Outcome") -> Report:
    """The verdict first, then how large the gap is and how much of it is closed, where, and what to do next."""
    content, left = findings.content, findings.remainder.caption
    names = " or ".join(map(joined, content["name_sets"]))
    report = Report().text(f"verdict: {findings.verdict.upper()} {names}".rstrip())
    grade, which = content["adequacy"], "extended" if findings.names else "base"
    report.items([findings.reason, *findings.sizes, *[left] * bool(left), *findings.proposed])
    report.items([f"the {which} model is graded {grade['grade'].replace('_', ' ')}: {grade['sentence']}"])
    report.add(gap(content))
    if places := content["where"]:
        loudest, others = places[0], len(places) - 1
        span = f"{loudest['start']:.3f} to {loudest['end']:.3f} s"
        more = f", and {others} more stretch{'es' * (others > 1)}" if others else ""
        report.text(
            f"where: {loudest['channel']} of {loudest['event']}, {span}, {loudest['share']:.0%} of the excess{more}"
        )
    if near := content["nearest"]:
        held = near["explained_held_out"]
        beyond = "" if held is None else f" and {percent(held)} on the held-out events"
        share = f"{percent(near['explained'])} of what exceeds the noise{beyond}"
        sizes = ", ".join(findings.sizes_of_nearest)
        report.text(f"nearest, not accepted: {joined(near['effects'])}, {share}; {sizes}")
    return report.text(f"noise: {content['noise']}", f"next: {findings.recommendation}")


def gap(content: Mapping[str, Any]) -> Table:
    """How far off the base model is, and the extended one where an effect was named."""
    gaps, named, rows = content["gap"], bool(content["effects"]), []
    for label, role in (("fitted", "train"), ("held out", "validate")):
        for model, stage in (("base model", "before"), ("extended model", "after"))[: 1 + named]:
            if (one := gaps[role]) is not None:
                closed = one["closed"] if stage == "after" else None
                error = _error(one[stage]["model_error"])
                rows.append([label, model, error, *_off(one[stage]), "" if closed is None else f"{closed:.0%}"])
    waves = "epsilon_i" in gaps["train"]["before"]
    columns = ["events", "model", "model error", "epsilon_p", "epsilon_q", *["epsilon_i"] * waves, "chi2 per sample"]
    caption = "Model error: what is left of the load's response, in S, beyond the noise, with its 95 % interval."
    caption += f" epsilon: relative error of P and Q, Eq. (20){CURRENTS * waves}."
    caption += " chi2 per sample: 1 where only noise is left."
    if named:
        columns.append("gap closed")
        caption += " Gap closed: the share of the squared model error that is gone."
    return Table(columns, [row[: len(columns)] for row in rows], "", caption, words=(1,))


def report(findings: Findings, content: Mapping[str, Any], title: str) -> Report:
    """The investigation, for a reader who was not there; `content` is that of `discrepancy.json`."""
    events = len(findings.context.events)
    lead = (
        f"{findings.context.model.title}, {events} event{'s' * (events > 1)} fitted, {len(findings.withheld)} held out"
    )
    page = Report(f"Missing effect: {title}", lead)
    spoken = [joined([findings.catalogue.spoken(name) for name in names]) for names in findings.verdict.sets]
    head = f"{findings.verdict.word.upper()} {' or '.join(spoken)}".strip()
    left = [as_sentence(findings.headline)] if findings.headline else []
    sentences = [as_sentence(findings.verdict.reason), *left, *headlines(findings), _graded(findings)]
    kind = "plain" if findings.names and not findings.verdict.complete else KIND[findings.verdict.word]
    page.verdict(head, *sentences, f"Next: {recommendation(findings)}.", kind=kind)
    overlaid(
        page.heading("Measured, before, after" if findings.names else "Measured and calculated"), findings.overlays
    )
    _smaller(page, findings, content)
    if findings.verdict.word == UNEXPLAINED:
        proposed(page, findings)
    if not findings.verdict.complete:
        _left(page, findings)
    if (chosen := findings.next_event) is not None:
        page.heading("What to record next").text(as_sentence(chosen.sentence()))
        section(page, chosen)
    _forms(page, findings)
    _candidates(page, findings)
    _parameters(page, findings)
    if findings.names:
        _equations(page, findings)
    _disagreement(page, findings)
    _noise(page, findings)
    return page


def _graded(findings: Findings) -> str:
    """What the model that the investigation ends with is good for."""
    which = "extended" if findings.names else "base"
    grade = adequacy(findings)
    return f"The {which} model is graded {grade.grade.replace('_', ' ')}: {grade.sentence}."


def _smaller(page: Report, findings: Findings, content: Mapping[str, Any]) -> None:
    """The gap; of waveforms that nothing explains, that of the nearest candidates beside it."""
    page.heading("How large the gap is" if not findings.names else "How much smaller the gap is")
    table, near = gap(content), findings.verdict.nearest
    page.add(replace(table, rows=_with_nearest(near)) if findings.context.waves and near else table)
    if len(steps := content["contributions"]) > 2:
        rows = [[joined(s["effects"]) or "the base model", _size(s["model_error"])] for s in steps]
        page.text("What each name contributes:")
        page.table(["with", "model error, held out"], rows, "One more at a time, the one that helps most first.")
    if findings.fitted_to_both:
        page.text("The extended model was fitted to the held-out events, too: what they say of it is no test of it.")


def _with_nearest(near: Nearest) -> list[list[str]]:
    """The base model's gap and that of the candidates which come nearest."""
    pairs = (("fitted", near.curves), ("held out", near.carried))
    stages = ("base model", "nearest candidates")
    return [
        [label, stage, _error(c.error.to_dict()), *_off(vars(c))]
        for label, both in pairs
        if both
        for stage, c in zip(stages, both, strict=True)
    ]


def _error(entry: Mapping[str, Any]) -> str:
    """A model's error with its interval, as a table has it."""
    ends = [in_percent(end) for end in entry["interval"] if end is not None and np.isfinite(end)]
    return _size(entry["value"]) + (f" ({ends[0].removesuffix(' %')} to {ends[1]})" if len(ends) == 2 else "")


def _size(error: float | None) -> str:
    """A model's error; none where the model diverges."""
    return "beyond all measure" if error is None or not np.isfinite(error) else in_percent(error)


def _off(misfit: Mapping[str, Any]) -> list[str]:
    """How far off curves are, as a table has it."""
    errors = [misfit["epsilon_p"], misfit["epsilon_q"], *[misfit.get("epsilon_i")]]
    return [*(epsilon(e) for e in errors if e is not None), f"{misfit['chi2_per_sample']:.3f}"]


def _left(page: Report, findings: Findings) -> None:
    """What is left beside the names, or what nothing explains, in words."""
    page.heading("What is left")
    shapes, near = findings.remainder, findings.verdict.nearest
    whose = "the base model" if near is None else f"{joined(near.names)}, the nearest candidates,"
    if findings.names:
        whose = f"the model with {joined(findings.names)}"
    _shapes(page, findings, shapes, whose)
    if near is not None:
        _shapes(page, findings, findings.remainder_of_base, "the base model alone")
    if near is not None:
        _nearest(page, findings)


def _shapes(page: Report, findings: Findings, shapes: Sequence[Remainder], whose: str) -> None:
    """The shapes in what one model leaves."""
    if not shapes:
        page.text(f"Missed by {whose}: nothing of a simple shape, no ringing, decay, step or pulse.")
        return
    beyond = {event.record.name for event in findings.withheld}
    where = "held-out" if shapes[0].event in beyond else "fitted"
    page.text(f"Missed by {whose} on the {where} events, the loudest first: {shapes[0]}.")
    rows = [
        [s.event, s.channel, s.kind, f"{s.start:.3f}", s.when, _number(s.frequency), _number(s.time_constant),
         _number(s.damping), f"{s.size:.2g}", s.times, f"{s.share:.0%}"]
        for s in shapes
    ]  # fmt: skip
    page.table(
        ["event", "channel", "kind", "from t [s]", "when", "frequency [Hz]", "time constant [s]", "damping ratio",
         "size [pu]", "of the noise", "of the excess"], rows,
        "Shapes c exp(-t/tau) cos(2 pi f t + phi) fitted to what is left; the noise is that before the dip.",
        words=(4,),
    )  # fmt: skip


def _nearest(page: Report, findings: Findings) -> None:
    """The candidates that come nearest, with their shares and sizes."""
    near = findings.verdict.nearest
    assert near is not None
    assert near.rival.tests is not None
    by_name = {e.parameter.name: e for e in estimates(near.rival.tests, near.rival.fit.unit, near.names)}
    own = [by_name[p.name] for name in near.names for p in findings.catalogue[name].effect.parameters]
    held = percent(near.held_out) if np.isfinite(near.held_out) else ""
    rows = [[joined(near.names), percent(near.fitted), held]]
    rows += [[joined(names), percent(share), ""] for names, share in near.others]
    page.text("The candidates that come nearest, none of which is accepted:")
    page.table(
        ["nearest candidates", "explain on the fitted events", "on the held-out events"], rows,
        "Shares of the deviance in excess of the noise. A large share is no explanation as long as what is left could"
        " not come about by chance.", words=(0,),
    )  # fmt: skip
    with page.folded(f"How large {joined(near.names)} would be"):
        page.table(
            ["parameter", "meaning", "unit", "value", "95 % interval", "verdict"],
            [[e.parameter.name, e.parameter.about, e.parameter.unit, _value(e), _interval(e), e.verdict] for e in own],
            "As if they were right; something else is missing, so that the intervals may miss the truth.",
            words=(1, 2, 5),
        )  # fmt: skip


def _forms(page: Report, findings: Findings) -> None:
    """Where each effect named acts, what it does there and by which law; curves that were found."""
    if not findings.names:
        return
    entries = forms(findings)
    page.heading("Where it acts, and by which law")
    rows = [
        [f.name, joined(f.effect.places), KINDS[f.effect.kind] if f.effect.kind else "",
         f"the {f.law}'s" if f.law == CATALOGUE else f.effect.differs, f.effect.name]
        for f in entries
    ]  # fmt: skip
    page.table(
        ["effect", "where", "what it does there", "law", "effect in the model"], rows,
        "The catalogue's laws are tried first; other laws and places where the best of them leaves something, or where"
        " their own comes near it.",
        words=(1, 2, 3, 4),
    )  # fmt: skip
    for form in entries:
        if form.law_fit is not None:
            page.chart(
                _curve(form.law_fit),
                f"{form.name}: the law found, with its 95 % band, beside the catalogue's as it fits these events best.",
            )


def _curve(fitted: FittedLaw) -> Chart:
    """A law with its band, and the textbook's."""
    law = fitted.curve
    chart = Chart(law.x_label, [law.y_label], pixels=320)
    chart.band("", law.x, fitted.band[0], fitted.band[1], CURVE)
    chart.line("the law found", law.x, law.y, CURVE, width=2.2)
    chart.line("the catalogue's law", law.x, fitted.textbook, TEXTBOOK, dash="dash")
    shown = np.concatenate([law.y, fitted.textbook])
    room = 0.25 * max(float(np.ptp(shown)), 1e-6)
    return chart.limits(0, float(shown.min()) - room, float(shown.max()) + room)


def _candidates(page: Report, findings: Findings) -> None:
    rows = evidence(findings)
    labels = _labels(rows)
    page.heading("Candidates by their evidence")
    seen = [row for row in rows if np.isfinite(row.drop)]
    if seen:
        page.chart(_bars(findings, seen, labels), _bars_caption(findings, seen))
    for sentence in (why_not_the_most_helpful(findings), beside(findings)):
        page.text(*[sentence] * bool(sentence))
    entries = [
        [
            f"{labels[r]}: {joined(r.names)}" if len(r.names) > 1 else labels[r],
            "" if np.isnan(r.drop) else f"{r.drop:.1f}",
            r.status,
            "; ".join(map(str, r.sizes)),
            r.why,
        ]
        for r in rows
    ]
    chosen = findings.last.fit.names
    single = f"; that of an effect outside of it is what the events say with {joined(chosen)} in the model"
    page.table(
        ["candidate", "deviance lowered by", "status", "size", "why"], entries,
        f"Status of a refitted set is that among the sets of its size{single if chosen else ''}. Sizes have their"
        " standard error where it was reckoned.", words=(0, 2, 3, 4),
    )  # fmt: skip
    _sets(page, findings)
    if chosen:
        _further(page, findings)


def _labels(rows: Sequence[Evidence]) -> dict[Evidence, str]:
    """A candidate's name; sets of several are numbered, because a chart has no room for all their names."""
    sets = [row for row in rows if len(row.names) > 1]
    return {row: f"set {sets.index(row) + 1}" if row in sets else row.names[0] for row in rows}


def _bars(findings: Findings, rows: Sequence[Evidence], labels: Mapping[Evidence, str]) -> Chart:
    """How much each candidate explains by itself."""
    colors = [COLORS.get(r.status, REFITTED if r.how == FITTED else ESTIMATED) for r in rows]
    entries = [f"{r.drop:.{int(r.drop < 100)}f}{f', {r.status}' * (r.standing < 2)}" for r in rows]
    chance = chance_level(findings)
    chart = Chart("deviance", [""], pixels=130 + BAR * len(rows))
    chart.bars("", [labels[r] for r in rows], [r.drop for r in rows], colors, hover=entries)
    return chart.edge(chance, dash="dash").limits(None, 0.0, ROOM * max(chance, *(r.drop for r in rows)))


def _bars_caption(findings: Findings, rows: Sequence[Evidence]) -> str:
    colors = ["green: added"] * bool(findings.names)
    colors += ["orange: tied with it"] * any(r.status == KEPT for r in rows)
    colors += ["blue: refitted"] * any(r.how == FITTED and r.standing == 2 for r in rows)
    colors += ["gray: estimated in one linear step"] * any(r.how == ONE_STEP for r in rows)
    chance = f"{chance_level(findings):.1f}, what chance gives to the most helpful of all in"
    return (
        f"By how much each alone lowers the deviance of the base model ({', '.join(colors)}). Dashed: {chance}"
        f" {findings.context.criteria.false_alarms:.0%} of cases."
    )


def _sets(page: Report, findings: Findings) -> None:
    """How the refitted sets of the chosen size compare."""
    rows = [
        [joined(r.fit.names) or "the base model", f"{r.fit.deviance:.1f}", f"{r.behind:.1f}", f"{r.distance:.1f}",
         "rejected" if r.rejected else "adequate" if r.adequate else "not adequate",
         "" if r.tests is None else by_draws(r.tests.p_left)]
        for r in findings.survivors.rivals[:MOST_SETS]
    ]  # fmt: skip
    with page.folded("How the refitted sets compare"):
        page.table(
            ["set", "deviance", "behind", "distance of the curves", "verdict", "chance leaves as much"], rows,
            "Every set of this size that was refitted. A set is rejected when, were it true, the best would not fit so"
            " well; it is adequate when chance may leave as much as it does.", words=(4, 5),
        )  # fmt: skip


def _further(page: Report, findings: Findings) -> None:
    """What the others would add once the chosen effects are in the model."""
    rows = []
    for j in judgements(findings):
        size = ""
        if j.score is not None:
            size = ", ".join(f"{n} {v:.3g} ± {j.score.deviation[n]:.2g}" for n, v in j.score.size.items())
        rows.append([j.name, j.status, "" if j.score is None else f"{j.score.drop:.1f}", size, j.why])
    names = joined(findings.last.fit.names)
    with page.folded(f"What each effect would add to a model that has {names}"):
        page.table(
            ["effect", "status", "deviance lowered by", "one-step size", "why"], rows,
            "Scores with all nuisances projected out; sizes are departures from the null.", words=(1, 3, 4),
        )  # fmt: skip


def _parameters(page: Report, findings: Findings) -> None:
    """The base model's parameters before and after, and those that came in."""
    page.heading("Parameters before and after" if findings.names else "Parameters of the base model")
    before = {e.parameter.name: e for e in findings.before}
    rows, parameter_estimates = [], findings.after if findings.names else findings.before
    for e in parameter_estimates:
        p, was = e.parameter, before.get(e.parameter.name)
        entries = [_value(was) if was else "not in it"] if findings.names else []
        rows.append([p.name, p.about, p.unit, *entries, _value(e), _interval(e), _brief(e.verdict)])
    stages = ["before", "after"] if findings.names else ["value"]
    columns = ["parameter", "meaning", "unit", *stages, "95 % interval", "verdict"]
    page.table(
        columns, rows, "± one standard error, from the curvature at the fit to the fitted events.",
        words=(1, 2, len(columns) - 1),
    )  # fmt: skip
    if retained := held(findings):
        page.text(f"These events cannot tell {joined(list(retained))}: the extended model holds what was found.")
    if why := [f"{e.parameter.name} is {e.verdict}." for e in parameter_estimates if _brief(e.verdict) != e.verdict]:
        with page.folded("Why some are known badly, and what of them is known"):
            page.items(why)


def _brief(verdict: str) -> str:
    """The first clause of a verdict that has several: 'weakly identified: ± 32 %'."""
    return verdict.split("; ")[0] if ": " in verdict.split(" (")[0] else verdict


def _equations(page: Report, findings: Findings) -> None:
    """The equations that changed or came in, and how the extended model is used."""
    from tractexp.model.model import compose
    from tractexp.model.printed import changed

    page.heading("The extended model")
    if others := [joined(names) for names in findings.verdict.sets[1:]]:
        page.text(f"It has {joined(findings.names)}; {joined(others, 'or')} instead would fit these events as well.")
    page.text(
        f"conf/model/extended.yaml beside this page: {use_of(findings.context.load.domain, 'conf')}. Its equations"
        " that changed or came in:"
    )
    base = findings.context.load
    effects = [findings.catalogue[n].effect for n in findings.names]
    extended = compose(base.motor, base.static, [*base.effects, *effects], domain=base.domain)
    for was, line in changed(base.latex(), extended.latex()):
        if was is not None:
            page.text("before").equation(was).text("after")
        page.equation(line)
    with page.folded("All equations of the extended model"):
        for line in extended.latex():
            page.equation(line)


def _disagreement(page: Report, findings: Findings) -> None:
    """Whether and where the base model disagrees with the records."""
    first = findings.first
    page.heading("Is there a disagreement, and where?")
    text = f"What the base model leaves would come about by chance with a probability of {by_draws(first.p_left)}"
    text += "." if first.adequate else f"; the most surprised of the tests looks for {first.loudest}."
    if first.scores:
        best, alpha = first.scores[0], findings.context.criteria.false_alarms
        text += (
            f" The effect that promises most in one linear step, {best.name}, would lower the deviance by"
            f" {best.drop:.1f}, with a probability of {in_words(best.p)} by chance; chance gives less than"
            f" {in_words(first.chance.critical_p(alpha))} to the best of all candidates in {alpha:.0%} of cases."
        )
    page.text(text)
    if not findings.places:
        page.text("No interval holds more energy than chance leaves there.")
        return
    page.table(
        ["event", "channel", "from [s]", "to [s]", "share of the excess"],
        [[p.event, p.channel, f"{p.start:.3f}", f"{p.end:.3f}", f"{p.share:.0%}"] for p in findings.places],
        "Intervals in which the base model leaves more than chance does, at a family-wise error of"
        f" {findings.context.criteria.false_alarms:.0%}; shaded in the charts.", words=(1,),
    )  # fmt: skip


def _noise(page: Report, findings: Findings) -> None:
    level, free = findings.context.describe(findings.last.noise), joined(findings.catalogue.of_measurement)
    if findings.context.waves:
        unjudged = findings.last.noise.loudest_input_mode > findings.context.criteria.blurred
        how = (
            "and not judged: these offsets and edges would pass for them" if unjudged else "each held by what is likely"
        )
        faults = f" Faults of the measurement ({free}) are free in every fit, {how}." * bool(free)
        page.heading("Noise").text(f"{level}. {NOISE_OF_WAVES}{faults}")
        return
    page.heading("Noise").text(
        f"{level}. It is estimated where nothing happens, from what the fit leaves there, and"
        " so contains what smoothing leaves of the voltage's noise. Time skew, measurement window and load drift are"
        " free in every fit, each held by what is physically likely."
    )
    if (window := findings.context.records.window) is not None:
        model = " The extended configuration does not do so." if findings.names else ""
        page.text(
            f"{window.describe().capitalize()}, of voltage and current alike: any other window would"
            " make the voltage bend where the power does not. The voltage that the load saw is reckoned back from the"
            f" record, and the current of the model is averaged as the recorder does.{model}"
        )


def _value(estimate: ParameterEstimate) -> str:
    bound = "" if np.isfinite(estimate.error) else ", at its bound"
    return f"{with_error(estimate.value, estimate.error)}{bound}"


def _interval(estimate: ParameterEstimate) -> str:
    low, high = estimate.interval
    return f"{low:.4g} to {high:.4g}" if np.isfinite(low) else ""


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"
