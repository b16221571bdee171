"""What errors of a recorder of waveforms do to currents: offsets of its channels, and noise of the recorded voltage."""

from dataclasses import replace

import numpy as np

from tractexp.identification.problem import Problem, excited
from tractexp.model.drive import Drive
from tractexp.noise.color import SMALLEST
from tractexp.record import WaveEvent

OFFSET = 0.005  # pu: what may be left of a channel's offset, which the mean before the dip took off
STRUCK = 8  # sample of the lead in which the voltage is wrong


def offsets(drive: Drive) -> np.ndarray:
    """A constant in each compared current of each event, of one standard deviation, (k, 3, N) [pu]."""
    shapes = []
    for e in range(drive.events):
        for c in range(drive.channels):
            if drive.weights[c, drive.part(e)].any():
                shapes.append(np.zeros(drive.measured.shape))
                shapes[-1][c, drive.part(e)] = OFFSET
    return np.array(shapes)


def answers(problem: Problem, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The currents that one standard deviation of a voltage's sample causes, at free values (d,), of the first event.

    (L,) complex of the space vector and (L,) of the zero sequence [pu], in the stationary frame, from shortly before
    that sample, since it bends the curve before it, to the dip.
    """
    event = problem.events[0]
    noise = max(event.noise_U, SMALLEST)
    shocks = [(noise, 0.0), (1j * noise, 0.0), (0.0, noise / np.sqrt(2))][
        : event.phases
    ]  # of phases, a third is zero's
    events = [event, *(_struck(event, *shock) for shock in shocks)]
    drive = Drive.of([excited(e, problem.model) for e in events])
    own = np.tile(problem.by_event(values)[:1], (len(events), 1, 1))
    response = problem.model.simulate(drive, own, np.tile(problem.step.substeps[:1], len(events)))
    seen = response.outputs[:, 0].reshape(drive.channels, len(events), -1)[:, :, : event.start]
    off = np.nan_to_num(seen[:, 1:] - seen[:, :1])
    if event.phases == 1:
        return off[0, 0], np.zeros(1)
    alpha, beta = (off[0, k] + 1j * off[1, k] for k in (0, 1))
    return (alpha - 1j * beta) / 2, off[2, 2]


def _struck(event: WaveEvent, vector: complex, zero: float) -> WaveEvent:
    """The event with one sample of the voltage off, in the stationary frame."""
    v, v_zero = event.v.copy(), event.v_zero.copy()
    v[STRUCK] += vector * event.turn[STRUCK].conj()
    v_zero[STRUCK] += zero
    if event.phases == 1:  # whose imaginary part is what the sample was a quarter of a cycle ago
        later = STRUCK + round(event.rate / event.f0 / 4)
        v[later] += 1j * vector * event.turn[later].conj()
    return replace(event, v=v, v_zero=v_zero)
