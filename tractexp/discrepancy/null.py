"""What chance alone does to the tests: the fit's own noise drawn again and put through the same projection.

Thresholds hold for the largest of all candidates at once, for the noise as it was estimated, and, where the quiet
samples are few, for the error of that estimate too: each draw then estimates its noise anew.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import gammaincc

from tractexp.discrepancy.noise import Noise
from tractexp.discrepancy.study import Study
from tractexp.discrepancy.tangent import Projection, Tangent, rich_residuals, windows

DRAWS = 199
FEW = 150  # independent quiet samples below which the noise estimate is itself uncertain
SMALLEST_P = 1e-300


@dataclass(frozen=True, eq=False)
class Cell:
    """A stretch of one channel of one event, as samples of the drive and as times of the record."""

    event: int
    channel: str
    part: slice
    start: float  # s
    end: float


@dataclass(frozen=True, eq=False)
class Null:
    """Draws of each statistic under the null, (b,), and of the energy in each cell, (b, cells)."""

    least_p: np.ndarray  # over all candidates and the measurement chain
    further: np.ndarray  # over the candidates alone
    unrest: np.ndarray
    unsteadiness: np.ndarray
    energy: np.ndarray

    def critical_p(self, alpha: float) -> float:
        """The p a single candidate must undercut so that chance names any with probability `alpha`."""
        return float(np.quantile(self.least_p, alpha, method="lower"))

    def left(self, projection: Projection, study: Study) -> dict[str, float]:
        """How often chance leaves as much as a fit does, by each of the tests of adequacy.

        A test's tail is that of a gamma or, for the extreme of many, a Gumbel distribution with the moments of the
        draws, so that it reaches further than their number.
        """
        mean, spread = self.energy.mean(axis=0), self.energy.std(axis=0) + 1e-12
        loudest = ((self.energy - mean) / spread).max(axis=1)
        found = ((energies(projection, study)[0] - mean) / spread).max()
        further = -np.log(_least_p(projection)[0])
        tests = {
            "pushes into the balances": _gamma_tail(self.unrest, projection.unrest()[0]),
            "the loudest window": _gumbel_tail(loudest, found),
            "a further effect": _gumbel_tail(-np.log(self.further), further),
        }
        if len(study.events) > 1:
            tests["parameters of each event"] = _gamma_tail(self.unsteadiness, projection.unsteadiness()[0])
        return tests


def _gamma_tail(draws: np.ndarray, value: float) -> float:
    mean, variance = draws.mean(), max(draws.var(), 1e-300)
    return float(gammaincc(mean**2 / variance, max(value, 0.0) * mean / variance))


def _gumbel_tail(draws: np.ndarray, value: float) -> float:
    scale = draws.std() * np.sqrt(6) / np.pi
    return float(-np.expm1(-np.exp(-(value - draws.mean()) / scale - np.euler_gamma)))


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


def _least_p(projection: Projection) -> np.ndarray:
    """The smallest p (b,) of all candidates."""
    return np.maximum(projection.drops[1].min(axis=0, initial=1.0), SMALLEST_P)


def _collect(projections: list[Projection], study: Study, blurred: bool) -> Null:
    draws = []
    for projection in projections:
        further = least = _least_p(projection)
        if not blurred:
            chain = np.array(list(projection.chain_p().values())).reshape(-1, len(least))
            least = np.maximum(np.minimum(least, chain.min(axis=0, initial=1.0)), SMALLEST_P)
        measures = projection.unrest(), projection.unsteadiness(), energies(projection, study)
        draws.append((least, further, *measures))
    return Null(*map(np.concatenate, zip(*draws, strict=True)))


def cells_of(study: Study) -> list[Cell]:
    """Every window of every event, for P and for Q."""
    made = []
    for e, event in enumerate(study.events):
        first, step, origin = int(study.problem.drive.first[e]), event.record.step, event.record.t[0]
        for a, b in windows(study, e):
            i, j = round(a / step), min(round(b / step), event.record.samples)
            if j - i < 2:
                continue
            part = slice(first + i, first + j)
            made += [Cell(e, c, part, origin + i * step, origin + (j - 1) * step) for c in "PQ"]
    return made


def energies(projection: Projection, study: Study) -> np.ndarray:
    """Whitened, projected energy of each residual in each cell, (b, cells), over that of a sample in quiet."""
    N = study.problem.drive.samples
    square = projection.r[:, : 2 * N].reshape(len(projection.r), 2, N) ** 2
    square /= np.mean(np.concatenate([square[:, :, part] for part in study.quiet], axis=2), axis=2, keepdims=True)
    return np.stack([square[:, "PQ".index(c.channel), c.part].sum(axis=1) for c in cells_of(study)], axis=1)
