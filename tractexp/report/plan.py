"""The page of a plan: what was asked, the answer, what each kind of dip would tell, and which events to fit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tractexp.identification.plan import INERTIA, Choice, Forecast, Needed
from tractexp.identification.problem import Problem
from tractexp.report.page import Page

ROWS = 20  # of a table, about: of a longer scan every other row


@dataclass(frozen=True, eq=False)
class Planned:
    """A plan and what came of it. `values` (d,) are planned at, `scans` {label: (x, forecasts)}."""

    problem: Problem
    values: np.ndarray
    origin: str  # where the values are from, in words
    dip: str  # what was planned, in words
    needed: Needed
    scans: Mapping[str, tuple[Sequence[float], Sequence[Forecast]]]
    chosen: Sequence[Choice]  # none where there is one event
    least: float  # share by which an event must narrow the intervals to be chosen
    most: int | None  # events asked for


def percent(relative: float) -> str:
    """A share as a number of percent; a dash from ten times the value on."""
    if not relative < 10:
        return "-"
    return f"{100 * relative:.0f}" if relative >= 0.0995 else f"{100 * relative:.2g}"


def page(path: Path, planned: Planned, figure: Path) -> Path:
    """Write the page, with `figure` drawn into it; returns its path."""
    needed = planned.needed
    answer = str(needed)
    title = f"How deep a dip tells {needed.parameter}"
    made = Page(title, f"A plan for {planned.problem.model.title}, before anything more is recorded.")
    made.verdict(f"{answer[0].upper()}{answer[1:]}.", kind="bad" if needed.depth is None else "good")
    _asked(made, planned)
    made.heading("What a dip would tell")
    made.text(
        "One property of the dip is varied at a time, the others stay as above. In each row: half of the 95 % interval,"
        " in percent of the value; a dash where it is ten times the value or more."
    )
    for label, (x, forecasts) in planned.scans.items():
        step = max(1, round(len(x) / ROWS))
        rows = [[f"{at:.4g}", *map(percent, f.relative)] for at, f in zip(x[::step], forecasts[::step], strict=True)]
        made.table([label, *forecasts[0].names], rows)
    made.figure(figure, f"The same, with the ± {100 * needed.within:g} % that was asked for as a line.")
    _events(made, planned)
    made.heading("What it rests on").items(
        [
            "Intervals follow from the sensitivity of P and Q to each parameter at the values above. Where the"
            " interval is wide, or the values are far off, so is the forecast.",
            "The planned dip falls from 1 pu and comes back along straight edges of 20 ms.",
            "Noise of the recorded voltage, and effects that the model lacks, are not in it.",
        ]
    )
    return made.write(path)


def _asked(made: Page, planned: Planned) -> None:
    """The question, the dip and the parameters it is planned at."""
    needed, problem = planned.needed, planned.problem
    stands = f" (it has the relative precision of M, since {INERTIA} = M omega_s / 2)" * (needed.parameter == INERTIA)
    made.heading("What was asked").items(
        [
            f"How deep must a dip be for {needed.parameter}{stands} to be known within ± {100 * needed.within:g} %?",
            f"{planned.dip[0].upper()}{planned.dip[1:]}.",
            f"Recorded already: {', '.join(e.record.name for e in problem.events)}.",
        ]
    )
    about = {p.name: p for p in problem.parameters}
    rows = [
        [name, f"{value:.4g}", about[name].unit, f"{low:g} .. {high:g}", about[name].about]
        for name, value, low, high in zip(
            problem.space.names, planned.values, problem.lower, problem.upper, strict=True
        )
    ]
    rows += [
        [name, f"{value:.4g}", about[name].unit, "fixed", about[name].about] for name, value in problem.fixed.items()
    ]
    made.table(
        ["parameter", "value", "unit", "bounds", "meaning"], rows, caption=f"Planned at {planned.origin}.", words=(4,)
    )


def _events(made: Page, planned: Planned) -> None:
    """The best events of the archive, in the order in which they are worth fitting."""
    made.heading("Which events of the archive to fit")
    if not planned.chosen:
        made.text("There is one event. With several in data.train, the page names those that tell most together.")
        return
    names, values = planned.problem.space.names, np.maximum(np.abs(planned.values), 1e-12)
    rows = [
        [str(k), c.name, "" if k == 1 else f"{c.gain:.0%}", *map(percent, np.asarray(c.half) / values)]
        for k, c in enumerate(planned.chosen, start=1)
    ]
    made.table(
        ["", "event", "narrower by", *names],
        rows,
        caption="Half of the 95 % interval of a joint fit of this event and those above it, in percent of the value.",
        words=(1,),
    )
    if left_out := rest(planned):
        made.text(f"{left_out}.")


def rest(planned: Planned) -> str:
    """Why events of the archive are not among the chosen, "" where all are."""
    recorded = len(planned.problem.events)
    if not planned.chosen or len(planned.chosen) == recorded:
        return ""
    if planned.most is not None and len(planned.chosen) == planned.most:
        return f"{planned.most} of {recorded} events were asked for"
    return f"the next would narrow them by less than {planned.least:.0%}"
