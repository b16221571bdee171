"""A result at a glance, as a notebook shows it: the answer, and one figure beside it."""

import tempfile
from pathlib import Path

import numpy as np

from tractexp.blocks import Report, style
from tractexp.blocks.drawing import draw_chart
from tractexp.identification.fit import Fit
from tractexp.report.events import CalculatedCurve, draw_event
from tractexp.storage import files

BESIDE = "display:flex;flex-wrap:wrap;gap:1.5rem;align-items:flex-start"
HALF = "flex:1 1 26rem;min-width:0;max-width:44rem"


def show_beside(answer: Report, fit: Fit | None) -> str:
    """The answer with measured and calculated power of an event beside it; alone without one."""
    if fit is None:
        return answer.fragment
    power = np.stack((fit.P, fit.Q))
    chart = draw_event(fit.event, [CalculatedCurve("calculated", power, style.PALETTE[0])])
    with tempfile.TemporaryDirectory() as folder:
        drawing = files.read_text(draw_chart(chart, Path(folder) / "event.svg"))
    figure = drawing[drawing.index("<svg") :].replace("<svg", '<svg style="max-width:100%"', 1)
    halves = (answer.fragment, figure)
    parts = "".join(f'<div style="{HALF}">{half}</div>' for half in halves)
    return f'<div style="{BESIDE}">{parts}</div>'
