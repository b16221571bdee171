"""What chance alone does to the tests: the fit's own noise drawn again and put through the same projection.

Thresholds hold for the largest of all candidates at once, for the noise as it was estimated, and, where the quiet
samples are few, for the error of that estimate too: each draw then estimates its noise anew.
"""

from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.left import SMALLEST_P, least_p, statistics, tail
from tractexp.discrepancy.study import Study
from tractexp.discrepancy.tangent import Projection, Tangent, rich_residuals
from tractexp.noise.model import Noise

DRAWS = 199
FEW = 150  # independent quiet samples below which the noise estimate is itself uncertain


@dataclass(frozen=True, eq=False)
class Null:
    """Draws under the null of the smallest p (b,) of any candidate or fault of measurement, and of what is left."""

    least_p: np.ndarray
    left: dict[str, np.ndarray]

    def critical_p(self, alpha: float) -> float:
        """The p a single candidate must undercut so that chance names any with probability `alpha`."""
        return float(np.quantile(self.least_p, alpha, method="lower"))

    def surprises(self, projection: Projection, study: Study) -> dict[str, float]:
        """How often chance leaves as much as a fit does, by each test of adequacy."""
        return {name: tail(self.left[name], found) for name, found in statistics(projection, study).items()}


def null_of(t: Tangent, noise: Noise, seed: int, plain: bool, draws: int = DRAWS) -> Null:
    """Draw the null of every statistic at a fit; where the case is `plain`, with the noise taken as known."""
    study, drive = t.study, t.study.problem.drive
    rng = np.random.default_rng(seed)
    made = noise.draw(rng, draws, np.diff(drive.first).tolist())
    made *= study.likelihood.known
    if plain or noise.worth(sum(p.stop - p.start for p in study.quiet)) >= FEW:
        return _collect([t.whitened(noise, made)], study, noise.blurred)
    rest = rich_residuals(t, made)
    return _collect([t.whitened(study.noise_in(rest[b]), made[b : b + 1]) for b in range(draws)], study, noise.blurred)


def _collect(projections: list[Projection], study: Study, blurred: bool) -> Null:
    least, found = [], []
    for projection in projections:
        p = least_p(projection)
        if not blurred:
            chain = np.array(list(projection.chain_p().values())).reshape(-1, len(p))
            p = np.maximum(np.minimum(p, chain.min(axis=0, initial=1.0)), SMALLEST_P)
        least.append(p)
        found.append(statistics(projection, study))
    return Null(np.concatenate(least), {name: np.concatenate([f[name] for f in found]) for name in found[0]})
