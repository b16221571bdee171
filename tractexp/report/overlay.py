"""Measured, before, after: the charts in which one sees whether a model describes an event."""

from collections.abc import Sequence

import numpy as np

from tractexp.discrepancy.overlay import Overlay
from tractexp.record import describe
from tractexp.report import style
from tractexp.report.chart import MOST, Chart
from tractexp.report.page import Page

BASE, EXTENDED, NEAREST, FOUND = "#D55E00", "#0072B2", "#CC79A7", "#E69F00"
SHOWN = 4  # events of each role that are not folded
WITHIN = 2.0  # standard deviations of the noise band
PANELS = ("U [pu]", "P [pu]", "ΔP [pu]", "Q [pu]", "ΔQ [pu]")
HEIGHTS = (0.7, 1.5, 1.0, 1.5, 1.0)
PIXELS = 580
CAPTION = (
    "ΔP and ΔQ are measured less calculated. Dotted: the dip begins and ends. Drag to zoom, double-click to go back."
)


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
    """One event: U, then P and Q with what the models leave of them."""
    event, t = overlay.event, overlay.event.record.t
    made = Chart("t [s]", PANELS, heights=HEIGHTS, pixels=PIXELS)
    made.line("measured", t, event.record.U, style.MEASURED, width=3)
    if not np.array_equal(overlay.driving, event.record.U):
        made.line("voltage that the load saw", t, overlay.driving, style.VOLTAGE, width=1)
    for c, channel in enumerate("PQ"):
        _channel(made, overlay, c, channel)
    for edge in (event.t_start, event.t_end):
        made.edge(edge)
    return made.limits(None, float(t[0]), float(t[-1]))


def _channel(made: Chart, overlay: Overlay, c: int, channel: str) -> None:
    """One power in its panel, and what is left of it in the one below."""
    t, measured, above = overlay.event.record.t, overlay.measured[c], 1 + 2 * c
    best = overlay.before if overlay.after is None else overlay.after
    for panel, middle in ((above, best[c]), (above + 1, np.zeros(len(t)))):
        _noise_band(made, t, middle, WITHIN * overlay.deviation[c], panel)
        for place in overlay.places:
            if place.channel == channel:
                made.shade(place.start, place.end, FOUND, panel, "more than chance leaves", opacity=0.25)
    made.line("measured", t, measured, style.MEASURED, above, width=3)
    for name, curve, color, dash in (
        ("base model", overlay.before, BASE, "solid"),
        ("nearest candidates", overlay.nearest, NEAREST, "dot"),
        ("extended model", overlay.after, EXTENDED, "solid"),
    ):
        if curve is not None:
            made.line(name, t, curve[c], color, above, dash=dash)
            made.line(name, t, measured - curve[c], color, above + 1, width=1.1, dash=dash)


def _noise_band(made: Chart, t: np.ndarray, middle: np.ndarray, half: np.ndarray, panel: int) -> None:
    """Where noise alone would let a sample lie; every so many samples of a long record."""
    some = slice(None, None, -(-len(t) // MOST))
    name = f"± {WITHIN:g} σ of the noise"
    made.band(name, t[some], (middle - half)[some], (middle + half)[some], style.FAINT, panel)
