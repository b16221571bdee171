"""The recorder's own window. Phasors of voltage and current are averages over one or more cycles: the load saw a
voltage with sharper edges than the record shows, and its power was smoothed as the voltage was.

With a box h over the window, U = h * u and I = h * i are recorded, and P + jQ = U conj(I). A load whose current is
linear in the voltage would not show it; any other does wherever the voltage bends. u is reckoned back from U near
the edges of the dip, where it is free to bend, and the model's current at u is averaged as the recorder does.

Source: IEC/IEEE 60255-118-1. Departures: the angle of the voltage is taken as steady over a window.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.model.drive import Drive
from tractexp.model.parts import Measurement
from tractexp.record import Event, Window

CYCLES = (1, 2, 3, 4, 5, 6)
EDGE = 0.05  # s on either side of a window around an edge, in which the voltage may bend
BENT, CALM = 0.01, 3e-4  # pu: second differences of the voltage there, and elsewhere
ERROR = 2e-4  # pu: how exactly the averaged voltage must be the recorded one, if its noise allows


@dataclass(frozen=True, eq=False)
class RecorderWindow(Measurement):
    """A recorder that forms phasors over a window [s]: a plain mean, or what the records say it was."""

    window: float
    known: Window | None = None

    def __repr__(self) -> str:
        return f"RecorderWindow({self.window}{f', {self.known.name}' if self.known else ''})"

    def describe(self) -> str:
        """The window, as a run tells it."""
        said = f", as the record says ({self.known.name})" if self.known else ""
        return f"the recorder averages phasors over {1000 * self.window:.0f} ms{said}"

    def weights(self, step: float) -> np.ndarray:
        """What each sample, `step` [s] apart, counts around the middle one, (odd,)."""
        return _weights(self.window / step) if self.known is None else self.known.on(step)

    def observe(self, power: np.ndarray, drive: Drive, values: dict[str, np.ndarray]) -> np.ndarray:
        shown = np.empty_like(power)
        for e in range(drive.events):
            part, weights = drive.part(e), self.weights(drive.event[e, -1])
            u = drive.inputs[0, part]
            shown[:, :, part] = _mean(power[:, :, part] / u, weights) * _mean(u, weights)
        return shown

    def sharpened(self, event: Event) -> Event:
        """The event with the voltage that the load saw."""
        from scipy.sparse import diags_array
        from scipy.sparse.linalg import spsolve

        samples, U = self.window / event.record.step, event.record.U
        weights = self.weights(event.record.step)
        n, wide = len(U), len(U) + len(weights) - 1
        box = diags_array(list(weights), offsets=list(range(len(weights))), shape=(n, wide))
        bend = diags_array([1.0, -2.0, 1.0], offsets=[0, 1, 2], shape=(wide - 2, wide))
        at = np.arange(1, wide - 1) - len(weights) // 2
        near = samples + EDGE / event.record.step
        free = (np.abs(at - event.start) < near) | (np.abs(at - event.end) < near)
        error = max(ERROR, event.noise_U)
        normal = box.T @ box / error**2 + bend.T @ diags_array(np.where(free, BENT, CALM) ** -2.0) @ bend
        u = spsolve(normal.tocsc(), box.T @ U / error**2)[len(weights) // 2 :][:n]
        return replace(event, record=replace(event.record, U=u))


def averaged(y: np.ndarray, samples: float) -> np.ndarray:
    """Mean of y (..., N) over a window around each sample, y linear between samples and constant beyond its ends."""
    return _mean(y, _weights(samples))


def _mean(y: np.ndarray, weights: np.ndarray) -> np.ndarray:
    ends = [(0, 0)] * (y.ndim - 1) + [(len(weights) // 2,) * 2]
    return np.lib.stride_tricks.sliding_window_view(np.pad(y, ends, "edge"), len(weights), axis=-1) @ weights


def _weights(samples: float) -> np.ndarray:
    """What each sample around the middle one counts in the mean over a window, (odd,)."""
    whole, part = divmod(samples / 2, 1)
    half = np.zeros(int(whole) + 2)
    half[:-2] += 0.5
    half[1:-1] += 0.5
    half[-2:] += part - part**2 / 2, part**2 / 2
    return np.r_[half[:0:-1], 2 * half[0], half[1:]] / samples


def windows_of(events: Sequence[Event]) -> list[RecorderWindow]:
    """The windows that recorders of these events may have: the one they say, else whole cycles, shortest first.

    None is longer than what came before the dip, or too short for the sampling to show.
    """
    cycle, step = 1 / events[0].record.base.frequency, events[0].record.step
    before = min(e.start * e.record.step for e in events)
    said = {e.record.window.name if e.record.window else "": e.record.window for e in events}
    (known, *others) = said.values()
    lengths = [known.length] if known and not others else [k * cycle for k in CYCLES]
    return [RecorderWindow(w, None if others else known) for w in lengths if 2 * step <= w < before]
