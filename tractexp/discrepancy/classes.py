"""Sets of effects that predict alike, over a grid of dips that were not recorded: the dip from
which they part, and by how much.

Tied sets are one class: what they predict is known, which of them is right is not. They part where
the power that they calculate differs, by rms from the dip on, by more of the response than the
records show of them.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.discrepancy.next_event.imagined import ImaginedDip, driven
from tractexp.inference.context import Context
from tractexp.inference.fitting import Names, Refit
from tractexp.inference.model_error import in_percent
from tractexp.model.drive import Drive

GRID_DEPTHS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
GRID_DURATIONS = (0.04, 0.1, 0.2, 0.5, 1.0)  # s
GRID_JUMPS = (0.0, 20.0)  # degrees
GRID_UNBALANCES = (0.0, 0.5)  # of the depth
LEAST_PARTING = 0.01  # of the response: less is no difference to anyone


@dataclass(frozen=True)
class EffectClass:
    """Sets of effects that predict alike.

    Attributes
    ----------
    sets : tuple of tuples of names
        The tied sets.
    part_at : ImaginedDip or None
        The dip from which on they differ; None where none of those tried parts them.
    by : float
        The share of the response by which they differ there; without such a dip the most that they
        differ by, nan where the motor stalls in all.
    """

    sets: tuple[Names, ...]
    part_at: ImaginedDip | None
    by: float

    def to_dict(self) -> dict[str, Any]:
        """As `discrepancy.json` has it."""
        part_at = self.part_at and {**self.part_at.to_dict(), "words": self.part_at.words}
        return {"sets": [list(names) for names in self.sets], "part_at": part_at, "by": self.by}

    def __str__(self) -> str:
        if np.isnan(self.by):
            return "the motor stalls in all of them in every dip that was tried"
        share = in_percent(self.by)
        if self.part_at is None:
            return f"they predict alike within {share} of the response in every dip that was tried"
        return (
            f"they predict alike in milder dips, and part by {share} of the response in"
            f" {self.part_at.words}"
        )


def compare_predictions(
    context: Context, fits: Sequence[Refit], sets: Sequence[Names], error: float
) -> EffectClass:
    """The class of tied sets, by their fits, which miss `error` of the response of the records."""
    dips = sorted(imagine_grid(context, fits), key=lambda dip: dip.burden)
    drive = Drive.from_events([driven(context, dip) for dip in dips])
    at = context.coordinates
    power = [
        context.kernels.simulate(fit.names, at.without_faults(fit.unit, ())[None], drive)[0]
        for fit in fits
    ]
    apart = np.array([measure_parting(power, drive, e) for e in range(len(dips))])
    parting = np.flatnonzero(apart > max(error, LEAST_PARTING))
    if not len(parting):
        known = apart[np.isfinite(apart)]
        return EffectClass(tuple(sets), None, float(known.max()) if known.size else np.nan)
    first = int(parting[0])
    return EffectClass(tuple(sets), dips[first], float(apart[first]))


def imagine_grid(context: Context, fits: Sequence[Refit]) -> list[ImaginedDip]:
    """Dips of 5 to 70 % for 40 ms to 1 s, with and without a phase jump, and unbalanced where one
    of the sets reads it.
    """
    domain = context.domain
    reads = {
        channel
        for fit in fits
        for name in fit.names
        for channel in context.catalogue[name].effect.reads
    }
    unbalances = GRID_UNBALANCES if not domain.further or "U2" in reads else GRID_UNBALANCES[:1]
    durations = [one for one in GRID_DURATIONS if one < domain.dips.length]
    every = itertools.product(GRID_DEPTHS, durations, GRID_JUMPS, unbalances)
    return [
        ImaginedDip(depth, duration, jump=jump, unbalance=unbalance, domain=domain)
        for depth, duration, jump, unbalance in every
    ]


def measure_parting(power: Sequence[np.ndarray], drive: Drive, event: int) -> float:
    """How far sets differ in an event.

    Parameters
    ----------
    power : sequence of arrays [pu]
        What each set calculates.
    drive : Drive
        The events.
    event : int
        Which of them, from 0.

    Returns
    -------
    float
        The largest rms difference of two sets over the rms of their mean response; nan where the
        motor stalls or diverges in both of a pair, infinite where in one.
    """
    part = drive.part(event)
    changes = [one[:, part] - one[:, part][:, :1] for one in power]
    sizes = [float(np.linalg.norm(change)) for change in changes]
    shares = []
    for (a, one), (b, other) in itertools.combinations(enumerate(changes), 2):
        whole = (sizes[a] + sizes[b]) / 2
        alive = np.isfinite([sizes[a], sizes[b]])
        if not alive.any():
            continue
        shares.append(np.linalg.norm(one - other) / max(whole, 1e-30) if alive.all() else np.inf)
    return max(map(float, shares), default=np.nan)
