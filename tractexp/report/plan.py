"""The page of a plan: what was asked, the answer, what each kind of dip would tell, and which
events to fit.
"""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.blocks import Report, Table
from tractexp.blocks.chart import Chart
from tractexp.blocks.style import PALETTE
from tractexp.domain import PHASORS, WAVES
from tractexp.identification.plan import INERTIA, ChosenEvent, IntervalForecast, Needed, find_column
from tractexp.inference.problem import Problem
from tractexp.text.wording import finish_sentence, list_first

DEPTH, DURATION, RATE = "depth", "duration [s]", "samples per second"
JUMP, UNBALANCE = "phase jump [degrees]", "negative sequence, of the depth"
AXES = {  # of a scan: what its axis says, and what a value is multiplied by
    DEPTH: ("depth of the dip [%]", 100.0),
    DURATION: ("duration of the dip [ms]", 1000.0),
    RATE: ("samples per second", 1.0),
    PHASORS.planned_noise: ("noise [% of P before the dip]", 100.0),
    JUMP: ("phase jump [degrees]", 1.0),
    UNBALANCE: ("U2, % of the depth", 100.0),
    WAVES.planned_noise: ("noise of the currents [% of P]", 100.0),
}
LINES = [(color, dash) for dash in ("solid", "dash", "dot") for color in PALETTE]
CEILING = 10.0  # times the value: wider intervals are not told
MOST_TOLD_EVENTS = 4  # of the best that a line names
ROWS, FEW = 20, 6  # of a table, about; of one on a terminal


@dataclass(frozen=True, eq=False)
class Planned:
    """A plan and what came of it. `values` (d,) are planned at, `scans` {label: (x, forecasts)}."""

    problem: Problem
    values: np.ndarray
    origin: str  # where the values are from, in words
    dip: str  # what was planned, in words
    needed: Needed
    scans: Mapping[str, tuple[Sequence[float], Sequence[IntervalForecast]]]
    chosen: Sequence[ChosenEvent]  # none where there is one event
    least: float  # share by which an event must narrow the intervals to be chosen
    most: int | None  # events asked for


def format_relative(relative: float) -> str:
    """A share as a number of percent; a dash from ten times the value on."""
    if not relative < CEILING:
        return "-"
    return f"{100 * relative:.0f}" if relative >= 0.0995 else f"{100 * relative:.2g}"


def build_summary(content: Mapping[str, Any]) -> Report:
    """The plan and its values, the forecasts, the answer, and the best events."""
    values = ", ".join(f"{name} {value:.4g}" for name, value in content["parameters"].items())
    report = Report().text(content["dip"], f"parameters, {content['origin']}: {values}")
    report.add(*(scan(content, label, FEW) for label in content["half_intervals"]))
    report.text(f"how deep? {content['answer']}")
    for k, event in enumerate(content["best_events"], start=1):
        narrower = f", intervals narrower by {event['gain']:.0%}" if k > 1 else ""
        report.text(f"event {k} of the best: {event['name']}{narrower}")
    return report.text(content["other_events"]) if content["other_events"] else report


def build_screen(content: Mapping[str, Any]) -> Report:
    """The answer first, then the forecasts by depth, and the best events."""
    report = Report().text(f"how deep? {content['answer']}", content["dip"], "")
    report.add(scan(content, DEPTH, FEW))
    names = [event["name"] for event in content["best_events"]]
    if names:
        report.text(f"events that tell most together: {list_first(names, MOST_TOLD_EVENTS)}")
    return report


def scan(content: Mapping[str, Any], label: str, rows: int = ROWS) -> Table:
    """The forecasts over one property of the dip, about so many of them, in percent
    of the value.
    """
    forecasts, names = content["half_intervals"][label], [*content["parameters"]]
    picked = forecasts[:: max(1, round(len(forecasts) / rows))]
    cells = [
        [f"{f['at']:.4g}", *(format_relative(math.nan if f[n] is None else f[n]) for n in names)]
        for f in picked
    ]
    title = (
        f"half of the 95 % interval, % of the value, by {label}; -: ten times the value and more"
    )
    return Table([label.partition(",")[0].partition(" ")[0], *names], cells, title)


def report(planned: Planned, content: Mapping[str, Any]) -> Report:
    """The page of a plan: how deep a dip is needed, and each interval against its shape."""
    needed = planned.needed
    title = f"How deep a dip tells {needed.parameter}"
    page = Report(
        title, f"A plan for {planned.problem.model.title}, before anything more is recorded."
    )
    page.verdict(finish_sentence(str(needed)), kind="bad" if needed.depth is None else "good")
    by_depth, *others = [
        _chart_halves(planned, label, legend=label == DEPTH) for label in planned.scans
    ]
    page.chart(by_depth, _write_caption(needed))
    _add_question_section(page, planned)
    page.heading("What another kind of dip would tell")
    page.text(
        "One property of the dip is varied at a time, the others stay as planned. Each curve is"
        " half of the 95 % interval in percent of the value, in the colors above; it ends where"
        " that is ten times the value, or the record cannot tell it."
    )
    page.charts(others)
    with page.fold_blocks("The same in numbers"):
        page.add(*(scan(content, label) for label in planned.scans))
    _add_best_events(page, planned)
    page.heading("What it rests on").items(
        [
            f"Intervals follow from the sensitivity of {planned.problem.domain.compared} to each"
            " parameter at the values above. Where the interval is wide, or the values are far off,"
            " so is the forecast.",
            f"The planned dip falls from 1 pu and comes back along {planned.problem.domain.edges}.",
            "Noise of the recorded voltage, and effects that the model lacks, are not in it.",
        ]
    )
    return page


def _write_caption(needed: Needed) -> str:
    """The caption of the chart."""
    met = "" if needed.depth is None else ", met at the dotted line"
    return (
        "Half of the 95 % interval of each parameter, in percent of its value, by the depth of the"
        f" dip. Dashed: the ± {100 * needed.within:g} % asked for {needed.parameter}{met}."
    )


def _chart_halves(planned: Planned, label: str, legend: bool) -> Chart:
    """Half intervals in percent against one property of the dip; the parameter asked for is drawn
    bold.
    """
    needed, (x, forecasts) = planned.needed, planned.scans[label]
    text, factor = AXES[label]
    at = factor * np.asarray(x, dtype=float)
    relative = np.array([f.relative for f in forecasts])
    relative = 100 * np.where(relative < CEILING, relative, np.nan)
    few = max(at) > 19.5 * min(at) > 0  # tried values far apart: they are the marks
    chart = Chart(
        text,
        ["± % of the value"],
        log_x=few,
        log_y=True,
        pixels=440 if legend else 320,
        legend=legend,
    )
    bold = find_column(forecasts[0].names, needed.parameter)
    for j, (name, (color, dash)) in enumerate(
        zip(forecasts[0].names, itertools.cycle(LINES), strict=False)
    ):
        name = f"{name} ({INERTIA})" if j == bold and needed.parameter == INERTIA else name
        chart.line(name, at, relative[:, j], color, dash=dash, width=3.2 if j == bold else 1.5)
    chart.level(100 * needed.within)
    if label == DEPTH and needed.depth is not None:
        chart.edge(factor * needed.depth)
    if few:
        chart.ticks(None, at.tolist()).limits(None, min(at) / 1.1, 1.2 * max(at))
    low, high = (
        np.nanmin(relative, initial=100 * needed.within),
        np.nanmax(relative, initial=100 * needed.within),
    )
    return chart.limits(0, 0.8 * low, 1.25 * high).ticks(0, list_marks(low, high))


def list_marks(low: float, high: float) -> list[float]:
    """Where a logarithmic axis from low to high is marked: powers of ten, and 2 and 5 times these
    where it is short.
    """
    digits = (1.0, 2.0, 5.0) if high < 100 * low else (1.0,)
    powers = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    return [float(f"{digit}e{power}") for power in powers for digit in digits]


def _add_question_section(page: Report, planned: Planned) -> None:
    """The question, the dip and the parameters it is planned at."""
    needed, problem = planned.needed, planned.problem
    stands = ", which is known as well as M," if needed.parameter == INERTIA else ""
    page.heading("What was asked").items(
        [
            f"How deep must a dip be for {needed.parameter}{stands} to be known within ±"
            f" {100 * needed.within:g} %?",
            finish_sentence(planned.dip),
            f"Recorded already: {', '.join(e.record.name for e in problem.events)}.",
        ]
    )
    page.table(
        ["symbol", "meaning", "value", "unit", "bounds"],
        [*_list_parameters(planned)],
        caption=f"Planned at {planned.origin}. P and Q are the active and reactive power; pu is per"
        " unit of the record's own base.",
        words=(1,),
    )


def _list_parameters(planned: Planned) -> Iterator[list[str]]:
    """A line for every parameter, and for the inertia constant that stands for M."""
    problem = planned.problem
    values = dict(zip(problem.space.names, planned.values, strict=True)) | dict(problem.fixed)
    for parameter in problem.parameters:
        name, (low, high) = parameter.name, parameter.bounds
        within = "fixed" if name in problem.fixed else f"{low:g} .. {high:g}"
        yield [name, parameter.about, f"{values[name]:.4g}", parameter.unit, within]
    if "M" in values:
        frequency = problem.events[0].record.base.frequency
        yield [
            INERTIA,
            f"inertia constant M omega_s / 2, omega_s = 2 pi {frequency:g} rad/s: kinetic energy at"
            " synchronous speed, over the base power",
            f"{values['M'] * np.pi * frequency:.4g}",
            "s",
            "those of M",
        ]


def _add_best_events(page: Report, planned: Planned) -> None:
    """The best events of the archive, in the order in which they are worth fitting."""
    page.heading("Which events of the archive to fit")
    if not planned.chosen:
        page.text(
            "There is one event. With several in data.train, the page names those that tell most"
            " together."
        )
        return
    names, values = planned.problem.space.names, np.maximum(np.abs(planned.values), 1e-12)
    rows = [
        [
            str(k),
            c.name,
            "" if k == 1 else f"{c.gain:.0%}",
            *map(format_relative, np.asarray(c.half) / values),
        ]
        for k, c in enumerate(planned.chosen, start=1)
    ]
    page.table(
        ["", "event", "narrower by", *names],
        rows,
        caption="Half of the 95 % interval of a joint fit of this event and those above it, in"
        " percent of the value.",
        words=(1,),
    )
    if left_out := explain_rest(planned):
        page.text(f"{left_out}.")


def explain_rest(planned: Planned) -> str:
    """Why events of the archive are not among the chosen, "" where all are."""
    recorded = len(planned.problem.events)
    if not planned.chosen or len(planned.chosen) == recorded:
        return ""
    if planned.most is not None and len(planned.chosen) == planned.most:
        return f"{planned.most} of {recorded} events were asked for"
    return f"the next would narrow them by less than {planned.least:.0%}"
