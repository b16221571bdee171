"""Records as an identification looks at them: the voltage's own noise smoothed out, the noise of P and Q told from it.

The noise is that of an investigation (`tractexp.noise`): P and Q correlated with each other and in time, a load that
wanders, and what is left of the voltage's noise, which enters the model and leaves it in P and Q at once.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.errors import UserError
from tractexp.identification.problem import Problem, excitation
from tractexp.model.drive import Drive
from tractexp.noise.model import Noise
from tractexp.noise.quiet import estimate, quiet_stretches
from tractexp.noise.voltage import Smoothed, smoothed
from tractexp.noise.wander import LESS, SEEN, WITHIN, Wander, find, power_profile
from tractexp.record import Event

MOST_SAMPLES = 2_000_000  # of voltages with an error that are simulated at once


@dataclass(frozen=True, eq=False)
class Observed:
    """A problem driven by smoothed voltages, and what may still be wrong with these."""

    problem: Problem
    smoothed: tuple[Smoothed, ...]

    @classmethod
    def of(cls, problem: Problem) -> "Observed":
        """The same problem with the noise taken out of the voltage of each event."""
        clean = tuple(smoothed(event) for event in problem.events)
        return cls(problem.driven_by([s.event for s in clean]), clean)

    @property
    def events(self) -> tuple[Event, ...]:
        return self.problem.events

    @property
    def drive(self) -> Drive:
        return self.problem.drive

    @functools.cached_property
    def quiet(self) -> list[slice]:
        """The samples in which little happens."""
        return quiet_stretches(self.events, self.drive)

    @functools.cached_property
    def profile(self) -> np.ndarray:
        """Apparent power over that before each event, (N,)."""
        return power_profile(self.drive.measured, self.drive.before, self.drive.first)

    def noise(self, residuals: np.ndarray, known: np.ndarray, blur: np.ndarray | None) -> Noise | None:
        """Noise from residuals (2, N) in quiet; None where too few samples are. `blur` is that of `blurred`."""
        try:
            return estimate(residuals, known, self.quiet, self._wander, blur)
        except UserError:
            return None

    def _wander(self, mix: np.ndarray) -> Wander | None:
        """How the load wanders before the events, in mixed channels."""
        before = [self.drive.measured[:, self.drive.part(e)][:, event.steady] for e, event in enumerate(self.events)]
        mixed = [mix @ b for b in before if np.isfinite(b).all()]
        return find(mixed, self.events[0].record.step, self.profile, seen=SEEN, within=WITHIN, less=LESS)

    def blurred(self, values: np.ndarray) -> np.ndarray | None:
        """What errors of the voltage do to the power at free values (d,): (k, 2, N) [pu], None where it has none."""
        most = max(len(s.errors) for s in self.smoothed)
        if not most:
            return None
        together = max(1, MOST_SAMPLES // self.drive.samples)
        shapes = [None, *range(most)]
        parts = [self._driven(values, shapes[k : k + together]) for k in range(0, len(shapes), together)]
        power = np.concatenate(parts)
        return np.nan_to_num(power[1:] - power[0])

    def _driven(self, values: np.ndarray, shapes: Sequence[int | None]) -> np.ndarray:
        """Power (shapes, 2, N) under the smoothed voltages, each with one of its errors; all in one simulation."""
        problem, count = self.problem, len(shapes)
        events = [s.event if k is None else s.off_by(k) for k in shapes for s in self.smoothed]
        drive = Drive.of([excitation(event) for event in events])
        own = np.tile(problem.by_event(values), (count, 1, 1))
        response = problem.model.simulate(drive, own, np.tile(problem.step.substeps, count))
        return np.stack((response.P[0], response.Q[0])).reshape(2, count, -1).swapaxes(0, 1)
