"""Measured, before, after: the charts in which one sees whether a model describes an event."""

from collections.abc import Sequence

from tractexp.discrepancy.overlay import Overlay
from tractexp.record import describe
from tractexp.report.chart import Chart
from tractexp.report.events import CAPTION, Curve, event_chart
from tractexp.report.page import Page

BASE, EXTENDED, NEAREST = "#D55E00", "#0072B2", "#CC79A7"
SHOWN = 4  # events of each role that are not folded


def overlaid(page: Page, overlays: Sequence[Overlay]) -> Page:
    """A chart of each event, the fitted ones first; those beyond the first few are folded."""
    page.text(CAPTION)
    for role, held_out in (("fitted", False), ("held out", True)):
        group = [o for o in overlays if o.held_out == held_out]
        for overlay in group[:SHOWN]:
            _shown(page, overlay, role)
        if more := group[SHOWN:]:
            with page.folded(f"{len(more)} more events, {role}"):
                for overlay in more:
                    _shown(page, overlay, role)
    return page


def _shown(page: Page, overlay: Overlay, role: str) -> None:
    page.heading(f"{overlay.event.record.name}, {role}", level=3).chart(chart(overlay), f"{describe(overlay.event)}.")


def chart(overlay: Overlay) -> Chart:
    """One event with the curves of the models; the noise band is that of the best of them."""
    best = overlay.before if overlay.after is None else overlay.after
    curves = [
        Curve(name, power, color, dash)
        for name, power, color, dash in (
            ("base model", overlay.before, BASE, "solid"),
            ("nearest candidates", overlay.nearest, NEAREST, "dot"),
            ("extended model", overlay.after, EXTENDED, "solid"),
        )
        if power is not None
    ]
    return event_chart(
        overlay.event, curves, deviation=overlay.deviation, around=best, places=overlay.places, driving=overlay.driving
    )
