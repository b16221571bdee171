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
from tractexp.identification.wave_errors import offsets
from tractexp.model.drive import Drive
from tractexp.noise.model import Noise
from tractexp.noise.quiet import estimate, quiet_stretches
from tractexp.noise.voltage import Smoothed, smoothed
from tractexp.noise.wander import LESS, WITHIN, Rest, Wander, find, power_profile
from tractexp.noise.waves import of_waves
from tractexp.record import Event

LEAST_KEPT = 0.2  # of a residual's variance: where the fit takes more, it tells nothing of the noise
# Twice the log-likelihood from which a load is said to wander. An investigation asks for less: a wandering that is not
# there costs it little, and an estimate a third of its precision.
SEEN = 5.0
MOST_SAMPLES = 2_000_000  # of voltages with an error that are simulated at once


@dataclass(frozen=True, eq=False)
class Observed:
    """A problem driven by smoothed voltages, and what may still be wrong with these."""

    problem: Problem
    smoothed: tuple[Smoothed, ...]

    @classmethod
    def of(cls, problem: Problem) -> "Observed":
        """The same problem with the noise taken out of the voltage of each event."""
        if problem.model.waves:  # within a cycle nothing tells noise of the voltage from the voltage
            return cls(problem, tuple(Smoothed(event, np.empty((0, event.record.samples))) for event in problem.events))
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

    def noise(
        self,
        residuals: np.ndarray,
        known: np.ndarray,
        columns: np.ndarray,
        blur: np.ndarray | None,
        whole: bool,
        answers: Sequence[np.ndarray] | None = None,
    ) -> Noise | None:
        """Noise from what a fit leaves (2, N) in quiet, or of the `whole` records; None where too few samples are.

        `columns` (k, 2, N) are what each coordinate could still change; `blur` is that of `blurred`, `answers` that
        of `wave_errors`.
        """
        apart = np.linalg.qr(columns.reshape(len(columns), -1)[np.any(columns != 0, axis=(1, 2))].T)[0]
        kept = np.maximum(1 - (apart**2).sum(axis=1), LEAST_KEPT).reshape(residuals.shape)  # the fit took the rest
        where = [self.drive.part(e) for e in range(self.drive.events)] if whole else self.quiet
        try:
            if answers is not None:
                return of_waves(residuals / np.sqrt(kept), known, where, answers, self.events[0].phases, blur)
            wander = functools.partial(self._wander, residuals, columns, known)
            return estimate(residuals / np.sqrt(kept), known, where, wander, blur)
        except UserError:
            return None

    def _wander(self, left: np.ndarray, columns: np.ndarray, known: np.ndarray, mix: np.ndarray) -> Wander | None:
        """How the load wanders before the events and during them, in mixed channels."""
        parts = [self.drive.part(e) for e in range(self.drive.events)]
        before = [self.drive.measured[:, p][:, event.steady] for p, event in zip(parts, self.events, strict=True)]
        rests = []
        if known.all():
            mixed = np.einsum("ij,kjt->kit", mix, columns)
            rests = [Rest(mix @ left[:, part], mixed[:, :, part], self.profile[part]) for part in parts]
        return find(
            [mix @ b for b in before if np.isfinite(b).all()], self.events[0].record.step, self.profile, rests,
            seen=SEEN, within=WITHIN, less=LESS,
        )  # fmt: skip

    def blurred(self, values: np.ndarray) -> np.ndarray | None:
        """What errors of the voltage do to the power at free values (d,): (k, 2, N) [pu], None where it has none.

        Of waveforms, whose voltage stands as recorded, the offsets (k, 3, N) that the current's channels may have.
        """
        if self.problem.model.waves:
            return offsets(self.drive)
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
        drive = Drive.of([excitation(event, problem.model) for event in events])
        own = np.tile(problem.by_event(values), (count, 1, 1))
        response = problem.model.simulate(drive, own, np.tile(problem.step.substeps, count))
        return response.outputs[:, 0].reshape(drive.channels, count, -1).swapaxes(0, 1)
