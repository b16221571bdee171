"""One event in waveforms: voltages, currents as recorded and as calculated, and the spectrum of
what is left.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from tractexp.blocks import style
from tractexp.blocks.chart import Chart
from tractexp.domain.playback import AFTER
from tractexp.identification.fit import Fit
from tractexp.inference.problem import Problem
from tractexp.record import WaveEvent
from tractexp.report.events import BAND_DEVIATIONS, EXCESS, find_base

PHASES = ("a", "b", "c")
SHOWN_CYCLES = 2.0  # shown at first before and after the dip
HARMONICS = (1, 3, 5, 7, 9, 11, 13, 17, 19, 23, 25)
HIGHEST_SHOWN_FREQUENCY = 1300.0  # Hz: what a spectrum shows
KILO = 1.0  # kA of a peak from which an axis is in kA
MOST_PREPARED_EVENTS = 4  # events of which it is told how they were prepared
SPECTRUM = (
    "Amplitudes of measured less calculated currents, in percent of the fundamental before the dip,"
    " over whole cycles of the stationary phases: what is 50 Hz there is 50 Hz here. Above from the"
    " dip on ({after:.0f} ms), below before it ({before:.0f} ms); a longer stretch tells"
    " frequencies better apart. Marked are the fundamental and its odd harmonics. A load of"
    " harmonics stands in both, a wrong decay beside the fundamental, an offset at 0 Hz."
)
IN_WAVES = (
    "In waveforms the sampled currents are compared, driven by the sampled voltage, both as space"
    " vectors of the stationary frame (alpha along phase a); nothing is averaged over a cycle. One"
    " per unit is the peak of the phase voltage before the dip, and of the current of the same"
    " apparent power. P, Q, epsilon_p and epsilon_q are of the recorded and of the calculated"
    " currents through the record's own phasor estimator, so they compare with those of a run in"
    " phasors."
)
CAPTION = (
    "The currents are instantaneous values, phase by phase, offsets of the recorder taken off."
    " Dotted: the dip begins and ends. Drag to zoom, double-click to go back; zoomed in, every"
    " sample is drawn."
)


class Drawn(NamedTuple):
    """Calculated currents (3, N) [pu]: alpha, beta and zero."""

    name: str
    currents: np.ndarray
    color: str
    dash: str = "solid"


def draw_waves(
    event: WaveEvent,
    curves: Sequence[Drawn],
    *,
    deviation: np.ndarray | None = None,
    around: np.ndarray | None = None,
    places: Sequence[Any] = (),
) -> Chart:
    """Voltages, then each phase's current as recorded and as calculated, and what the curves leave
    of it.

    The dip is in view at first. `deviation` (3, N) of the noise [pu] draws a band around the
    currents `around` (3, N) and about zero; `places` have `start` and `end` [s]: where more than
    chance is left of some current.
    """
    part = slice(event.lead, None)
    names = PHASES[: event.phases] if event.phases > 1 else ("",)
    measured = event.of_phases(np.nan_to_num(event.currents))[:, part]
    start, step = float(event.record.t[event.lead]), event.record.step
    panels = ["u [pu]", *(f"i{f'_{n}' if n else ''} [pu]" for n in names), "Δi [pu]"]
    chart = Chart(
        "t [s]", panels, heights=[1.0, *[1.3] * len(names), 1.0], pixels=170 + 130 * len(panels)
    )
    colors = style.PHASES if event.phases > 1 else (style.VOLTAGE,)
    for name, u, color in zip(
        names, event.of_phases(_stack_voltage(event))[:, part], colors, strict=False
    ):
        chart.samples(f"phase {name}" if name else "voltage", start, step, u, color)
    if deviation is not None and around is not None:
        _add_noise_bands(chart, event, deviation, around)
    for first, last in _merge_intervals(places):
        chart.shade(first, last, EXCESS, 1 + event.phases, "more than chance leaves", opacity=0.2)
    for k in range(event.phases):
        chart.samples("measured", start, step, measured[k], style.MEASURED, 1 + k, width=3)
    for name, currents, color, dash in curves:
        calculated = event.of_phases(currents)[:, part]
        for k, phase in enumerate(names):
            chart.samples(name, start, step, calculated[k], color, 1 + k, width=1.3, dash=dash)
            rest = measured[k] - calculated[k]
            own = colors[k] if len(curves) == 1 and phase else color
            chart.samples(
                f"phase {phase}" if own != color else name,
                start,
                step,
                rest,
                own,
                len(names) + 1,
                dash=dash,
            )
    if find_base(event.record) is not None:
        _show_units(chart, panels, event.peaks, float(np.abs(measured).max()))
    return chart.edge(event.t_start).edge(event.t_end).limits(None, *_view(event))


def _show_units(
    chart: Chart, panels: Sequence[str], peaks: tuple[float, float], largest: float
) -> None:
    """Voltages are shown in kV, currents in A or kA; `peaks` are what one per unit is [kV, kA],
    `largest` is that of the currents [pu].
    """
    kV, kA = peaks
    current = ("kA", kA) if kA * largest >= KILO else ("A", 1000 * kA)
    units = [("kV", kV), *[current] * (len(panels) - 1)]
    labels = [panel.replace("pu", unit) for panel, (unit, _) in zip(panels, units, strict=True)]
    chart.units(labels, [factor for _, factor in units])


def _add_noise_bands(
    chart: Chart, event: WaveEvent, deviation: np.ndarray, around: np.ndarray
) -> None:
    """Where noise alone would let a sample lie: about each phase's current and, the widest of them,
    about zero.
    """
    t = event.record.t[event.lead :]
    compared = np.array(event.compared_channels)[:, None]
    half = (
        BAND_DEVIATIONS
        * np.sqrt(event.of_phases(np.eye(3)) ** 2 @ (deviation * compared) ** 2)[:, event.lead :]
    )
    middle, name = event.of_phases(around)[:, event.lead :], f"± {BAND_DEVIATIONS:g} σ of the noise"
    for k in range(event.phases):
        chart.band(name, t, middle[k] - half[k], middle[k] + half[k], style.FAINT, 1 + k)
    chart.band(name, t, -half.max(axis=0), half.max(axis=0), style.FAINT, 1 + event.phases)


def _merge_intervals(places: Sequence[Any]) -> list[tuple[float, float]]:
    """The stretches [s] that places of any channel cover, none of them twice."""
    covered: list[tuple[float, float]] = []
    for place in sorted(places, key=lambda p: p.start):
        if covered and place.start <= covered[-1][1]:
            covered[-1] = covered[-1][0], max(covered[-1][1], place.end)
        else:
            covered.append((place.start, place.end))
    return covered


def _stack_voltage(event: WaveEvent) -> np.ndarray:
    """The recorded voltage (3, N) in the stationary frame: alpha, beta and zero [pu]."""
    v = event.v * event.turn
    return np.stack([v.real, v.imag, event.v_zero])


def _view(event: WaveEvent) -> tuple[float, float]:
    """From two cycles before the dip to two after it, or to where epsilon_i ends counting [s]."""
    t, cycles = event.record.t, SHOWN_CYCLES / event.f0
    to = max(event.t_end + cycles, event.t_start + AFTER)
    return max(float(t[event.lead]), event.t_start - cycles), min(float(t[-1]), to)


class Spectrum(NamedTuple):
    """Amplitudes (K, n) of the phases' residual at frequencies (n,) [Hz], over the fundamental
    before the dip.
    """

    frequencies: np.ndarray
    amplitudes: np.ndarray
    seconds: float


def compute_spectra(event: WaveEvent, currents: np.ndarray) -> tuple[Spectrum, Spectrum]:
    """The spectra of what calculated currents (3, N) leave, from the dip on and before it; over
    whole cycles, unweighted.

    Unweighted, the squares of all of it add up to the residual's energy, a decay at its beginning
    included.
    """
    compared = np.array(event.compared_channels)[:, None]
    residual = event.of_phases((np.nan_to_num(event.currents) - currents) * compared)
    cycle = event.rate / event.f0
    after = min(AFTER * event.rate, residual.shape[1] - event.start)
    size = abs(event.P0 + 1j * event.Q0) / event.U0  # of the fundamental's peak [pu]
    parts = []
    for samples, last in ((after, None), (event.start - event.lead, event.start)):
        n = round(max(1, int(samples / cycle + 0.25)) * cycle)
        first = event.start if last is None else max(event.start - n, event.lead)
        part = residual[:, first : min(first + n, residual.shape[1])]
        amplitudes = np.abs(np.fft.rfft(part)) / part.shape[1] * 2 / size
        amplitudes[:, 0] /= 2
        parts.append(
            Spectrum(
                np.fft.rfftfreq(part.shape[1], event.record.step),
                amplitudes,
                part.shape[1] / event.rate,
            )
        )
    return parts[0], parts[1]


def draw_spectra(event: WaveEvent, currents: np.ndarray) -> tuple[Chart, str]:
    """The spectra above each other, and the caption."""
    after, before = compute_spectra(event, currents)
    chart = Chart("frequency [Hz]", ["after [%]", "before [%]"], pixels=380)
    names = [f"phase {n}" for n in PHASES[: event.phases]] if event.phases > 1 else ["residual"]
    highest = min(HIGHEST_SHOWN_FREQUENCY, event.rate / 2)
    for panel, (frequencies, amplitudes, _) in enumerate((after, before)):
        shown = frequencies <= highest
        for name, row, color in zip(names, amplitudes, style.PHASES, strict=False):
            chart.line(name, frequencies[shown], 100 * row[shown], color, panel)
        chart.limits(panel, 0.0, 1.08 * 100 * max(float(amplitudes[:, shown].max()), 1e-4))
    for order in HARMONICS:
        if order * event.f0 < highest:
            chart.edge(order * event.f0)
    marks = [
        order * round(event.f0, 1)
        for order in HARMONICS
        if order * event.f0 < highest and order != 9
    ]
    notes = SPECTRUM.format(after=1000 * after.seconds, before=1000 * before.seconds)
    return chart.ticks(None, marks).limits(None, 0.0, highest), notes


def describe_preparation(problem: Problem, fits: Sequence[Fit]) -> list[str]:
    """Sentences on how each record was prepared for the fit, and how it is simulated."""
    steps = f"Runge-Kutta steps of the fit: {problem.step.describe(problem.events)}."
    return [
        *(
            _describe_event_preparation(fit)
            for fit in fits[:MOST_PREPARED_EVENTS]
            if fit.waves is not None
        ),
        steps,
    ]


def _describe_event_preparation(fit: Fit) -> str:
    """Frequency, cycles before the dip, offsets taken off and the periodic steady state of one
    event.
    """
    event: Any = fit.waves
    cycles = (event.start - event.lead) * event.f0 / event.rate
    volts, amperes = (
        np.abs(event.offsets[: event.phases]).max(),
        np.abs(event.offsets[event.phases :]).max(),
    )
    zero = (
        ""
        if event.phases == 1
        else " Zero sequence is " + ("" if event.compared_channels[2] else "not ") + "compared."
    )
    return (
        f"{event.record.name}: {event.f0:.3f} Hz, {cycles:.1f} cycles before the dip; offsets of up"
        f" to {1000 * volts:.3g} V and {1000 * amperes:.3g} A taken off.{zero} The periodic voltage"
        f" before the dip is continued back for {event.lead * event.f0 / event.rate:.0f} cycles, in"
        " which the simulation reaches its steady state: over the last of them the calculated"
        f" currents still change by {fit.unsettled:.2g} of their size."
    )
