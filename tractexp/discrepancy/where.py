"""Where the disagreement is: intervals of time and channel with more residual energy than chance leaves there."""

from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.left import LOUDEST, Cell, cells_of, channels_of, energies, extremes
from tractexp.discrepancy.null import Null
from tractexp.discrepancy.tangent import Projection


@dataclass(frozen=True)
class Place:
    """One interval of one channel; `share` is its part of all the excess energy."""

    event: str
    channel: str
    start: float  # s, time of the record
    end: float
    share: float


def where(projection: Projection, null: Null, alpha: float) -> list[Place]:
    """Intervals that stand out at a family-wise error of `alpha`, adjacent ones joined, the largest first."""
    study = projection.tangent.study
    cells = cells_of(study)
    mean, spread, highest = extremes(null.left[LOUDEST])
    excess = energies(channels_of(projection, study), study)[0] - mean
    found = excess / spread > np.quantile(highest, 1 - alpha)
    total = np.maximum(excess, 0.0).sum()
    places = [
        Place(
            study.events[group[0].event].record.name, group[0].channel, group[0].start, group[-1].end,
            float(sum(excess[cells.index(c)] for c in group) / total),
        )
        for group in _joined([c for c, yes in zip(cells, found, strict=True) if yes])
    ]  # fmt: skip
    return sorted(places, key=lambda p: -p.share)


def _joined(cells: list[Cell]) -> list[list[Cell]]:
    """Cells of one channel that follow each other, together."""
    groups: list[list[Cell]] = []
    for cell in sorted(cells, key=lambda c: (c.event, c.channel, c.part.start)):
        last = groups[-1][-1] if groups else None
        if last and (last.event, last.channel, last.part.stop) == (cell.event, cell.channel, cell.part.start):
            groups[-1].append(cell)
        else:
            groups.append([cell])
    return groups
