"""One model that holds every candidate, and refits of any subset of them side by side.

All candidates sit in one model at their nulls, so that one kernel serves every score and every refit, and base and
extended model are nested by construction. A refit is a lane of the batched descent with its own free columns.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.catalogue import Catalogue
from tractexp.discrepancy.injection import Injection
from tractexp.discrepancy.noise import Noise, estimate, quiet_stretches
from tractexp.identify.descent import descend
from tractexp.identify.likelihood import Likelihood
from tractexp.identify.problem import Problem
from tractexp.model.model import Model, compose
from tractexp.record import Event

STARTS = 24  # of the base fit
ROUGH, EXACT = (12, 0.1), (40, 1e-3)  # iterations and tolerance of the deviance
KEPT = 3  # of them that are refined with the measurement chain free
PRIOR = 5.0  # smallest relevant sizes: how far the measurement chain is believed to be off, one standard deviation


@dataclass(frozen=True, eq=False)
class Refit:
    """The best fit of one set of effects: coordinates (D,) of the whole study and deviance."""

    names: tuple[str, ...]
    unit: np.ndarray
    deviance: float


class Study:
    """Training events, the union model, and where each parameter stands among its coordinates.

    Coordinates (D,) lie in the unit cube: the base model's free parameters, all candidates' parameters, the
    injection's, then P0 and Q0 of each event.
    """

    def __init__(
        self,
        model: Model,
        catalogue: Catalogue,
        events: Sequence[Event],
        bounds: Mapping[str, Sequence[float]],
        fixed: Mapping[str, float],
        substeps: int | None = None,
    ):
        self.model, self.catalogue, self.events = model, catalogue, tuple(events)
        base = self._alone = Problem(model, events, bounds, fixed, substeps)
        union = compose(model.motor, model.static, [*model.effects, *catalogue.effects, Injection()])
        self.problem = Problem(union, events, bounds, fixed, int(base.step.substeps.max()))
        self.likelihood = Likelihood.of(self.problem)
        space = self.problem.space
        self.column = {name: k for k, name in enumerate(space.names)}
        self.base = np.array([self.column[name] for name in base.space.names])
        self.before = np.arange(space.dimension, space.dimension + 2 * len(events))
        self.dimension = space.dimension + 2 * len(events)
        self.null = self._null()
        self.quiet = quiet_stretches(self.events, self.problem.drive)
        self.simulations = 0

    def _null(self) -> np.ndarray:
        """Coordinates with every candidate at its null, the base parameters at their defaults."""
        chosen = {p.name: p.default if p.null is None else p.null for p in self.problem.parameters}
        values = np.array([chosen[name] for name in self.problem.space.names])
        return np.r_[self.problem.space.to_unit(values), np.full(2 * len(self.events), 0.5)]

    def to_unit(self, name: str, value: float) -> float:
        k = self.column[name]
        return float((value - self.problem.lower[k]) / (self.problem.upper[k] - self.problem.lower[k]))

    def value(self, name: str, unit: np.ndarray) -> float:
        return float(self.problem.space.from_unit(unit[: self.problem.space.dimension])[self.column[name]])

    def width(self, name: str) -> float:
        k = self.column[name]
        return float(self.problem.upper[k] - self.problem.lower[k])

    def sizes(self, names: Sequence[str]) -> list[int]:
        """Columns of the named effects' sizes."""
        return [self.column[p.name] for n in names for p in self.catalogue[n].sizes]

    def parameters(self, names: Sequence[str]) -> list[int]:
        """Columns of all the named effects' parameters."""
        return [self.column[p.name] for n in names for p in self.catalogue[n].effect.parameters]

    def prior_deviation(self, column: int) -> float:
        """Prior standard deviation of a measurement-chain parameter, in the unit cube."""
        for name in self.catalogue.chain:
            for p in self.catalogue[name].sizes:
                if self.column[p.name] == column:
                    return PRIOR * self.catalogue[name].relevant(p) / self.width(p.name)
        raise KeyError(column)

    def residuals(self, unit: np.ndarray) -> np.ndarray:
        """Calculated minus measured (n, 2, N) [pu] at coordinates (n, D)."""
        self.simulations += len(unit)
        return self.likelihood.residuals(unit)

    def rows(self, unit: np.ndarray, noise: Noise, chain: Sequence[int]) -> np.ndarray:
        """Whitened residuals (n, 2 N) and, after them, the prior of the free chain columns."""
        white = noise.whiten(self.residuals(unit), self.problem.drive, self.likelihood.known)
        prior = [(unit[:, k] - self.null[k]) / self.prior_deviation(k) for k in chain]
        return np.concatenate([white, *(p[:, None] for p in prior)], axis=1)

    def refit(
        self,
        noise: Noise,
        wanted: Sequence[tuple[Sequence[str], np.ndarray]],
        chain: Sequence[str] | None = None,
        rough: bool = False,
    ) -> list[Refit]:
        """Fit sets of effects (names, start (D,)) side by side, with the named part of the chain free (all of it).

        Of several starts of one set the best is returned; the result is in order of deviance. A `rough` refit is good
        enough to rank sets that are far apart.
        """
        free_chain = self.catalogue.chain if chain is None else tuple(chain)
        always = [*self.base, *self.before, *self.parameters(free_chain)]
        columns = [[*always, *(k for k in self.parameters(names) if k not in always)] for names, _ in wanted]
        widest = max(map(len, columns))
        table = np.full((len(wanted), widest), self.dimension)
        for lane, free in enumerate(columns):
            table[lane, : len(free)] = free
        starts = np.array([np.r_[start, 0.0] for _, start in wanted])
        prior = self.parameters(free_chain)

        def rows(x: np.ndarray, lanes: np.ndarray) -> np.ndarray:
            whole = starts[lanes]
            np.put_along_axis(whole, table[lanes], x, axis=1)
            return self.rows(whole[:, :-1], noise, prior)

        begin = np.take_along_axis(starts, table, axis=1)
        done = descend(rows, begin, table == self.dimension, *(ROUGH if rough else EXACT))
        np.put_along_axis(starts, table, done.unit, axis=1)
        best: dict[tuple[str, ...], Refit] = {}
        for lane, (names, _) in enumerate(wanted):
            key = tuple(sorted(names))
            if key not in best or done.deviance[lane] < best[key].deviance:
                best[key] = Refit(key, starts[lane, :-1].copy(), float(done.deviance[lane]))
        return sorted(best.values(), key=lambda r: (r.deviance, r.names))

    def base_fit(self) -> tuple[Refit, Noise]:
        """The base model with the chain free, and the noise of its residuals in quiet stretches."""
        noise = self.white()
        fit = self.refit(noise, [((), start) for start in self._base_starts()])[0]
        for _ in range(2):
            noise = self.noise(fit.unit)
            fit = self.refit(noise, [((), fit.unit)])[0]
        return fit, noise

    def _base_starts(self) -> list[np.ndarray]:
        """The best fits of the base model alone, by its own fast kernel, from starts all over its box."""
        likelihood = Likelihood.of(self._alone)
        d = self._alone.space.dimension
        begin = np.full((STARTS + 1, d + len(self.before)), 0.5)
        begin[1:, :d] = np.random.default_rng(0).random((STARTS, d))
        done = descend(likelihood.rows, begin, tolerance=0.1)
        starts = np.tile(self.null, (KEPT, 1))
        best = np.argsort(done.deviance)[:KEPT]
        starts[:, self.base], starts[:, self.before] = done.unit[best, :d], done.unit[best, d:]
        return list(starts)

    def white(self) -> Noise:
        """White noise of the level before the dips: what is known before the first fit."""
        from tractexp.identify.noise import white_noise

        level = [np.sqrt(np.mean([getattr(e, f"noise_{c}") ** 2 for e in self.events])) for c in "PQ"]
        return Noise(np.eye(2), (white_noise(level[0]), white_noise(level[1])))

    def noise(self, unit: np.ndarray) -> Noise:
        """The noise of the quiet residuals at a fit."""
        return estimate(self.residuals(unit[None])[0], self.likelihood.known, self.quiet)
