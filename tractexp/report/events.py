"""One event as it was recorded and as models calculate it: voltage, P, Q and what is left, to be looked into."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from tractexp.record import Event
from tractexp.report import style
from tractexp.report.chart import Chart

PLACE = "#F2C14E"  # shades what stands out
COLORS = (style.ACTIVE, style.REACTIVE)  # of P and Q
BAND = 2.0  # standard deviations of the noise


class Curve(NamedTuple):
    """Calculated power (N,) each [pu]; without a color that of the channel."""

    label: str
    P: np.ndarray
    Q: np.ndarray
    color: str | None = None
    dash: str = "solid"


def event_chart(
    event: Event,
    curves: Sequence[Curve],
    *,
    noise: tuple[float, float] | None = None,
    places: Sequence[Any] = (),
    title: str = "",
) -> Chart:
    """U, P, Q and the residuals ΔP, ΔQ (calculated less measured) of each curve over time; dotted: the dip's edges.

    `noise` are standard deviations [pu] of P and Q: twice as much about zero is shaded in the residuals. `places` have
    `channel`, `start`, `end` [s]: where more than chance is left.
    """
    record = event.record
    residual = "Δ{} [pu]".format
    labels = ["U [pu]", "P [pu]", "Q [pu]", residual("P"), residual("Q")]
    chart = Chart("t [s]", labels, heights=(1.0, 1.7, 1.7, 1.2, 1.2), pixels=900, title=title)
    chart.line("U measured", record.t, record.U, style.VOLTAGE)
    for c, (name, color) in enumerate(zip("PQ", COLORS, strict=True)):
        measured = getattr(record, name)
        chart.line("measured", record.t, measured, style.MEASURED, 1 + c, width=4.0)
        if noise is not None:
            level = np.full(len(record.t), BAND * noise[c])
            chart.band(f"± {BAND:g} standard deviations of the noise", record.t, -level, level, "#9A9A9A", 3 + c)
        for curve in curves:
            calculated = getattr(curve, name)
            label = curve.label if curve.color else f"{name} {curve.label}"
            look = {"color": curve.color or color, "dash": curve.dash, "width": 1.5}
            chart.line(label, record.t, calculated, panel=1 + c, **look)
            chart.line(label, record.t, calculated - measured, panel=3 + c, **(look | {"width": 1.0}))
        for place in places:
            if place.channel == name:
                for panel in (1 + c, 3 + c):
                    chart.shade(place.start, place.end, PLACE, panel, "more than chance leaves")
    return chart.edge(event.t_start).edge(event.t_end)
