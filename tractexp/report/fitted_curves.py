"""The curves of an identification's page: each event as measured and calculated, other models
beside it, and the dip that was not recorded.
"""

import itertools
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.blocks import Report, style
from tractexp.blocks.chart import Chart
from tractexp.errors import UserError
from tractexp.identification.fit import play
from tractexp.identification.forecast import draw_dip
from tractexp.identification.network_comparison import play_network
from tractexp.identification.uncertainty import Uncertainty
from tractexp.report.events import CAPTION, CalculatedCurve, draw_event, show_units
from tractexp.report.waves import CAPTION as WAVE_CAPTION
from tractexp.report.waves import IN_WAVES, Drawn, describe_preparation, draw_spectra, draw_waves
from tractexp.text.wording import finish_sentence, format_epsilon, join_words

if TYPE_CHECKING:
    from tractexp.api.identification import Identification

ROLES = {"train": "fitted", "validate": "held out"}
MOST_OPEN_EVENTS = 4  # events whose curves are not folded away
MOST_RIVALS = 4  # structures whose curves a page holds
NEXT_DIP = (
    "A dip that was not recorded, as long as those that were. The bands hold the worst sample of 95"
    " % of such events: noise, what the model misses of the known events, and the parameters'"
    " scatter."
)
WITHIN = "the load is here in 95 % of events"


def add_curves(
    page: Report, fits: Sequence[Any], uncertainty: Uncertainty, validate: Sequence[Any]
) -> None:
    """Add measured and calculated curves with the band of the noise, and those of other models."""
    problem = uncertainty.likelihood.problem
    waves, deviation = problem.model.waves, uncertainty.of_noise.noise.deviation(problem.drive)
    beside = _play_beside(fits, uncertainty, validate)
    page.text(*[IN_WAVES] * waves).text(CAPTION)
    if names := join_words([name for name, _ in beside]):
        page.text(f"Drawn when its name in the legend is clicked: {names}.")
    noises = [deviation[:, problem.drive.part(e)] for e in range(problem.drive.events)]
    chart_all_events(page, fits, noises, beside)
    if waves:
        page.heading("What was done to the records", level=3).items(
            describe_preparation(problem, fits)
        )


def _play_beside(
    fits: Sequence[Any], uncertainty: Uncertainty, validate: Sequence[Any]
) -> list[tuple[str, list[Any]]]:
    """Rival structures and the best linear network by name, with what each calculates of all
    events; without those that cannot be simulated on one.
    """
    names = {fit.event.record.name for fit in fits}
    played = [event for event in validate if event.record.name in names]
    beside = []
    for rival in uncertainty.rivals[:MOST_RIVALS]:
        with suppress(UserError):
            beside.append((f"with {rival.name}", play(rival.problem, rival.free, played)))
    with suppress(UserError):
        beside.append(("best linear network", play_network(fits)[1]))
    return beside


def chart_all_events(
    page: Report,
    fits: Sequence[Any],
    noises: Sequence[np.ndarray] = (),
    beside: Sequence[tuple[str, Sequence[Any]]] = (),
) -> None:
    """The charts of each event, with the noise of those fitted, the first; of many the later ones
    are folded away. `beside` are the same events of other models, by their names.
    """
    for fit, noise, k in itertools.zip_longest(fits, noises, range(len(fits))):
        with (
            page.fold_blocks(f"{fit.event.record.name}, {ROLES[fit.role]}")
            if k >= MOST_OPEN_EVENTS
            else nullcontext()
        ):
            others = [(name, of_all[k]) for name, of_all in beside]
            add_event_curves(page, fit, noise, others if k < MOST_OPEN_EVENTS else ())


def add_event_curves(
    page: Report, fit: Any, noise: np.ndarray | None, beside: Sequence[tuple[str, Any]] = ()
) -> None:
    """The currents of an event in waveforms and their spectra, then P and Q; `noise` (2, N) is that
    of phasors, `beside` the event of other models.
    """
    record, power = fit.event.record, np.stack((fit.P, fit.Q))
    about = f"{record.name}, {ROLES[fit.role]}"
    notes = [finish_sentence(note) for note in record.notes]
    if fit.waves is not None:
        page.chart(
            draw_waves(fit.waves, [Drawn("estimate", fit.currents, style.PALETTE[0])]),
            " ".join(
                [f"{about}: epsilon_i {format_epsilon(fit.epsilon_i)}.", WAVE_CAPTION, *notes]
            ),
        )
        page.chart(*draw_spectra(fit.waves, fit.currents))
        noise, notes = (
            None,
            ["Measured and calculated are phasors of the currents above, by the same estimator."],
        )
    chart = draw_event(
        fit.event,
        [CalculatedCurve("estimate", power, style.PALETTE[0]), *_draw_beside(beside)],
        deviation=noise,
        around=power,
    )
    errors = f"epsilon_p {format_epsilon(fit.epsilon_p)}, epsilon_q {format_epsilon(fit.epsilon_q)}"
    page.chart(chart, " ".join([f"{about}: {errors}.", *notes]))


def _draw_beside(beside: Sequence[tuple[str, Any]]) -> list[CalculatedCurve]:
    """The curves that other models calculate of an event, drawn where they are asked for."""
    colors = itertools.cycle(style.PALETTE[2:])
    return [
        CalculatedCurve(name, np.stack((one.P, one.Q)), color, "dash", hidden=True)
        for (name, one), color in zip(beside, colors, strict=False)
    ]


def add_next_dip(page: Report, fit: "Identification") -> None:
    """P and Q of the dip that is told of, with their bands; its sentence where there are none."""
    told = fit.result.next_dip
    if not told:
        return
    page.heading("The next dip").text(finish_sentence(told["sentence"]))
    if told["P"] is None:
        return
    first = fit.details.fits[0].event
    t, U, start = draw_dip(first.U0, told["duration"], first.record.step)
    response = fit.predict(t=t, U=U)
    assert response.band is not None
    panels = ["U [pu]", "P [pu]", "Q [pu]"]
    chart = Chart("t [s]", panels, heights=(0.9, 1.5, 1.5), pixels=460)
    file = first.record.file_base  # what a prediction is per unit of
    show_units(chart, panels, file if file.in_mva else None)
    chart.line("voltage", t, U, style.VOLTAGE)
    for panel, (power, half) in enumerate(
        zip((response.P, response.Q), response.band, strict=True)
    ):
        chart.band(WITHIN, t, power - half, power + half, style.FAINT, panel + 1)
        chart.line("calculated", t, power, style.PALETTE[0], panel + 1)
    page.chart(chart.edge(t[start]), NEXT_DIP)
