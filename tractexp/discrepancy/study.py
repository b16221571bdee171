"""One set of coordinates for every candidate, and refits of any subset of them side by side.

Base and extended models are points of the same coordinates with the other candidates at their nulls, nested by
construction. A refit is a lane of the batched descent with its own free columns.
"""

import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from threading import Lock

import numpy as np

from tractexp.discrepancy.catalogue import Catalogue
from tractexp.discrepancy.kernels import Family, Kernels, side_by_side
from tractexp.discrepancy.phasors import Phasors
from tractexp.discrepancy.valleys import best_fits
from tractexp.identification.descent import Apart, descend
from tractexp.identification.likelihood import Likelihood
from tractexp.identification.problem import Problem
from tractexp.model.model import Model
from tractexp.noise.model import Noise, estimate, quiet_stretches
from tractexp.noise.voltage import smoothed
from tractexp.noise.wander import Rest, Wander, find
from tractexp.record import Event

ROUGH, EXACT = (12, 0.3), (40, 0.02)  # iterations and tolerance of the deviance
FIRST = 4  # iterations after which the worse half of a set's starts is given up
HOPELESS, SLOW = 60.0, 0.3  # of the deviance, and of what it spans: a set this far behind then is not refined
PRIOR = 5.0  # smallest relevant sizes: how far the measurement chain is believed to be off, one standard deviation


@dataclass(frozen=True, eq=False)
class Refit:
    """The best fit of one set of effects: coordinates (D,) of the whole study and deviance."""

    names: tuple[str, ...]
    unit: np.ndarray
    deviance: float
    parameters: int  # of the effects

    @property
    def cost(self) -> float:
        """Akaike's criterion, by which sets of the same number of effects are compared: a parameter costs 2."""
        return self.deviance + 2 * self.parameters


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
        self.model, self.catalogue, self.recorded = model, catalogue, tuple(events)
        self.smoothed = [smoothed(event) for event in events]
        self.phasors = model.recorder if isinstance(model.recorder, Phasors) else None
        if self.phasors is not None:
            self.smoothed = [replace(s, event=self.phasors.sharpened(s.event)) for s in self.smoothed]
        self.events = tuple(s.event for s in self.smoothed)
        self.kernels = Kernels(Family(model, catalogue), self.events, bounds, fixed, substeps)
        self.blur: np.ndarray | None = None  # (k, 2, N) pu, once seen; None where the voltage has no noise
        self.problem = self.kernels.whole
        self.likelihood = Likelihood.of(self.problem)
        space = self.problem.space
        self.column = {name: k for k, name in enumerate(space.names)}
        self.base = np.array([self.column[name] for name in self.kernels.bare.space.names])
        self.before = np.arange(space.dimension, space.dimension + 2 * len(events))
        self.dimension = space.dimension + 2 * len(events)
        self.null = self._null()
        self.profile = self._profile()
        self.quiet = quiet_stretches(self.events, self.problem.drive)
        self.simulations, self._counting = 0, Lock()

    def _null(self) -> np.ndarray:
        """Coordinates with every candidate at its null, the base parameters at their defaults."""
        chosen = {p.name: p.default if p.null is None else p.null for p in self.problem.parameters}
        values = np.array([chosen[name] for name in self.problem.space.names])
        return np.r_[self.problem.space.to_unit(values), np.full(2 * len(self.events), 0.5)]

    def _profile(self) -> np.ndarray:
        """Apparent power over that before each event, (N,)."""
        drive = self.problem.drive
        before = np.repeat(np.linalg.norm(drive.before, axis=1), np.diff(drive.first))
        return np.linalg.norm(drive.measured, axis=0) / np.maximum(before, 1e-9)

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

    def residuals(self, unit: np.ndarray, names: Sequence[str] | None = None, pushed: bool = False) -> np.ndarray:
        """Calculated minus measured (n, 2, N) [pu] at coordinates (n, D) where effects but `names` are at their null.

        By default any effect and any push may be there, at the price of the largest kernel.
        """
        with self._counting:
            self.simulations += len(unit)
        key = None if names is None else self.kernels.family.key(names, pushed)
        return side_by_side(lambda part: self.kernels.residuals(key, part), unit)

    def residuals_of(self, unit: np.ndarray, sets: Sequence[tuple[Sequence[str], bool]]) -> np.ndarray:
        """As `residuals`, with a set of names for each of the coordinates, and whether a push is in it."""
        keys = [self.kernels.family.key(names, pushed) for names, pushed in sets]
        made = np.empty((len(unit), 2, self.problem.drive.samples))
        for key in dict.fromkeys(keys):
            mine = np.array([k == key for k in keys])
            first = sets[keys.index(key)]
            made[mine] = self.residuals(unit[mine], *first)
        return made

    def rows(self, unit: np.ndarray, noise: Noise, chain: Sequence[int], sets: Sequence[Sequence[str]]) -> np.ndarray:
        """Whitened residuals (n, 2 N) of coordinates with a set of names each, then the prior of the free chain."""
        raw = self.residuals_of(unit, [(names, False) for names in sets])
        white = side_by_side(lambda part: noise.whiten(part, self.problem.drive, self.likelihood.known), raw)
        prior = [(unit[:, k] - self.null[k]) / self.prior_deviation(k) for k in chain]
        return np.concatenate([white, *(p[:, None] for p in prior)], axis=1)

    def refit(
        self, noise: Noise, wanted: Sequence[tuple[Sequence[str], np.ndarray]], chain: Sequence[str] | None = None
    ) -> list[Refit]:
        """Fit sets of effects (names, start (D,)) side by side, with the named part of the chain free (all of it).

        Of several starts of one set the best is returned; the result is in order of cost.
        """
        return self.best(self._descended(noise, wanted, chain, EXACT))

    def rough_refit(self, noise: Noise, wanted: Sequence[tuple[Sequence[str], np.ndarray]]) -> list[Refit]:
        """As `refit`, good enough to rank sets that are far apart; what falls behind early is given up."""
        begun = self._descended(noise, wanted, None, (FIRST, ROUGH[1]))
        best = self.best(begun)
        far = max(HOPELESS, SLOW * (best[-1].cost - best[0].cost))
        promising = [r.names for r in best if r.cost <= best[0].cost + far]
        again = []
        for names in promising:
            starts = sorted((r for r in begun if r.names == names), key=lambda r: r.deviance)
            again += [(names, r.unit) for r in starts[: -(-len(starts) // 2)]]
        return self.best([*best, *self._descended(noise, again, None, (ROUGH[0] - FIRST, ROUGH[1]))])

    @staticmethod
    def best(fits: Iterable[Refit]) -> list[Refit]:
        """The best fit of each set, in order of cost."""
        best: dict[tuple[str, ...], Refit] = {}
        for fit in sorted(fits, key=lambda r: (r.cost, r.names)):
            best.setdefault(fit.names, fit)
        return list(best.values())

    def _descended(
        self, noise: Noise, wanted: Sequence[tuple[Sequence[str], np.ndarray]], chain: Sequence[str] | None,
        effort: tuple[int, float],
    ) -> list[Refit]:  # fmt: skip
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
            return self.rows(whole[:, :-1], noise, prior, [wanted[lane][0] for lane in lanes])

        begin = np.take_along_axis(starts, table, axis=1)
        done = descend(rows, begin, table == self.dimension, *effort, self._apart(len(prior)))
        np.put_along_axis(starts, table, done.unit, axis=1)
        return [
            Refit(
                tuple(sorted(names)), starts[lane, :-1].copy(), float(done.deviance[lane]), len(self.parameters(names))
            )
            for lane, (names, _) in enumerate(wanted)
        ]

    def _apart(self, more: int) -> list[Apart]:
        """P0 and Q0 act on the rows of their own event only; `more` rows follow those of the records."""
        events, N = len(self.events), self.problem.drive.samples
        rows = np.zeros((events, 2 * N + more), dtype=bool)
        for e in range(events):
            part = self.problem.drive.part(e)
            rows[e, part] = rows[e, N + part.start : N + part.stop] = True
        return [Apart(len(self.base) + np.arange(events) * 2 + c, rows) for c in (0, 1)]

    def base_fit(self, starts: Sequence[np.ndarray] = ()) -> tuple[Refit, Noise]:
        """The base model with the chain free, and the noise of its residuals in quiet stretches.

        `starts` (D,) save the search of the whole box.
        """
        noise = self.white()
        fit = self.refit(noise, [((), start) for start in starts or self.starts])[0]
        for _ in range(2):
            noise = self.noise(fit.unit)
            fit = self.refit(noise, [((), fit.unit)])[0]
        return fit, noise

    @functools.cached_property
    def starts(self) -> list[np.ndarray]:
        """The best fits (D,) of the base model alone, by its own fast kernel."""
        found = best_fits(self.kernels.bare, self._apart(0))
        starts = np.tile(self.null, (len(found), 1))
        starts[:, [*self.base, *self.before]] = found
        return list(starts)

    def valleys_but(self, unit: np.ndarray) -> list[np.ndarray]:
        """The best fits of the base model but the one nearest to coordinates (D,)."""
        far = [float(np.linalg.norm((start - unit)[self.base])) for start in self.starts]
        return [start for start, distance in zip(self.starts, far, strict=True) if distance > min(far)]

    def white(self) -> Noise:
        """White noise of the level before the dips: what is known before the first fit."""
        from tractexp.noise.color import white_noise

        level = [np.sqrt(np.mean([getattr(e, f"noise_{c}") ** 2 for e in self.events])) for c in "PQ"]
        return Noise(np.eye(2), (white_noise(level[0]), white_noise(level[1])))

    def noise(self, unit: np.ndarray) -> Noise:
        """The noise of the quiet residuals at a fit."""
        self.see_blur(unit)
        return self.noise_in(self.residuals(unit[None])[0])

    def noise_in(
        self, residual: np.ndarray, left: np.ndarray | None = None, columns: np.ndarray | None = None
    ) -> Noise:
        """The noise of one residual (2, N) in quiet stretches.

        What a fit leaves (2, N), and columns of all that could explain it (k, 2, N), tell more of how the load wanders.
        """
        wander = functools.partial(self._wander, left, columns)
        return estimate(residual, self.likelihood.known, self.quiet, wander, self.blur)

    def _wander(self, left: np.ndarray | None, columns: np.ndarray | None, mix: np.ndarray) -> Wander | None:
        """How the load wanders before the events and during them, in mixed channels."""
        drive = self.problem.drive
        before = [drive.measured[:, drive.part(e)][:, event.steady] for e, event in enumerate(self.events)]
        rests = []
        if left is not None and columns is not None and self.likelihood.known.all():
            rests = [
                Rest(mix @ left[:, part], np.einsum("ij,kjt->kit", mix, columns[:, :, part]), self.profile[part])
                for part in map(drive.part, range(drive.events))
            ]
        step = self.events[0].record.step
        return find([mix @ b for b in before if np.isfinite(b).all()], step, self.profile, rests)

    def see_blur(self, unit: np.ndarray) -> None:
        """Find out once, at a fit, what errors of the voltage do to the power of the base model."""
        most = max(len(s.errors) for s in self.smoothed)
        if self.blur is not None or not most:
            return
        calm = self.at_voltage(self.events, unit)
        off = [self.at_voltage([s.off_by(k) for s in self.smoothed], unit) - calm for k in range(most)]
        self.blur = np.nan_to_num(np.array(off))

    def at_voltage(self, events: Sequence[Event], unit: np.ndarray) -> np.ndarray:
        """Residuals (2, N) of the base model at coordinates (D,), driven by the voltages of other events."""
        problem = Problem(self.model, events, self.kernels.bounds, self.kernels.fixed, self.kernels.substeps)
        return Likelihood.of(problem).residuals(np.r_[unit[self.base], unit[self.before]][None])[0]
