"""Where the disagreement is: intervals of time and channel with more residual energy than chance
leaves there.
"""

from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.disagreement import Disagreement
from tractexp.inference.goodness_of_fit import find_extremes
from tractexp.inference.residual_statistics import (
    LOUDEST,
    ResidualWindow,
    list_residual_windows,
    measure_energies,
)


@dataclass(frozen=True)
class DisagreementInterval:
    """One interval of one channel; `share` is its part of all the excess energy."""

    event: str
    channel: str
    start: float  # s, time of the record
    end: float
    share: float


def find_disagreement_intervals(at: Disagreement) -> list[DisagreementInterval]:
    """Intervals that stand out at the family-wise error of `false_alarms`, adjacent ones joined,
    the largest first.
    """
    context = at.context
    windows = list_residual_windows(context.problem)
    (mean, spread), highest = find_extremes(at.chance.left[LOUDEST])
    excess = measure_energies(at.projection.channels(context.problem), context.problem)[0] - mean
    loud = excess / spread > np.quantile(highest, 1 - at.criteria.false_alarms)
    total = np.maximum(excess, 0.0).sum()
    standing_out = [
        DisagreementInterval(
            context.events[group[0].event].record.name,
            group[0].channel,
            group[0].start,
            group[-1].end,
            float(sum(excess[windows.index(c)] for c in group) / total),
        )
        for group in _join_windows([c for c, yes in zip(windows, loud, strict=True) if yes])
    ]
    return sorted(standing_out, key=lambda p: -p.share)


def _join_windows(windows: list[ResidualWindow]) -> list[list[ResidualWindow]]:
    """Cells of one channel that follow each other, together."""
    groups: list[list[ResidualWindow]] = []
    for window in sorted(windows, key=lambda c: (c.event, c.channel, c.part.start)):
        last = groups[-1][-1] if groups else None
        if last and (last.event, last.channel, last.part.stop) == (
            window.event,
            window.channel,
            window.part.start,
        ):
            groups[-1].append(window)
        else:
            groups.append([window])
    return groups
