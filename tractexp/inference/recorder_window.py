"""A recorder's own window as an investigation looks for it; what one does is told in
`tractexp.record.window`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.domain.averaging import RECORDED
from tractexp.model.drive import Drive
from tractexp.model.parts import Measurement
from tractexp.record import Event, Window
from tractexp.record.window import averaged_power, build_mean_weights, sharpen_voltage
from tractexp.recording.estimator import list_estimators

CYCLES = (1, 2, 3, 4, 5, 6)  # of the plain means
SAME_WEIGHT = 1e-9  # weights that differ by less are equal


@dataclass(frozen=True, eq=False)
class RecorderWindow(Measurement):
    """A recorder that forms phasors over a window.

    Attributes
    ----------
    window : float [s]
        Its length.
    shape : Window or None
        The weights of an estimator; None: a plain mean.
    said : bool
        Whether the records say that it is this one.
    """

    window: float
    shape: Window | None = None
    said: bool = False

    def __repr__(self) -> str:
        """ "RecorderWindow(0.02, p_class)": the length [s] and the estimator whose shape it has."""
        return f"RecorderWindow({self.window}{f', {self.shape.name}' if self.shape else ''})"

    @property
    def setting(self) -> float | str:
        """The value of `model.window` that names it."""
        if self.said:
            return RECORDED
        return self.shape.name if self.shape else self.window

    @property
    def averages(self) -> bool:
        """Whether no sample has a negative weight."""
        return self.shape is None or bool((self.shape.weights >= 0).all())

    def describe(self) -> str:
        """The window, as a run tells it."""
        weights = f" by the weights of {self.shape.name}" if self.shape and not self.said else ""
        said = f", as the record says ({self.shape.name})" if self.shape and self.said else ""
        return f"the recorder averages phasors over {1000 * self.window:.0f} ms{weights}{said}"

    def weights(self, step: float) -> np.ndarray:
        """The weights (odd,) of samples `step` [s] apart around the middle one."""
        return (
            build_mean_weights(self.window / step)
            if self.shape is None
            else self.shape.compute_weights(step)
        )

    def observe(self, power: np.ndarray, drive: Drive, values: dict[str, np.ndarray]) -> np.ndarray:
        """Powers (2, n, N) [pu] as the recorder shows them.

        The current is averaged over the window, and multiplied by the voltage recorded.
        """
        shown = np.empty_like(power)
        for e, part in enumerate(drive.parts):
            weights = self.weights(drive.event[e, -1])
            u = drive.find_phasors(e)
            shown[:, :, part] = averaged_power(power[:, :, part], u, weights)
        return shown

    def sharpen_event(self, event: Event) -> Event:
        """The event with the voltage that the load saw."""
        return sharpen_voltage(event, self.weights(event.record.step), self.window)


def list_recorder_windows(events: Sequence[Event]) -> list[RecorderWindow]:
    """The windows that recorders of these events may have: the one they say, else whole cycles and
    those of the estimators, shortest first.

    None is longer than what came before the dip, or too short for the sampling to show.
    """
    frequency = events[0].record.base.frequency
    step = events[0].record.step
    before = min(e.start * e.record.step for e in events)
    said = {e.record.window.name if e.record.window else "": e.record.window for e in events}
    (recorded, *others) = said.values()
    if recorded and not others:
        windows = [RecorderWindow(recorded.length, recorded, said=True)]
    else:
        windows = _list_usual_windows(frequency)
    return [w for w in sorted(windows, key=lambda w: w.window) if 2 * step <= w.window < before]


def _list_usual_windows(frequency: float) -> list[RecorderWindow]:
    """The windows that recorders commonly use at a nominal frequency [Hz]: plain means over whole
    cycles, then the windows of estimators whose weights are not all equal.
    """
    means = [RecorderWindow(cycles / frequency) for cycles in CYCLES]
    windows = [estimator.window(frequency) for estimator in list_estimators(frequency)]
    uneven = [window for window in windows if np.ptp(window.weights) > SAME_WEIGHT]
    return [*means, *(RecorderWindow(window.length, window) for window in uneven)]
