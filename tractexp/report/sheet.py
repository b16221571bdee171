"""The sheet that a planner hands in: what load this is, its model with numbers on both bases, how
well it follows the record in MW and Mvar, what it may be used for, and how it was made.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.blocks import Report, Table, style
from tractexp.blocks.chart import Chart
from tractexp.configuration.run_command import build_folder_command, get_command
from tractexp.errors import UserError
from tractexp.exchange.format import choose_format
from tractexp.exchange.rating import SOURCE, rate_machine
from tractexp.identification.verdict import shorten_verdict
from tractexp.record.identity import compose_title, describe_identities
from tractexp.report.fit_sentences import describe_rivals
from tractexp.report.fit_summary import name_verdicts
from tractexp.report.fit_tables import list_error_rows, list_origin
from tractexp.report.screen import choose_units, describe_load
from tractexp.text.wording import count_noun, finish_sentence, format_with_error

if TYPE_CHECKING:
    from tractexp.api.identification import Identification

PANEL_HEIGHTS = (0.8, 1.3, 1.3)
CHART_PIXELS = 430
MOST_CHARTS = 4  # events that are drawn
MOST_POINTS = 1600  # of a line: twice as many as a printed page is wide
USES = {
    "usable": (
        "It may be used for this load in studies of voltage dips like those below: it leaves no"
        " more than the noise of the recording."
    ),
    "doubtful": (
        "It may be used where its error below is acceptable; an effect is missing that the noise"
        " does not hide."
    ),
    "unusable": "It must not be used as a model of this load.",
    "": "Whether it may be used was not judged.",
}


def build_sheet(fit: "Identification") -> Report:
    """The sheet, for A4: verdict, powers, parameters, errors, limits, equations, origin."""
    result = fit.result
    names = [event["name"] for event in result.events if event["role"] == "train"]
    page = Report(
        f"Load model of {compose_title(result.identities, names)}",
        finish_sentence(describe_load(result, names).removeprefix("load: ")),
    )
    page.verdict(
        f"{fit.usability.upper()}. {finish_sentence(fit.usability_reason)}".removeprefix(". "),
        USES[fit.usability],
        kind={"usable": "good", "unusable": "bad"}.get(fit.usability, "plain"),
    )
    page.heading("Load and record").items(describe_identities(result.identities) or names)
    page.add(_tabulate_powers(fit))
    page.heading("Parameters").text(finish_sentence(fit.model.model.title)).add(_tabulate(fit))
    _add_machine(page, fit)
    page.heading("Measured and calculated").add(_tabulate_errors(fit))
    _add_charts(page, fit)
    page.heading("What is missing, and what it may be used for").items(_list_limits(fit))
    page.heading("Equations").text("Per unit, in the frame of the terminal voltage.")
    for line in fit.model.model.latex():
        page.equation(line)
    page.heading("How this sheet was made")
    return page.table(["", ""], [*list_origin(result, get_command()), *_export(fit)], words=(1,))


def _tabulate_powers(fit: "Identification") -> Table:
    """The powers that the load and its parts draw before the dip."""
    (scale, units), point = choose_units(fit.result), fit.operating_point
    before = fit.result.before
    rows = [["load", scale * before["P0"], scale * before["Q0"]]]
    if point is not None:
        static = point.P - point.P_motor, point.Q - point.Q_motor
        rows += [["motor", point.P_motor, point.Q_motor], ["static load", *static]]
    columns = ["before the dip", *(f"{x} [{u}]" for x, u in zip("PQ", units[:2], strict=True))]
    refused = "" if point else "The model has no motor at rest, so that its parts are not told."
    return Table(columns, rows, "", refused)


def _tabulate(fit: "Identification") -> Table:
    """The parameters on the load's base."""
    rows = [
        [
            e.name,
            e.about,
            format_with_error(e.value, e.standard_error or 0.0),
            e.unit,
            "{:.4g} to {:.4g}".format(*e.interval) if e.interval else "",
            shorten_verdict(e.verdict),
        ]
        for e in fit.own_parameters
    ]
    base = f"Per unit of {fit.result.base}. ± one standard error."
    columns = ["parameter", "meaning", "value", "unit", "95 % interval", "verdict"]
    return Table(columns, rows, "", base, words=(1, 3, 5))


def _add_machine(page: Report, fit: "Identification") -> None:
    """The motor on its own rating beside typical machines; why not where it has none."""
    page.heading("The motor on its own rating")
    try:
        machine = rate_machine(fit.result)
    except UserError as error:
        page.text(finish_sentence(str(error)))
        return
    scale, (*_, unit) = choose_units(fit.result)
    size = f"{scale * machine.rating:.4g} {unit}"
    rows = [
        [q.about, q.value, q.unit, f"{q.low:.3g} to {q.high:.3g}", q.place]
        for q in machine.quantities
    ]
    page.table(
        ["", f"on {size}", "unit", "typical", "it is"],
        rows,
        f"The rating is taken to be the motor's apparent power before the dip, {size}: a record"
        f" tells no plate. Typical: {SOURCE}.",
        words=(2, 4),
    )


def _tabulate_errors(fit: "Identification") -> Table:
    """How far the model is off each event."""
    return Table(
        ["event", "role", "error, of the response", "95 % interval"],
        list_error_rows(fit.result),
        "",
        "Error: rms of what is left beyond the noise, from the dip on, over the rms of the load's"
        " response, both in apparent power.",
        words=(1,),
    )


def _add_charts(page: Report, fit: "Identification") -> None:
    """Measured and calculated power of the first events."""
    scale, units = choose_units(fit.result)
    fits = fit.details.fits
    for one in fits[:MOST_CHARTS]:
        voltage = one.event.record.base.voltage
        level, kilovolt = (voltage, "kV") if voltage != 1.0 else (1.0, "pu")
        labels = [f"U [{kilovolt}]", f"P [{units[0]}]", f"Q [{units[1]}]"]
        chart = Chart("t [s]", labels, heights=PANEL_HEIGHTS, pixels=CHART_PIXELS)
        _draw(chart, one, (level, scale, scale))
        page.chart(chart, one.event.record.name)
    if len(fits) > MOST_CHARTS:
        page.text(f"{count_noun(len(fits) - MOST_CHARTS, 'event')} more: see report.html.")


def _draw(chart: Chart, one: Any, scales: tuple[float, float, float]) -> None:
    record, (level, *powers) = one.event.record, scales

    def line(name: str, values: np.ndarray, color: str, panel: int, width: float = 1.6) -> None:
        chart.line(name, *style.thin(record.t, values, MOST_POINTS), color, panel, width=width)

    line("measured", level * record.U, style.MEASURED, 0, 3)
    for panel, (name, color, scale) in enumerate(
        zip("PQ", (style.ACTIVE, style.REACTIVE), powers, strict=True), start=1
    ):
        measured, calculated = np.asarray(getattr(record, name)), np.asarray(getattr(one, name))
        line("measured", scale * measured, style.MEASURED, panel, 3)
        line(f"{name} calculated", scale * calculated, color, panel)
    chart.edge(one.event.t_start).edge(one.event.t_end)


def _list_limits(fit: "Identification") -> list[str]:
    """The limits of the model's use, a sentence each."""
    said = [finish_sentence(doubt) for doubt in fit.doubts]
    said += [f"{name} is {verdict}." for name, verdict in name_verdicts(fit.result).items()]
    said += map(finish_sentence, describe_rivals(fit))
    if not fit.result.model_error.get("held_out"):
        said.append("No event was held out: how it predicts another dip is not known.")
    if not fit.result.base.in_mva:
        said.append("The record does not say what one per unit is, so that there are no MW.")
    said += [finish_sentence(f"next: {text}") for text in fit.advice[:1]]
    return said


def _export(fit: "Identification") -> list[list[str]]:
    """The command that exports the model, or why none does."""
    if fit.usability == "unusable":
        return [["export", "refused: the model is unusable; task.doubtful=true exports it"]]
    name = choose_format(fit.result)
    if not name:
        return [["export", "refused: no format represents every part of this model"]]
    made = build_folder_command("task=export", f"task.format={name}")
    return [["export", made]] if made else []
