"""What to record next, as a section of an investigation's page and as a page of its own."""

import numpy as np

from tractexp.blocks import Report
from tractexp.blocks.chart import Chart
from tractexp.blocks.style import PALETTE
from tractexp.discrepancy.next_event.choose import DECIDED, EventTrial, NextEvent
from tractexp.text.wording import finish_sentence

MOST_EVENTS_A_KIND = 2  # events of each kind that a table has
KINDS = (
    "dip",
    "tap or capacitor bank",
    "dip with a phase jump and f",
    "unbalanced dip with U2",
    "dip sampled faster",
)


def report(choice: NextEvent, title: str) -> Report:
    """The page of a plan for rivals."""
    page = Report("What to record next", f"For {title}, to tell {' from '.join(choice.rivals)}.")
    sure = choice.probability >= DECIDED
    page.verdict(
        finish_sentence(choice.sentence()),
        kind="good" if sure else "bad" if choice.same else "plain",
    )
    add_section(page, choice)
    return page


def add_section(page: Report, choice: NextEvent) -> None:
    """The chances by dip as charts, the best events of each kind, and which pair each
    tells apart.
    """
    if not choice.same or len(choice.rivals) > 2:
        page.chart(_chart_probability(choice), _write_caption(choice))
    page.heading("What each kind of event would do", 3)
    page.table(
        ["event", "probability [%]"],
        [_build_row(t) for kind in KINDS for t in _select_surest_events(choice, kind)],
        "Probability that all rivals but the true one are rejected, the least over all of them as"
        " the truth. The best events of each kind.",
        words=(0,),
    )
    best = choice.best
    page.heading("Rival by rival", 3)
    page.table(
        ["if the truth is", *(f"{k} is rejected [%]" for k in range(1, 1 + len(choice.rivals)))],
        [
            [
                f"{a + 1}: {name}",
                *("" if a == b else f"{100 * p:.0f}" for b, p in enumerate(best.pairs[a])),
            ]
            for a, name in enumerate(choice.rivals)
        ],
        f"By {best.event.words}.",
        words=(0,),
    )
    page.text(
        "Each rival in turn is taken as the truth with its fitted parameters, as uncertain as the"
        " records leave them; all others are fitted to the records and the new event together,"
        " under the noise of their fits"
        + (
            ", by a refit of every parameter."
            if best.refitted
            else ", linearised about their fits."
        )
        + " Noise of the voltage, and laws that no rival has, are not in it."
    )


def _write_caption(choice: NextEvent) -> str:
    """The caption of the chart."""
    decided = f"Dashed: the {DECIDED:.0%} from which an event is recommended as sure."
    return (
        "Probability that one dip more tells all rivals apart, by its depth and duration."
        f" {decided}"
    )


def _chart_probability(choice: NextEvent) -> Chart:
    """Probability by depth, a line for each duration."""
    chart = Chart("depth of the dip [%]", ["probability [%]"], pixels=360)
    plain = [t for t in choice.tried if _tell_kind(t) == KINDS[0]]
    for color, duration in zip(PALETTE, sorted({t.event.duration for t in plain}), strict=False):
        line = sorted((t.event.depth, t.least) for t in plain if t.event.duration == duration)
        x, y = 100 * np.array(line).T
        chart.line(f"{1000 * duration:.0f} ms", x, y, color, width=2.0)
    return chart.level(100 * DECIDED).limits(0, -3, 103)


def _tell_kind(tried: EventTrial) -> str:
    """The kind of an event that was tried."""
    event = tried.event
    if event.unbalance:
        return KINDS[3]
    if event.rate > 1:
        return KINDS[4]
    if event.switched:
        return KINDS[1]
    return KINDS[2] if event.jump else KINDS[0]


def _select_surest_events(choice: NextEvent, kind: str) -> list[EventTrial]:
    """The surest events of a kind."""
    ranked = sorted(
        (t for t in choice.tried if _tell_kind(t) == kind),
        key=lambda t: (-t.least, t.event.burden),
    )
    return ranked[:MOST_EVENTS_A_KIND]


def _build_row(tried: EventTrial) -> list[str]:
    """An event's cells."""
    return [tried.event.words, f"{100 * tried.least:.0f}"]
