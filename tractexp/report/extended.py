"""The extended model of an investigation: where each effect acts and by which law, parameters and
equations.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from tractexp.blocks import Report
from tractexp.blocks.chart import Chart
from tractexp.discrepancy.discrepancy_json import use_of
from tractexp.discrepancy.findings import Findings
from tractexp.discrepancy.forms import CATALOGUE, describe_forms
from tractexp.identification.verdict import shorten_verdict
from tractexp.inference.interval import ParameterEstimate
from tractexp.model.sites import KINDS
from tractexp.text.wording import format_with_error, join_alternatives, join_words

CURVE, TEXTBOOK = "#0072B2", "#D55E00"


def add_laws(page: Report, findings: Findings) -> None:
    """Where each effect named acts, what it does there and by which law; curves that were found."""
    if not findings.names:
        return
    entries = describe_forms(findings)
    page.heading("Where it acts, and by which law")
    rows = [
        [
            name,
            join_words(form["place"]),
            KINDS[form["kind"]] if form["kind"] else "",
            f"the {CATALOGUE}'s" if form["law"] == CATALOGUE else form["differs"],
            form["effect"],
        ]
        for name, form in entries
    ]
    page.table(
        ["effect", "where", "what it does there", "law", "effect in the model"],
        rows,
        "The catalogue's laws are tried first, then other laws and places of every family: a wrong"
        " formula may leave nothing where the right one is of another law.",
        words=(1, 2, 3, 4),
    )
    for name, form in entries:
        if form["curve"] is not None:
            page.chart(
                _chart_law(form["curve"]),
                f"{name}: the law found, with its 95 % band, beside the catalogue's as it fits"
                " these events best.",
            )


def _chart_law(law: Mapping[str, Any]) -> Chart:
    """The law found with its band, beside the catalogue's."""
    x, y, lower, upper, textbook = (
        np.array(law[key]) for key in ("x", "y", "lower", "upper", "textbook")
    )
    chart = Chart(law["x_label"], [law["y_label"]], pixels=320)
    chart.band("", x, lower, upper, CURVE)
    chart.line("the law found", x, y, CURVE, width=2.2)
    chart.line("the catalogue's law", x, textbook, TEXTBOOK, dash="dash")
    shown = np.concatenate([y, textbook])
    room = 0.25 * max(float(np.ptp(shown)), 1e-6)
    return chart.limits(0, float(shown.min()) - room, float(shown.max()) + room)


def add_parameters(page: Report, findings: Findings) -> None:
    """The base model's parameters before and after, and those that came in."""
    page.heading(
        "Parameters before and after" if findings.names else "Parameters of the base model"
    )
    before = {e.parameter.name: e for e in findings.base_grade.parameters}
    rows, parameter_estimates = [], findings.graded_parameters
    for e in parameter_estimates:
        p, was = e.parameter, before.get(e.parameter.name)
        entries = [format_estimate(was) if was else "not in it"] if findings.names else []
        rows.append(
            [
                p.name,
                p.about,
                p.unit,
                *entries,
                format_estimate(e),
                format_interval(*e.interval),
                shorten_verdict(e.verdict),
            ]
        )
    stages = ["before", "after"] if findings.names else ["value"]
    is_exact = findings.final_grade.uncertainty.exact
    how = "the curvature" if is_exact else "blocks of 0.1 s left out in turn"
    columns = ["parameter", "meaning", "unit", *stages, "95 % interval", "verdict"]
    page.table(
        columns,
        rows,
        f"± one standard error, from {how} in the fit of the graded model.",
        words=(1, 2, len(columns) - 1),
    )
    if retained := findings.undetermined_values:
        page.text(
            f"These events cannot tell {join_words(list(retained))}: the extended model holds what"
            " was found."
        )
    if why := [
        f"{e.parameter.name} is {e.verdict}."
        for e in parameter_estimates
        if shorten_verdict(e.verdict) != e.verdict
    ]:
        with page.fold_blocks("Why some are known badly, and what of them is known"):
            page.items(why)


def add_equations(page: Report, findings: Findings) -> None:
    """The equations that changed or came in, and how the extended model is used."""
    from tractexp.model.printed import list_changed_lines

    page.heading("The extended model")
    if others := join_alternatives(findings.verdict.sets[1:]):
        page.text(
            f"It has {join_words(findings.names)}; {others} instead would fit these events as well."
        )
    command = use_of(
        findings.context.load.domain, "conf/model/extended.yaml", fit_all=findings.fitted_to_both
    )
    page.text(
        f"conf/model/extended.yaml beside this page: {command}. Its equations that changed or came"
        " in:"
    )
    base = findings.context.load
    extended = base.extend(findings.catalogue[n].effect for n in findings.names)
    for was, line in list_changed_lines(base.latex(), extended.latex()):
        if was is not None:
            page.text("before").equation(was).text("after")
        page.equation(line)
    with page.fold_blocks("All equations of the extended model"):
        for line in extended.latex():
            page.equation(line)


def format_estimate(estimate: ParameterEstimate) -> str:
    """An estimate with its error, and whether it is at its bound."""
    bound = "" if np.isfinite(estimate.error) else ", at its bound"
    return f"{format_with_error(estimate.value, estimate.error)}{bound}"


def format_interval(low: float, high: float) -> str:
    """ "0.1 to 0.2"; "" where an end is open."""
    return f"{low:.4g} to {high:.4g}" if np.isfinite([low, high]).all() else ""
