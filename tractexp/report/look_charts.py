"""The charts of a look: each load with what happened to it, zoomable, and the
channels of no load.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tractexp.blocks import Report
from tractexp.blocks.chart import Chart
from tractexp.blocks.style import ACTIVE, FAINT, MEASURED, PALETTE, REACTIVE, VOLTAGE
from tractexp.blocks.style import PHASES as COLORS
from tractexp.record.phasor_measurement import BLOCK
from tractexp.recording import Channel, Feeder, Recording, Segment
from tractexp.recording.measure import FeederWaves
from tractexp.recording.overview import View
from tractexp.recording.quality import compute_spectrum
from tractexp.recording.recording import find_unit
from tractexp.recording.sight import Sight
from tractexp.recording.trace import compute_half_cycle_rms
from tractexp.text.wording import count_noun

MOST_PAGE_SAMPLES = 400_000  # samples of waveforms that a page holds: a megabyte
MOST_PHASORS = 200_000  # values of phasors that a page holds
MOST_OTHERS = 50_000  # samples of channels of no load
MOST_ARROWS = 30_000  # values of phasors at the cursor that a chart holds
LINES = 7  # that a load's phasors make
DETAILED = 12  # events that have a chart of their own where the whole is thinned
AROUND = (0.1, 0.3)  # s before and after an event in such a chart
LONGEST_SHOWN_EVENT = 3.0  # s of an event there
SPECTRUM_CYCLES = 10  # of a spectrum
HEIGHTS = (1.3, 1.3, 1, 1, 1, 1.2, 0.7)  # of the panels of a load
TRACE, TRACES = 0.19, 24  # height of a status channel beside these; so many have room
# cycles after which phasors show what an event is: at first the cursor stands there
FIRST_CURSOR_CYCLES = 1.5
PHASES = {3: ("a", "b", "c"), 1: ("u, i",)}
LABEL = 0.12  # of the axis of time: room that an event's label takes on a phone
BOUND = 0.1  # of the nominal frequency: what lies further off is that of a dead line
SHADES = {"dip": PALETTE[5], "swell": PALETTE[4], "interruption": PALETTE[3]}
CAPTION = (
    "Waveforms, primary values; RMS of one cycle every half cycle (IEC 61000-4-30); symmetrical"
    " components and powers of one-cycle phasors, P [MW] and Q [Mvar] positive when consumed. Drag"
    " to zoom, double-click for the whole. Above the chart are the values at the cursor, and the"
    " one-cycle phasors, turned so that the first voltage lies at 0°: voltages thin, currents"
    " thick."
)


def add_charts(page: Report, view: View, shown: Sight) -> None:
    """Add a load's record, or its phasors and waveforms."""
    if shown.record is not None:
        page.chart(_chart_record(shown), "As recorded. Drag to zoom, double-click for the whole.")
    elif shown.phasors and view.recording is not None:
        every, coarse = _choose_thinning(view)
        page.chart(
            _chart_waves(view, shown, every, coarse), CAPTION + _describe_status_channels(view)
        )
        with page.fold_blocks("Spectrum before anything happened"):
            page.chart(
                _chart_spectrum(view.recording, shown),
                f"{SPECTRUM_CYCLES} cycles, Hann window, of phase a.",
            )
        if max(every, coarse) > 1:
            _add_details(page, view, shown)


def add_unassigned_channels(page: Report, view: View) -> None:
    """The channels of no load, a panel for each unit."""
    recording = view.recording
    assert recording is not None
    taken = {i for s in view.sights if s.feeder for i in (*s.feeder.voltages, *s.feeder.currents)}
    panels: dict[str, list[Channel]] = {}
    for number in sorted({*range(len(recording.channels))} - taken):
        channel = recording.channels[number]
        quantity = find_unit(channel.unit)[0]
        unit = {"voltage": "u [kV]", "current": "i [kA]"}.get(quantity, channel.unit or "value")
        panels.setdefault(unit, []).append(channel)
    if panels:
        count = sum(map(len, panels.values()))
        with page.fold_blocks(f"The {count_noun(count, 'channel')} of no load"):
            chart = _draw_unassigned(recording, panels, count)
            page.chart(chart, "Primary values, where the unit is known.")


def _draw_unassigned(
    recording: Recording, panels: Mapping[str, Sequence[Channel]], count: int
) -> Chart:
    """Channels over time, those of a unit in one panel, thinned to what a page holds of `count`."""
    chart = Chart("t [s]", [*panels], pixels=150 + 200 * len(panels))
    every = -(-count * recording.samples // MOST_OTHERS)
    segments = [segment for segment in recording.segments if segment.stop > segment.first + 1]
    for panel, group in enumerate(panels.values()):
        for k, channel in enumerate(group):
            color = PALETTE[k % len(PALETTE)]
            for segment in segments:
                read = functools.partial(_read_values, channel, segment)
                y = _thin_wave(read, segment.stop - segment.first, every)
                step = every / segment.rate
                chart.samples(channel.name, segment.start, step, y, color, panel)
    return chart.cursor(recording.segments[0].start)


def _mark_events(chart: Chart, shown: Sight) -> Chart:
    """Events shaded over all panels, each with its number or kind at the top."""
    spans = [shown.record.t] if shown.record is not None else [p.t for p in shown.phasors]
    room = LABEL * float(spans[-1][-1] - spans[0][0])
    last = -np.inf
    for event in shown.events:
        what = event.what
        text = (
            ""
            if what.start < last + room
            else what.kind
            if event.dip is None
            else f"{what.kind} {event.dip}"
        )
        last = what.start if text else last
        chart.shade(what.start, what.end, SHADES.get(what.kind, "#BBBBBB"), opacity=0.25, text=text)
    return chart


def _chart_record(shown: Sight) -> Chart:
    """A record's columns over time."""
    record = shown.record
    assert record is not None
    panels = {"U": ("U", "U2"), "P, Q": ("P", "Q"), "f [Hz]": ("f",)}
    colors = {"U": VOLTAGE, "U2": PALETTE[3], "P": ACTIVE, "Q": REACTIVE, "f": FAINT}
    sizes = {
        "U": record.base.voltage,
        "U2": record.base.voltage,
        "P": record.base.power,
        "Q": record.base.power,
    }
    panels_of = {
        label: [n for n in names if n in record.channels] for label, names in panels.items()
    }
    units = {
        "U": "[pu]" if record.base.voltage == 1 else "[kV]",
        "P, Q": "[pu]" if record.base.power == 1 else "[MW, Mvar]",
    }
    used = [label for label, names in panels_of.items() if names]
    chart = Chart("t [s]", [f"{label} {units.get(label, '')}".strip() for label in used])
    for panel, label in enumerate(used):
        for name in panels_of[label]:
            values = record.channels[name] * sizes.get(name, 1.0)
            chart.samples(name, float(record.t[0]), record.step, values, colors[name], panel)
    starts = [event.what.start for event in shown.events] or [float(record.t[0])]
    return _mark_events(chart, shown).cursor(starts[0])


def _choose_thinning(view: View) -> tuple[int, int]:
    """How many samples and how many phasors become one on a page, so that all loads of a file have
    room.
    """
    recording = view.recording
    assert recording is not None
    lines = sum(
        len(s.feeder.voltages) + len(s.feeder.currents) for s in view.sights if s.feeder is not None
    )
    phasors = LINES * sum(len(p.t) for s in view.sights for p in s.phasors)
    return max(1, -(-lines * recording.samples // MOST_PAGE_SAMPLES)), max(
        1, -(-phasors // MOST_PHASORS)
    )


def _chart_waves(
    view: View,
    shown: Sight,
    every: int = 1,
    coarse: int = 1,
    span: tuple[float, float] | None = None,
) -> Chart:
    """All panels of a load; so many samples and phasors become one. Within the times `span` [s]
    none do.
    """
    recording, states = view.recording, view.operations[:TRACES]
    assert recording is not None
    assert shown.feeder is not None
    single = len(shown.phasors[0].V) == 1
    sequences = "|U| [kV]" if single else "U seq. [kV]"
    panels = ["u [kV]", "i [kA]", "U RMS [kV]", "I RMS [kA]", sequences, "P, Q [MW]", "f [Hz]"]
    heights = list(HEIGHTS)
    if states:
        panels.append("status")
        heights.append(TRACE * len(states))
    chart = Chart("t [s]", panels, heights=heights, pixels=round(150 + 110 * sum(heights)))
    for segment in recording.waveforms():
        _add_waves(chart, recording, shown, segment, every, span)
    for p in shown.phasors:
        part = slice(*np.searchsorted(p.t, span)) if span else slice(None)
        if len(p.t[part]) > 1:
            _add_phasors(chart, p, part, recording.frequency, 1 if span else coarse)
    chart.limits(6, (1 - BOUND / 2) * recording.frequency, (1 + BOUND / 2) * recording.frequency)
    if states:
        chart.states(states, len(panels) - 1, VOLTAGE)
    first, last = span or (recording.waveforms()[0].start, float(shown.phasors[-1].t[-1]))
    chart.limits(None, first, last)
    for trigger in (each for each in recording.find_triggers() if first <= each <= last):
        chart.edge(trigger, VOLTAGE, "dash", text="trigger")
    happened = (event.what.start for event in shown.events if first <= event.what.start <= last)
    return _mark_events(chart, shown).cursor(
        next(happened, first) + FIRST_CURSOR_CYCLES / recording.frequency
    )


def _describe_status_channels(view: View) -> str:
    """The caption's part on status channels; "" without them."""
    count = len(view.operations)
    most = f", the first {TRACES} of {count}" if count > TRACES else ""
    return f" Status channels that change are below{most}." if count else ""


def _add_waves(
    chart: Chart,
    recording: Recording,
    shown: Sight,
    segment: Segment,
    every: int,
    span: tuple[float, float] | None,
) -> None:
    """Add the waveforms of a segment, every so many samples."""
    assert shown.feeder is not None
    waves = FeederWaves.from_recording(
        recording, shown.feeder, segment if span is None else segment.between(*span)
    )
    rate, start = segment.rate, waves.segment.start
    if waves.shape[1] < 2:
        return
    K = waves.shape[0] // 2
    colors, names = _choose_colors(K), _name_waves(recording, shown.feeder, K)
    for k in range(2 * K):
        y = _thin_wave(functools.partial(_sum_channels, waves, k), waves.shape[1], every)
        chart.samples(
            PHASES[K][k % K],
            start,
            every / rate,
            y,
            colors[k % K],
            panel=k // K,
            width=1.0,
            label=names[k],
        )
    t, rms = compute_half_cycle_rms(waves, rate, recording.frequency)
    if len(t) > 1:
        for k, values in enumerate(rms):
            name, color = PHASES[K][k % K], colors[k % K]
            chart.samples(name, start + t[0], t[1] - t[0], values, color, panel=2 + k // K)


def _choose_colors(phases: int) -> tuple[str, ...]:
    """Colors of so many phases."""
    return COLORS if phases > 1 else (VOLTAGE,)


def _name_waves(recording: Recording, feeder: Feeder, phases: int) -> list[str]:
    """The names of a load's waves at the cursor: by phase, and by channel where they are its
    channels.
    """
    numbers = (*feeder.voltages, *feeder.currents)
    # line voltages, or two current transformers, of which phases are made
    if len(numbers) != 2 * phases:
        return [*PHASES[phases]] * 2
    return [
        f"{PHASES[phases][k % phases]} ({recording.channels[i].name})"
        for k, i in enumerate(numbers)
    ]


def _add_phasors(chart: Chart, p: Any, part: slice, nominal: float, every: int) -> None:
    """Symmetrical components, powers and frequency of one segment."""
    t = p.t[part]
    step = float(t[-1] - t[0]) / (len(t) - 1)
    sparse = max(1, -(-4 * p.V.shape[0] * len(t) // MOST_ARROWS))
    for panel, phases in enumerate((p.V, p.I)):
        for name, color, turning in zip(
            PHASES[len(phases)], _choose_colors(len(phases)), phases, strict=True
        ):
            chart.phasors(name, float(t[0]), step * sparse, turning[part][::sparse], color, panel)
    lines = [("P", p.S.real, ACTIVE, 5), ("Q", p.S.imag, REACTIVE, 5)]
    if len(p.V) == 3:
        zero = np.abs(p.V.mean(axis=0))
        lines += [
            ("positive sequence", np.abs(p.V1), VOLTAGE, 4),
            ("negative sequence", np.abs(p.V2), PALETTE[3], 4),
            ("zero sequence", zero, MEASURED, 4),
        ]
    else:
        lines.append(("phasor of U", np.abs(p.V[0]), VOLTAGE, 4))
    alive = np.abs(p.f / nominal - 1) < BOUND
    lines.append(("f", np.where(alive, p.f, np.nan), FAINT, 6))
    for name, values, color, panel in lines:
        drawn = values[part] if every == 1 else compute_envelope(values[part], every)
        chart.samples(name, float(t[0]), step * every, drawn, color, panel)


def _read_values(channel: Channel, segment: Segment, a: int, b: int) -> np.ndarray:
    """A channel's values within a part of a segment."""
    return channel.values(segment.first + a, segment.first + b)


def _sum_channels(waves: FeederWaves, k: int, a: int, b: int) -> np.ndarray:
    """One sum of a feeder's channels within a part of a segment."""
    return waves[k : k + 1, a:b][0]


def _thin_wave(read: Callable[[int, int], np.ndarray], n: int, every: int) -> np.ndarray:
    """A wave of n samples, or its `envelope`, of what `read(first, stop)` gives a
    block at a time.
    """
    block = max(BLOCK // (2 * every), 1) * 2 * every
    parts = (read(a, min(a + block, n)) for a in range(0, n, block))
    return np.concatenate([part if every == 1 else compute_envelope(part, every) for part in parts])


def compute_envelope(wave: np.ndarray, every: int) -> np.ndarray:
    """The lowest and highest (2 M,) of each 2 `every` samples of a wave (N,), in the order in which
    they came.
    """
    rows = np.full(-(-len(wave) // (2 * every)) * 2 * every, wave[-1])
    rows[: len(wave)] = wave
    parts = rows.reshape(-1, 2 * every)
    held = np.where(np.isnan(parts), 0.0, parts)
    order = np.sort(np.stack([held.argmin(1), held.argmax(1)], axis=1), axis=1)
    return np.take_along_axis(parts, order, axis=1).ravel()


def _chart_spectrum(recording: Recording, shown: Sight) -> Chart:
    """The spectra of the first voltage and the first current, before the first event."""
    assert shown.feeder is not None
    segment = recording.waveforms()[0]
    whole = FeederWaves.from_recording(recording, shown.feeder, segment)
    length = min(round(SPECTRUM_CYCLES * segment.rate / recording.frequency), whole.shape[1])
    first = shown.events[0].what.start - segment.start if shown.events else np.inf
    quiet = int(np.clip(first * segment.rate, length, whole.shape[1]))
    waves = whole[:, quiet - length : quiet]
    K = len(waves) // 2
    chart = Chart("frequency [Hz]", ["of the fundamental [%]"], log_y=True, pixels=320)
    for name, wave, color in (("voltage", waves[0], REACTIVE), ("current", waves[K], ACTIVE)):
        f, rms = compute_spectrum(wave, segment.rate)
        if rms.max() > 0:
            chart.line(name, f, np.maximum(100 * rms / rms.max(), 1e-3), color)
    return chart


def _add_details(page: Report, view: View, shown: Sight) -> None:
    """A chart with every sample for each event, where the chart of the whole has not
    all of them.
    """
    for event in shown.events[:DETAILED]:
        what = event.what
        span = (what.start - AROUND[0], min(what.end, what.start + LONGEST_SHOWN_EVENT) + AROUND[1])
        with page.fold_blocks(f"Every sample of the {what.kind} at {what.start:.3f} s"):
            page.chart(_chart_waves(view, shown, span=span), "As above, not thinned.")
    if len(shown.events) > DETAILED:
        page.text(
            f"The {len(shown.events) - DETAILED} events after the first {DETAILED} have no such"
            " chart."
        )
