"""What the parts of the page are made of, each measured when first asked for."""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tractexp.comparison.statistics import expected_running_time, vargha_delaney, wilcoxon
from tractexp.errors import UserError
from tractexp.identification.problem import Problem
from tractexp.identification.result import Fit, respond
from tractexp.identification.search import Found, Limits
from tractexp.record import Event
from tractexp.replication import equations, maps, orders, printed, searches

ALPHAS = (0.1, 0.3, 0.5, 0.7, 0.9)  # of the tent map
TARGETS = (10.0, 2.0)  # of running times, times the floor
AT_FLOOR = 1.1  # a search within so many times the floor has found it
SAME_VALLEY = 1.02  # descents that end within so many times of each other are in one valley
DESCENT = 1e-3  # of the floor: a descent's step that gains less ends it


@dataclass(frozen=True)
class Pair:
    """One optimizer against another over paired seeds: two-sided p of Wilcoxon's test, and the Vargha-Delaney A."""

    first: str
    second: str
    p: float
    A: float


@dataclass(frozen=True, eq=False)
class Study:
    """The paper's experiments on one fitted event and those held out; `recipe` makes the identification problem."""

    recipe: Callable[[], Problem]
    node: Mapping[str, Any]  # the model's configuration
    train: Sequence[Event]
    held_out: Sequence[Event]
    seeds: int
    seed: int = 0
    workers: int | None = None
    limits: Limits | None = None  # on each search, beside the 300 iterations
    tell: Callable[[str], None] = lambda line: None
    count: Callable[[int, int], None] = lambda done, total: None

    @functools.cached_property
    def problem(self) -> Problem:
        return self.recipe()

    @functools.cached_property
    def orders(self) -> dict[str, orders.Order]:
        """Table 1."""
        self.tell("Table 1: fitting three orders of the motor")
        return {m: orders.fit(self.node, m, self.train, self.held_out, self.seed) for m in printed.TABLE_1}

    @functools.cached_property
    def reference(self) -> Found:
        """The lowest objective known: least squares from many starts."""
        name = "multistart_least_squares"
        return searches.run(self.recipe, {name: {"name": name}}, 1, workers=1)[name][0]

    @functools.cached_property
    def compared(self) -> dict[str, list[Found]]:
        """Tables 3 to 5: the three optimizers at the paper's settings."""
        return self._searched(printed.COMPARED, self.seeds)

    def searched(self, name: str) -> list[Found]:
        """The searches of one of the three, which need not those of the others."""
        return self.compared[name] if "compared" in vars(self) else self._searched((name,), self.seeds)[name]

    def first(self, name: str) -> list[Fit]:
        """The one run that the paper's figures show, seed 0: the fits of the fitted events, then of those held out."""
        found = self.compared[name] if "compared" in vars(self) else self._searched((name,), 1)[name]
        return self.respond(found[0].values)

    def _searched(self, names: Sequence[str], seeds: int) -> dict[str, list[Found]]:
        several = f"{seeds} seeds" if seeds > 1 else "seed 0"
        self.tell(f"searches of {', '.join(names)}: {several}, 300 iterations of 50")
        return self._run({name: {"name": name} for name in names}, seeds)

    @functools.cached_property
    def readings(self) -> dict[str, dict[str, list[Found]]]:
        """{reading: {optimizer: searches}} of what the text leaves open; the default is that of the tables."""
        self.tell("section 5: the readings of the text")
        both = {(r, n): {"name": n, **s} for r, s in printed.READINGS.items() for n in ("ssa", "issa") if s}
        alone = {(r, "issa"): {"name": "issa", **s} for r, s in printed.ISSA_READINGS.items()}
        found = self._run({f"{n}: {r}": s for (r, n), s in (both | alone).items()})
        made: dict[str, dict[str, list[Found]]] = {r: {} for r in (*printed.READINGS, *printed.ISSA_READINGS)}
        made[next(iter(printed.READINGS))] = {n: self.compared[n] for n in ("ssa", "issa")}
        for r, n in both | alone:
            made[r][n] = found[f"{n}: {r}"]
        return made

    @functools.cached_property
    def ablations(self) -> dict[str, list[Found]]:
        """ISSA without one of its ingredients, {ingredient: searches}."""
        self.tell("section 5: ISSA without each of its ingredients")
        return self._run({key: {"name": "issa", key: False} for key in printed.INGREDIENTS})

    def _run(self, variants: Mapping[str, Mapping[str, Any]], seeds: int | None = None) -> dict[str, list[Found]]:
        seeds = seeds or self.seeds
        return searches.run(
            self.recipe, variants, seeds, self.limits, self.workers, self.count, note=self.tell
        )  # fmt: skip

    @functools.cached_property
    def equal(self) -> int:
        """The simulations at which searches are compared: what the thriftiest of the three spends."""
        return min(found.simulations for several in self.compared.values() for found in several)

    @functools.cached_property
    def floor(self) -> float:
        """The lowest objective of all searches of this problem [pu²]."""
        return min(self.reference.objective, *(f.objective for several in self.compared.values() for f in several))

    def objectives(self, name: str, by: str) -> np.ndarray:
        """(seeds,) at the end of all "iterations", or where an equal number of "simulations" is spent."""
        found = self.searched(name)
        return np.array([f.objective if by == "iterations" else searches.best_at(f, self.equal) for f in found])

    def pair(self, first: str, second: str, by: str) -> Pair:
        a, b = self.objectives(first, by), self.objectives(second, by)
        return Pair(first, second, wilcoxon(a, b)[0], vargha_delaney(a, b))

    def running_time(self, name: str, target: float, cost: str) -> float:
        """Expected "iterations" or "simulations" to `target` times the floor."""
        spent, reached = [], []
        for found in self.compared[name]:
            hit = found.history.objective <= target * self.floor
            at = int(hit.argmax()) if hit.any() else -1
            spent.append(range(len(hit))[at] if cost == "iterations" else int(found.history.simulations[at]))
            reached.append(bool(hit.any()))
        return expected_running_time(np.array(spent), np.array(reached))

    @functools.cached_property
    def descents(self) -> dict[str, Any]:
        """{optimizer: the `Descent` by least squares from where each seed's search ended}; squares are objectives.

        Where that reaches the floor, the search was not caught in a local optimum: it was not done.
        """
        from tractexp.identification.descent import descend

        space, scale = self.problem.space, 1 / np.sqrt(DESCENT * self.floor)

        def rows(unit: np.ndarray, lanes: np.ndarray) -> np.ndarray:
            return scale * self.problem.residuals(space.from_unit(unit))

        made = {}
        for name, found in self.compared.items():
            ends = descend(rows, np.array([space.to_unit(f.values) for f in found]), iterations=200, tolerance=1e-3)
            made[name] = replace(ends, deviance=ends.deviance / scale**2)
        return made

    def valleys(self) -> list[tuple[float, int, np.ndarray]]:
        """Where the descents of all optimizers end: objective, how many, and the values (free,), the lowest first."""
        objectives = np.concatenate([d.deviance for d in self.descents.values()])
        units = np.concatenate([d.unit for d in self.descents.values()])
        left, found = np.argsort(objectives), []
        while len(left):
            same = objectives[left] <= SAME_VALLEY * objectives[left[0]]
            values = self.problem.space.from_unit(units[left[0]])
            found.append((float(objectives[left[0]]), int(np.count_nonzero(same)), values))
            left = left[~same]
        return found

    def found_floor(self, objectives: np.ndarray) -> float:
        """The share of objectives (n,) at the floor."""
        return float(np.mean(objectives <= AT_FLOOR * self.floor))

    @functools.cached_property
    def fitted(self) -> dict[str, list[list[Fit]]]:
        """{optimizer: for each seed the fits of the fitted events, then of those held out}."""
        return {name: self.fits(name) for name in self.compared}

    def fits(self, name: str) -> list[list[Fit]]:
        """Those of one optimizer."""
        return [self.respond(found.values) for found in self.searched(name)]

    def respond(self, values: np.ndarray) -> list[Fit]:
        """All events, played through the model with free `values`."""
        whole = self.problem.full(values)[0]
        roles = ["train"] * len(self.train) + ["validate"] * len(self.held_out)
        events = (*self.train, *self.held_out)
        return [respond(self.problem.model, whole, e, role) for e, role in zip(events, roles, strict=True)]

    def held(self, kind: str) -> list[int]:
        """Which of `fitted` are the held-out events of an "interpolation" or "extrapolation"."""
        kinds = searches.by_depth(self.held_out, self.train)
        chosen = [len(self.train) + k for k, each in enumerate(kinds) if each == kind]
        if not chosen:
            which = "no deeper" if kind == "interpolation" else "deeper"
            raise UserError(
                f"there is no held-out event for the {kind}: a dip {which} than the fitted one is needed;"
                " name one in data.validate, or leave the table out with task.parts"
            )
        return chosen

    def residuals(self, kind: str) -> dict[str, np.ndarray]:
        """Eq. (21) of P and Q, {optimizer: (seeds, 2)} [pu], a mean over the held-out events of one kind."""
        events = self.held(kind)
        return {
            name: np.array(
                [
                    [np.mean([searches.mean_residual(getattr(fits[e].event.record, c), getattr(fits[e], c))
                              for e in events]) for c in "PQ"]
                    for fits in several
                ]
            )
            for name, several in self.fitted.items()
        }  # fmt: skip

    @functools.cached_property
    def uniformity(self) -> dict[str, dict[str, np.ndarray]]:
        """{"50 points in 7 dimensions": {way: discrepancies}}."""
        self.tell("Figures 3 and 4: maps and flights")
        n, d = printed.POPULATION, len(printed.NAMES)
        return {f"{n} points in {k} dimensions": dict(maps.discrepancies(n, k, ALPHAS)) for k in (d, 2)}

    @functools.cached_property
    def tails(self) -> dict[str, np.ndarray]:
        """Lévy steps of Eq. (15), {formula: (n,)}."""
        return {formula: maps.flights(formula, maps.STEPS, 1)[:, 0] for formula in ("mantegna", "printed")}

    @functools.cached_property
    def bias(self) -> dict[str, tuple[float, float]]:
        self.tell("section 5: the bias toward zero")
        return equations.bias()
