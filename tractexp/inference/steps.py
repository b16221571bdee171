"""The Runge-Kutta steps of a simulation, as few as some candidates need."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.domain import find_domain
from tractexp.errors import MODEL, UserError
from tractexp.model.drive import Drive
from tractexp.model.model import CLASSICAL, MOST_SUBSTEPS, Model
from tractexp.record import Event

# share of candidates that must be calculated where a model has effects: behind an impedance some
# loads collapse, which no number of steps calculates
LEAST_CALCULATED_SHARE = 0.9


@dataclass(frozen=True)
class Step:
    """The Runge-Kutta steps of a simulation.

    Attributes
    ----------
    substeps : (E,) ints
        Steps per sample of each event.
    error : (E,) [pu]
        The largest error that these steps leave; nan where the number was given by hand.
    """

    substeps: np.ndarray
    error: np.ndarray

    @classmethod
    def from_setting(cls, substeps: int | Sequence[int], events: int) -> "Step":
        """The number that a user gave, for so many events, or one for each of them.

        Raises
        ------
        UserError
            For a number out of range.
        """
        given = np.broadcast_to(substeps, events)
        if given.min() < 1 or given.max() > MOST_SUBSTEPS:
            raise UserError(
                f"{MODEL.substeps}={substeps} is out of range: it must be 1 to {MOST_SUBSTEPS}"
            )
        return cls(given.copy(), np.full(events, np.nan))

    def describe(self, events: Sequence[Event]) -> str:
        """The sentence that a run prints: the steps, their lengths [ms] and the error they leave
        [pu].
        """
        sizes = [1e3 * e.record.step / n for e, n in zip(events, self.substeps, strict=True)]
        text = ", ".join(
            f"{n} of {size:g} ms"
            for n, size in dict(zip(self.substeps.tolist(), sizes, strict=True)).items()
        )
        worst = float(np.max(self.error))
        error = (
            "with some values in the bounds it diverges"
            if np.isinf(worst)
            else f"largest error {worst:.1e} pu"
        )
        return f"{text} per sample ({'given' if np.isnan(worst) else error})"


def count_steps(model: Model, drive: Drive, events: Sequence[Event], candidates: np.ndarray) -> int:
    """The steps per sample that some candidates need, the most of all events.

    Parameters
    ----------
    model : Model
        The equations.
    drive : Drive
        The events end to end.
    events : sequence of Event
        The same.
    candidates : (n, p) or (E, n, p)
        Parameters of the model.

    Returns
    -------
    int
    """
    fine = find_domain(model).finest
    until = _find_ends(model, events)
    return int(model.substeps(drive, candidates, fine, until=until)[0].max())


def choose_steps(
    model: Model, drive: Drive, events: Sequence[Event], probes: np.ndarray, share: float
) -> Step:
    """The fewest steps that suffice for a share of candidates.

    Parameters
    ----------
    model, drive, events
        As of `count_steps`.
    probes : (n, p) or (E, n, p)
        Candidates all over the box.
    share : float
        Of them, 0 to 1.

    Returns
    -------
    Step

    Raises
    ------
    UserError
        Where the finest step that is allowed leaves too large an error.
    """
    domain = find_domain(model)
    until = _find_ends(model, events)
    fine = domain.finest
    chosen, error = model.substeps(drive, probes, fine, share, until)
    if domain.stiff and np.isinf(error).any():  # stiff circuits of the box may diverge: refused
        lasting = _find_lasting(model, drive, events, probes)
        if lasting.any():
            chosen, error = model.substeps(drive, probes[lasting], fine, share, until)
    if model.effects and share > LEAST_CALCULATED_SHARE and not (error <= fine).all():
        chosen, error = model.substeps(drive, probes, fine, LEAST_CALCULATED_SHARE, until)
    if model.integration == CLASSICAL and not (error <= fine).all():
        worst = int(np.argmax(error))
        record = events[worst].record
        raise UserError(
            f"{record.name}: {MOST_SUBSTEPS} Runge-Kutta steps per sample of"
            f" {1e3 * record.step:g} ms leave an error of {error[worst]:.1e} pu somewhere in the"
            f" bounds; raise the lower bound of the model's time constants ({MODEL.bounds}),"
            f" or set {MODEL.substeps}; what jumps within a sample in an equation of yours"
            " belongs in a memory"
        )
    return Step(chosen, error)


def _find_ends(model: Model, events: Sequence[Event]) -> list[float]:
    """Seconds of each event, from its first sample on, in which the step is judged."""
    ends = [e.record.t[min(e.end, e.record.samples - 1)] - e.record.t[0] for e in events]
    return [end + find_domain(model).aftermath for end in ends]


def _find_lasting(
    model: Model, drive: Drive, events: Sequence[Event], candidates: np.ndarray
) -> np.ndarray:
    """Which candidates stay finite at the finest step, (n,): circuits with a negative reactance
    grow beyond all bounds at any.
    """
    finest = np.full(len(events), MOST_SUBSTEPS)
    outputs = model.simulate(drive, candidates, finest).outputs
    return np.all(np.isfinite(outputs), axis=(0, 2))
