"""Measured, before, after: the charts in which one sees whether a model describes an event."""

import itertools
from collections.abc import Sequence

import numpy as np

from tractexp.blocks import Report
from tractexp.blocks.chart import Chart
from tractexp.discrepancy.overlay import Overlay
from tractexp.domain.playback import measure_as_phasors
from tractexp.record import WaveEvent, describe
from tractexp.report.events import CAPTION, CalculatedCurve, draw_event
from tractexp.report.explained import Answer
from tractexp.report.waves import CAPTION as WAVE_CAPTION
from tractexp.report.waves import Drawn, draw_waves

BASE, EXTENDED, NEAREST = "#D55E00", "#0072B2", "#CC79A7"
IN_PHASORS = (
    "The record's estimator run over the recorded and over the calculated currents, so that its"
    " window cancels; a dip of few cycles is smeared alike in both."
)
CLICK = "Click a curve: below it is said which candidates would explain what is left there."
MOST_OPEN_OVERLAYS = 4  # events of each role that are not folded


def add_overlays(
    page: Report, overlays: Sequence[Overlay], answers: Sequence[Sequence[Answer]] = ()
) -> Report:
    """A chart of each event, the fitted ones first; those beyond the first few are folded. Clicked,
    a fitted one gives its `answers`.
    """
    page.text(WAVE_CAPTION if any(isinstance(o.event, WaveEvent) for o in overlays) else CAPTION)
    if any(answers):
        page.text(CLICK)
    for role, held_out in (("fitted", False), ("held out", True)):
        group = [o for o in overlays if o.held_out == held_out]
        told = () if held_out else answers
        for overlay, own in itertools.zip_longest(group[:MOST_OPEN_OVERLAYS], told[: len(group)]):
            if overlay is not None:
                _add_overlay(page, overlay, role, own or ())
        if more := group[MOST_OPEN_OVERLAYS:]:
            with page.fold_blocks(f"{len(more)} more events, {role}"):
                for overlay in more:
                    _add_overlay(page, overlay, role)
    return page


def _add_overlay(page: Report, overlay: Overlay, role: str, answers: Sequence[Answer] = ()) -> None:
    """Add an event, measured and calculated before and after."""
    event = overlay.event
    page.heading(f"{event.record.name}, {role}", level=3)
    if not isinstance(event, WaveEvent):
        page.chart(draw_overlay(overlay).answers(answers), f"{describe(event)}.")
        return
    page.chart(draw_currents(event, overlay).answers(answers), f"{describe(event.phasors)}.")
    with page.fold_blocks("The same in phasors: P and Q"):
        page.chart(chart_phasors(event, overlay), IN_PHASORS)


def draw_overlay(overlay: Overlay) -> Chart:
    """One event with the curves of the models; the noise band is that of the best of them."""
    curves = [CalculatedCurve(*model) for model in _list_models(overlay)]
    return draw_event(
        overlay.event,
        curves,
        deviation=overlay.deviation,
        around=_compute_best_curves(overlay),
        places=overlay.places,
        driving=overlay.driving,
    )


def draw_currents(event: WaveEvent, overlay: Overlay) -> Chart:
    """The currents of the phases, in which the noise band is that of the best of the models."""
    curves = [Drawn(*model) for model in _list_models(overlay)]
    return draw_waves(
        event,
        curves,
        deviation=overlay.deviation,
        around=_compute_best_curves(overlay),
        places=overlay.places,
    )


def chart_phasors(event: WaveEvent, overlay: Overlay) -> Chart:
    """The chart of phasors by the record's estimator, of calculated and recorded currents."""
    curves = [
        (name, measure_as_phasors(event, calculated), color, dash)
        for name, calculated, color, dash in _list_models(overlay)
    ]
    return draw_event(
        curves[0][1][0],
        [
            CalculatedCurve(name, np.stack(power), color, dash)
            for name, (_, *power), color, dash in curves
        ],
    )


def _list_models(overlay: Overlay) -> list[tuple[str, np.ndarray, str, str]]:
    """The models to draw, as (name, curves, color, dash)."""
    models = (
        ("base model", overlay.before, BASE, "solid"),
        ("nearest candidates", overlay.nearest, NEAREST, "dot"),
        ("extended model", overlay.after, EXTENDED, "solid"),
    )
    return [
        (name, calculated, color, dash)
        for name, calculated, color, dash in models
        if calculated is not None
    ]


def _compute_best_curves(overlay: Overlay) -> np.ndarray:
    """The curves of the best model."""
    return overlay.before if overlay.after is None else overlay.after
