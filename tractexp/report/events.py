"""One event as it was recorded and as models calculate it: voltage, P, Q and what is left, to be
looked into.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from tractexp.blocks import style
from tractexp.blocks.chart import Chart
from tractexp.record import Base, Event, Record

EXCESS = "#E69F00"  # shades what stands out
BAND_DEVIATIONS = 2.0  # standard deviations of the noise band
PANELS = ("U [pu]", "P [pu]", "ΔP [pu]", "Q [pu]", "ΔQ [pu]")
HEIGHTS = (0.9, 1.5, 1.0, 1.5, 1.0)
PIXELS = 580
# samples of a curve that is drawn on demand only, and of the noise's band
MOST_HIDDEN_POINTS, MOST_BAND_POINTS = 600, 1000
CAPTION = (
    "ΔP and ΔQ are measured less calculated. Dotted: the dip begins and ends. Drag to zoom,"
    " double-click to go back."
)


class CalculatedCurve(NamedTuple):
    """Calculated power (2, N) [pu]: P, Q."""

    name: str
    power: np.ndarray
    color: str
    dash: str = "solid"
    hidden: bool = False  # until its name is clicked


def _shade_places(chart: Chart, places: Sequence[Any], above: int) -> None:
    """Shade where more than chance is left, in a panel and the one below it."""
    said = "more than chance leaves"
    for place in places:
        for panel in (above, above + 1):
            chart.shade(place.start, place.end, EXCESS, panel, said, opacity=0.25)


def draw_event(
    event: Event,
    curves: Sequence[CalculatedCurve],
    *,
    deviation: np.ndarray | None = None,
    around: np.ndarray | None = None,
    places: Sequence[Any] = (),
    driving: np.ndarray | None = None,
) -> Chart:
    """U, then P and Q with what the models leave of them.

    `deviation` (2, N) of the noise [pu] draws a band around the power `around` (2, N) and about
    zero. `places` have `channel`, `start`, `end` [s]: where more than chance is left. `driving`
    (N,) is the voltage that the load saw, where that is not the recorded one.
    """
    record, t = event.record, event.record.t
    chart = Chart("t [s]", PANELS, heights=HEIGHTS, pixels=PIXELS)
    chart.line("measured", t, record.U, style.MEASURED, width=3)
    if driving is not None and not np.array_equal(driving, record.U):
        chart.line("voltage that the load saw", t, driving, style.VOLTAGE, width=1)
    for c, channel in enumerate("PQ"):
        above, measured = 1 + 2 * c, getattr(record, channel)
        if deviation is not None and around is not None:
            for panel, middle in ((above, around[c]), (above + 1, np.zeros(len(t)))):
                _add_noise_band(chart, t, middle, BAND_DEVIATIONS * deviation[c], panel)
        _shade_places(chart, [place for place in places if place.channel == channel], above)
        chart.line("measured", t, measured, style.MEASURED, above, width=3)
        for name, power, color, dash, hidden in curves:
            some = slice(None, None, -(-len(t) // MOST_HIDDEN_POINTS) if hidden else 1)
            look: dict[str, Any] = {"dash": dash, "hidden": hidden}
            left = measured - power[c]
            chart.line(name, t[some], power[c][some], color, above, **look)
            chart.line(name, t[some], left[some], color, above + 1, width=1.1, **look)
    show_units(chart, PANELS, find_base(record))
    return chart.edge(event.t_start).edge(event.t_end).limits(None, float(t[0]), float(t[-1]))


def find_base(record: Record) -> Base | None:
    """The base of a record, None where nobody said what one per unit is."""
    return record.base if record.file_base.in_mva else None


def show_units(chart: Chart, panels: Sequence[str], base: Base | None) -> Chart:
    """Panels labeled in pu are shown in kV, MW and Mvar; as they are where no base is known."""
    if base is None:
        return chart
    kilovolt = ("kV", base.voltage) if base.voltage != 1.0 else ("pu", 1.0)
    by_quantity = {"U": kilovolt, "P": ("MW", base.power), "Q": ("Mvar", base.power)}
    units = [by_quantity[panel.lstrip("Δ")[0]] for panel in panels]
    labels = [panel.replace("pu", unit) for panel, (unit, _) in zip(panels, units, strict=True)]
    return chart.units(labels, [factor for _, factor in units])


def _add_noise_band(
    chart: Chart, t: np.ndarray, middle: np.ndarray, half: np.ndarray, panel: int
) -> None:
    """Where noise alone would let a sample lie; every so many samples of a long record."""
    some = slice(None, None, -(-len(t) // MOST_BAND_POINTS))
    name = f"± {BAND_DEVIATIONS:g} σ of the noise"
    chart.band(name, t[some], (middle - half)[some], (middle + half)[some], style.FAINT, panel)
