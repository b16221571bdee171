"""What may be wrong with waveforms and is neither noise nor the model's error, and how a load
passes it on.

Within a cycle nothing tells noise of the voltage from the voltage, so that a model is driven by
what was recorded. What single samples of it, its offsets and its course between samples may be off
then shows in the calculated currents.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tractexp.model.drive import Drive
from tractexp.noise.color import SMALLEST_DEVIATION
from tractexp.record import Event, WaveEvent

if TYPE_CHECKING:
    from tractexp.inference.problem import Problem

LARGEST_SAMPLE_DIFFERENCE = 10.0  # pu: a wrong sample of the voltage makes no such difference
OFFSET = 0.005  # pu: what may be left of a channel's offset, which the mean before the dip took off
MOST_BETWEEN = 12  # intervals between samples whose voltage is doubted
# standard deviations of its noise, from which a sample off its neighbors' cubic is no noise
ROUGH = 5.0
SMOOTHER = 8.0  # times the error of a cubic through every second sample over that through all
LEFT = 2.0  # times what white noise leaves of an offset that the mean before the dip took off
STRUCK = 8  # samples of the lead after which a single wrong sample of the voltage is put there


def compute_impulse_responses(
    problem: "Problem", values: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The change of the currents by one standard deviation of one sample of the voltage, at free
    values (d,), of waveforms.

    (L,) complex of the space vector and (L,) of the zero sequence, in the stationary frame, from
    shortly before that sample to the dip: what is smooth between samples is changed a little
    earlier. Of the first event.
    """
    event = problem.events[0]
    assert isinstance(event, WaveEvent)
    noise = max(event.noise_U, SMALLEST_DEVIATION)
    # the zero's is a third
    shocks = [(noise, 0.0), (1j * noise, 0.0), (0.0, noise / np.sqrt(2))][: event.phases]
    off = _compute_differences(
        problem, values, 0, [_strike_sample(event, *shock) for shock in shocks]
    )[:, :, : event.start]
    if event.phases == 1:
        return off[0, 0], np.zeros(1)
    return (off[0, 0] + 1j * off[0, 1] - 1j * (off[1, 0] + 1j * off[1, 1])) / 2, off[2, 2]


def compute_input_errors(problem: "Problem", values: np.ndarray) -> np.ndarray:
    """The modes (k, 3, N) [pu] in which errors of waveforms that are no noise show in the currents,
    at free values (d,).

    The offsets that the channels may have, and those of the voltage as the model passes them on.
    """
    shapes = [
        build_offsets(problem.drive),
        *(_measure_voltage_effects(problem, values, e) for e in range(problem.drive.events)),
    ]
    return np.concatenate(shapes)


def _measure_voltage_effects(problem: "Problem", values: np.ndarray, event: int) -> np.ndarray:
    """The change of one event's currents (k, 3, N) [pu] by offsets of the voltage and by what it
    may be between samples at its edges.
    """
    drive, part = problem.drive, problem.drive.part(event)
    plain = problem.events[event]
    assert isinstance(plain, WaveEvent)
    off = _compute_differences(
        problem, values, event, [*_shift_voltage_offsets(plain), *_vary_between_samples(plain)]
    )
    shapes = np.zeros((len(off), *drive.measurements.shape))
    shapes[:, :, part] = off * (drive.weights[:, part] > 0)
    return shapes


def _compute_differences(
    problem: "Problem", values: np.ndarray, event: int, variants: Sequence[Event]
) -> np.ndarray:
    """The change of an event's currents (n, 3, N) [pu] by variants of its voltage; 0 where one
    diverged.
    """
    drive = Drive.from_events(
        [problem.domain.excitation(e) for e in (problem.events[event], *variants)]
    )
    own = np.tile(problem.by_event(values)[[event]], (drive.events, 1, 1))
    response = problem.model.simulate(
        drive, own, np.tile(problem.step.substeps[[event]], drive.events)
    )
    outputs = response.outputs[:, 0].reshape(drive.channels, drive.events, -1).swapaxes(0, 1)
    off = outputs[1:] - outputs[0]
    return np.where(np.abs(off) < LARGEST_SAMPLE_DIFFERENCE, off, 0.0)


def _shift_voltage_offsets(event: WaveEvent) -> list[WaveEvent]:
    """The event with the offset that noise may have left in each component of its voltage, from the
    record on.
    """
    size = LEFT * event.noise_U / np.sqrt(max(event.start - event.lead, 1))
    there = np.arange(len(event.v)) >= event.lead
    return [
        replace(event, v=event.v + there * size * way * event.turn.conj())
        for way in (1.0, 1j)[: event.phases]
    ]


def _vary_between_samples(event: WaveEvent) -> list[WaveEvent]:
    """The event with what its voltage may be besides between two samples, where it is least smooth.

    How far each sample lies off a cubic through its neighbors tells how far the cubic may be off
    between samples.
    """
    off = np.abs(measure_offset_from_neighbors(event.v * event.turn))
    off[: event.lead + 3] = 0.0
    seen = np.argsort(-off)[:MOST_BETWEEN]
    seen = np.sort(seen[off[seen] > max(ROUGH * event.noise_U, SMALLEST_DEVIATION)])
    variants = []
    for k in seen.tolist():
        bump = np.zeros(len(event.v), dtype=complex)
        bump[k] = off[k] / SMOOTHER * event.turn[k].conj()
        variants += [replace(event, v=event.v + way * bump) for way in (1.0, 1j)[: event.phases]]
    return variants


def measure_offset_from_neighbors(v: np.ndarray) -> np.ndarray:
    """How far each sample of v (N,) lies off the cubic through two on either side; 0
    at the ends.
    """
    off = np.zeros_like(v)
    off[3:-3] = v[3:-3] - (9 * (v[2:-4] + v[4:-2]) - (v[:-6] + v[6:])) / 16
    return off


def build_offsets(drive: Drive) -> np.ndarray:
    """A constant in each compared current of each event, of one standard deviation,
    (k, 3, N) [pu].
    """
    shapes = []
    for e in range(drive.events):
        for c in range(drive.channels):
            if drive.weights[c, drive.part(e)].any():
                shapes.append(np.zeros(drive.measurements.shape))
                shapes[-1][c, drive.part(e)] = OFFSET
    return np.array(shapes)


def _strike_sample(event: WaveEvent, vector: complex, zero: float) -> WaveEvent:
    """The event with one sample of the lead's voltage off, in the stationary frame, and what of it
    is not smoothed.
    """
    struck = np.zeros(len(event.v), dtype=complex)
    struck[STRUCK : STRUCK + len(event.weights)] = event.weights
    v = vector * struck
    if event.phases == 1:  # whose imaginary part is what the sample was a quarter of a cycle ago
        v = v + 1j * np.roll(v, round(event.rate / event.f0 / 4))
    return replace(
        event, v=event.v + v * event.turn.conj(), v_zero=event.v_zero + zero * np.real(struck)
    )
