"""What a fit leaves that no effect of the catalogue accounts for, by every statistic of an investigation."""

import numpy as np

from tractexp.discrepancy.bench import Bench
from tractexp.discrepancy.projection import Projection
from tractexp.identification import surprises
from tractexp.identification.surprises import SMALLEST_P


def statistics(projection: Projection, bench: Bench) -> dict[str, np.ndarray]:
    """Every statistic by what it looks for: a sum (b,), or those of which the largest counts (b, k)."""
    of_channels = surprises.statistics(channels_of(projection, bench), bench)
    by_test = {
        "pushes into the balances": projection.unrest(),
        "a further effect": -np.log(least_p(projection))[:, None],
        **of_channels,
    }
    if len(bench.events) > 1:
        by_test["parameters of each event"] = projection.unsteadiness()
    return by_test


def least_p(projection: Projection) -> np.ndarray:
    """The smallest p (b,) of all candidates."""
    return np.maximum(projection.drops[1].min(axis=0, initial=1.0), SMALLEST_P)


def channels_of(projection: Projection, bench: Bench) -> np.ndarray:
    """Whitened, projected residuals (b, C, N), without the rows of the prior."""
    size = bench.drive.measured.size
    return projection.r[:, :size].reshape(len(projection.r), bench.drive.channels, -1)
