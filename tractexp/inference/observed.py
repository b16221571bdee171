"""Records as an identification looks at them: the voltage's own noise smoothed out, the noise of P
and Q told from it.

The noise is that of an investigation (`tractexp.noise`): P and Q correlated with each other and in
time, a load that wanders, and what is left of the voltage's noise, which enters the model and
leaves it in P and Q at once.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.errors import UserError
from tractexp.inference.problem import Problem
from tractexp.inference.separable import Sensitivities
from tractexp.model.drive import Drive
from tractexp.noise.model import Noise
from tractexp.noise.quiet import is_louder
from tractexp.noise.random_walk import find_load_walk, remove_slow
from tractexp.noise.voltage import SmoothedEvent
from tractexp.record import Event

# of a residual's variance: where the fit takes more, it tells nothing of the noise
LEAST_REST = 0.2
MOST_SAMPLES = 2_000_000  # of voltages with an error that are simulated at once


@dataclass(frozen=True, eq=False)
class Observed:
    """A problem driven by smoothed voltages.

    Attributes
    ----------
    problem : Problem
        Driven by these.
    smoothed : tuple of SmoothedEvent
        The events, and what may still be wrong with their voltages.
    """

    problem: Problem
    smoothed: tuple[SmoothedEvent, ...]

    @classmethod
    def from_problem(cls, problem: Problem) -> "Observed":
        """A problem with the noise taken out of the voltage of each event."""
        clean = tuple(map(problem.domain.smooth_event, problem.events))
        return cls(problem.driven_by([s.event for s in clean]), clean)

    @property
    def events(self) -> tuple[Event, ...]:
        """The events that are fitted."""
        return self.problem.events

    @property
    def drive(self) -> Drive:
        """The inputs and measurements (C, N) of all events, one after the other."""
        return self.problem.drive

    def noise(
        self,
        residuals: np.ndarray,
        valid: np.ndarray,
        J: Sensitivities,
        values: np.ndarray,
        input_errors: np.ndarray | None,
        whole: bool,
    ) -> Noise | None:
        """Noise from what a fit leaves (C, N) in quiet, or of the `whole` records; None where too
        few samples are.

        `J` is what each coordinate could still change at free `values` (d,).
        """
        # the fit took the others
        rest = np.maximum(1 - J.basis().leverage, LEAST_REST).reshape(residuals.shape)
        columns = J.columns.reshape(-1, *residuals.shape)
        where = self.drive.parts if whole else self._noisy(residuals, valid)
        try:
            return estimate_noise(
                self.problem,
                residuals / np.sqrt(rest),
                valid,
                where,
                (self.problem, values),
                input_errors,
                residuals,
                columns,
            )
        except UserError:
            return None

    def _noisy(self, residuals: np.ndarray, valid: np.ndarray) -> list[slice]:
        """The quiet stretches whose residual (C, N) is noise: those after a dip only where no
        louder than before it.

        Where a record has less noise than the model has error, what is left at its end is the
        model's.
        """
        starts = [int(self.drive.first[e]) + event.start for e, event in enumerate(self.events)]
        before = [part for part in self.problem.quiet if part.stop in starts]
        after = [part for part in self.problem.quiet if part.stop not in starts]
        for c in np.flatnonzero(valid.any(axis=1)):
            calm, late = (
                [remove_slow(residuals[c, p][valid[c, p]]) for p in parts]
                for parts in (before, after)
            )
            if is_louder(late, calm):
                return before
        return self.problem.quiet

    def input_errors(self, values: np.ndarray) -> np.ndarray | None:
        """The errors of the record, as what is compared shows them at free values.

        Parameters
        ----------
        values : (d,)
            Free values of the problem.

        Returns
        -------
        (k, C, N) array [pu] or None
            One standard deviation each: of the voltage's noise, or what the domain says. None where
            there is none.
        """
        if (errors := self.problem.domain.input_errors(self.problem, values)) is not None:
            return errors
        most = max(len(s.errors) for s in self.smoothed)
        if not most:
            return None
        together = max(1, MOST_SAMPLES // self.drive.samples)
        shapes = [None, *range(most)]
        parts = [
            self._driven(values, shapes[k : k + together]) for k in range(0, len(shapes), together)
        ]
        power = np.concatenate(parts)
        return np.nan_to_num(power[1:] - power[0])

    def _driven(self, values: np.ndarray, shapes: Sequence[int | None]) -> np.ndarray:
        """Power (shapes, 2, N) under the smoothed voltages, each with one of its errors; all in one
        simulation.
        """
        problem = self.problem
        count = len(shapes)
        events = [s.event if k is None else s.off_by(k) for k in shapes for s in self.smoothed]
        drive = Drive.from_events(
            [problem.domain.excitation(event, problem.model) for event in events]
        )
        own = np.tile(problem.by_event(values), (count, 1, 1))
        response = problem.model.simulate(drive, own, np.tile(problem.step.substeps, count))
        return response.outputs[:, 0].reshape(drive.channels, count, -1).swapaxes(0, 1)


def estimate_noise(
    records: Problem,
    residual: np.ndarray,
    valid: np.ndarray,
    quiet: Sequence[slice],
    model: tuple[Problem, np.ndarray],
    input_errors: np.ndarray | None,
    left: np.ndarray | None,
    columns: np.ndarray | None,
) -> Noise:
    """The noise of a residual, from the quiet stretches of the records.

    Parameters
    ----------
    records : Problem
        The events.
    residual : (C, N) [pu]
        Whose noise is estimated.
    valid : (C, N) bools
        Which samples count.
    quiet : sequence of slice
        Where little happens.
    model : (Problem, (d,))
        With its free values it tells how noise of the voltage is passed on.
    input_errors : (k, C, N) [pu] or None
        What errors of the record do.
    left : (C, N) [pu] or None
        What a fit leaves; it tells more of how the load wanders.
    columns : (k, C, N) [pu] or None
        What could explain that.

    Returns
    -------
    Noise

    Raises
    ------
    UserError
        Where too few samples are quiet.
    """
    walk = functools.partial(
        find_load_walk, records.events, records.drive, records.power, left, columns, valid
    )
    return records.domain.noise(residual, valid, quiet, *model, walk, input_errors)
