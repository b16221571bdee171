"""What the parts of the page are made of, each measured when first asked for."""

import functools
import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from tractexp.errors import DATA, TASK, UserError
from tractexp.identification.fit import Fit, respond
from tractexp.identification.generalization import compare_depths, compute_mean_residual
from tractexp.identification.search import Limits, SearchResult
from tractexp.inference.problem import Problem
from tractexp.record import Event
from tractexp.studies import searches
from tractexp.studies.comparison.statistics import (
    compute_expected_running_time,
    compute_vargha_delaney,
    run_wilcoxon_test,
)
from tractexp.studies.paper import equations, maps, orders, printed, valleys
from tractexp.studies.paper.printed import COMPARED, EQUAL, ITERATIONS, LITERAL, READINGS, TEN
from tractexp.studies.search_store import SearchStore

ALPHAS = (0.1, 0.3, 0.5, 0.7, 0.9)  # of the tent map
TARGETS = (10.0, 2.0)  # of running times, times the floor
# a search within so many times the floor has found it; one so near the bottom of its valley is done
FLOOR_FACTOR = 1.1
RANDOM = 200  # points from which the control descends
TRADED = "C"  # the parameter along which the valleys lie
# other bounds of it; below the first X' meets its own bound
WIDE, NARROW = (0.06, 0.99), (0.75, 0.99)
BUDGETS = ("iterations", "simulations")  # by which searches are compared
# the readings that search one objective, by 300 iterations
LEVEL = (*COMPARED, *TEN.values(), "pso_limited")
EQUALLY = ("issa", "ssa", *TEN.values())  # those whose searches are made anew at equal simulations

# The searches that each part shows, {by what they end: readings}.
SHOWN: Mapping[str, Mapping[str, Sequence[str]]] = {
    "table2": {"iterations": ("issa", TEN["issa"], LITERAL["issa"])},
    "table3": {"iterations": (*LEVEL, *LITERAL.values()), "simulations": EQUALLY},
    "table4": {"iterations": (*COMPARED, *TEN.values())},
    "table5": {"iterations": (*COMPARED, *TEN.values())},
    "figure9": {"iterations": (*LEVEL, "random_search"), "simulations": EQUALLY},
    "readings": {"iterations": tuple(name for name in READINGS if name != "random_search")},
}


@dataclass(frozen=True)
class OptimizerPair:
    """One optimizer against another over paired seeds: two-sided p of Wilcoxon's test, and the
    Vargha-Delaney A.
    """

    p: float
    A: float


@dataclass(frozen=True)
class Shares:
    """How many of n searches reached what."""

    n: int
    valley: int  # least squares from where it ended reach the lowest objective
    floor: int  # it is there
    done: int  # it is at the bottom of its own valley, whichever that is


@dataclass(frozen=True, eq=False)
class Study:
    """The paper's experiments on one fitted event and those held out; `recipe` makes the
    identification problem.

    `literal` makes the same problem with the model integrated by Eq. (4) as printed.
    """

    recipe: Callable[[], Problem]
    node: Mapping[str, Any]  # the model's configuration
    train: Sequence[Event]
    held_out: Sequence[Event]
    seeds: int
    seed: int = 0
    workers: int | None = None
    limits: Limits | None = None  # on each search, beside the 300 iterations
    literal: Callable[[], Problem] | None = None
    tell: Callable[[str], None] = lambda line: None
    count: Callable[[int, int], None] = lambda done, total: None
    # by reading and budget
    seen: dict[tuple[str, str], list[SearchResult]] = field(default_factory=dict)

    @functools.cached_property
    def problem(self) -> Problem:
        """The problem with the usual integration."""
        return self.recipe()

    @functools.cached_property
    def printed_problem(self) -> Problem:
        """The problem with the integration as printed."""
        assert self.literal is not None
        return self.literal()

    @functools.cached_property
    def orders(self) -> dict[str, orders.Order]:
        """Three orders of the motor, fitted."""
        self.tell("Table 1: fitting three orders of the motor")
        return {
            m: orders.fit(self.node, m, self.train, self.held_out, self.seed)
            for m in printed.TABLE_1
        }

    @functools.cached_property
    def reference(self) -> SearchResult:
        """The lowest objective known: least squares from many starts."""
        name = "multistart_least_squares"
        return searches.run(self.recipe, {name: {"name": name}}, 1, workers=1)[name][0]

    def prepare(self, parts: Sequence[str]) -> None:
        """Make all searches that the parts show, so that they are told of together."""
        for by in BUDGETS:
            wanted = dict.fromkeys(
                name for part in parts for name in SHOWN.get(part, {}).get(by, ())
            )
            self._gather([name for name in wanted if (name, by) not in self.seen], by)

    def run_searches(self, name: str, by: str = "iterations") -> list[SearchResult]:
        """The searches of a reading, one for each seed: of 300 "iterations", or laid out for equal
        "simulations".
        """
        if by == "simulations" and READINGS[name].optimizer == "pso":
            by = "iterations"  # its 300 iterations are what is equal
        if (name, by) not in self.seen:
            self._gather([name], by)
        return self.seen[name, by]

    def first(self, name: str) -> list[Fit]:
        """The one run that the paper's figures show, seed 0: the fits of the fitted events, then of
        those held out.
        """
        results = self.seen.get((name, "iterations"))
        return self.respond(results[0] if results else self._run([name], "iterations", 1)[name][0])

    def _gather(self, names: Sequence[str], by: str) -> None:
        """Search with these optimizers, those read literally on the printed problem."""
        for literal in (False, True):
            chosen = [name for name in names if READINGS[name].literal == literal]
            if chosen:
                results = self._run(chosen, by, self.seeds)
                self.seen.update({(name, by): several for name, several in results.items()})

    def _run(self, names: Sequence[str], by: str, seeds: int) -> dict[str, list[SearchResult]]:
        """Search with readings that all search the same problem."""
        several = f"{seeds} seeds" if seeds > 1 else "seed 0"
        limits = self.limits or Limits()
        ends = f"{ITERATIONS} iterations" if by == "iterations" else f"{self.equal:,} simulations"
        own = {"iterations": ITERATIONS} if by == "iterations" else {}
        if by == "simulations":
            limits = replace(limits, simulations=self.equal)
        literal = READINGS[names[0]].literal
        self.tell(f"searches of {', '.join(names)}: {several}, {ends} of {printed.POPULATION}")
        recipe = self.literal if literal and self.literal else self.recipe
        variants = {name: READINGS[name].node | own for name in names}
        return searches.run(
            recipe, variants, seeds, limits, self.workers, self.count, note=self.tell
        )

    @property
    def equal(self) -> int:
        """The simulations at which searches are compared: what PSO, the thriftiest of the three,
        spends.
        """
        most = self.limits.simulations if self.limits else None
        return min(EQUAL, most or EQUAL)

    @functools.cached_property
    def floor(self) -> float:
        """The lowest objective known of this problem [pu²]."""
        compared = [f.objective for name in COMPARED for f in self.run_searches(name)]
        return min(self.reference.objective, *compared)

    def objectives(self, name: str, by: str = "iterations") -> np.ndarray:
        """(seeds,) where the searches end."""
        return np.array([search.objective for search in self.run_searches(name, by)])

    def pair(self, first: str, second: str, by: str) -> OptimizerPair:
        """The test of two optimizers, p and Vargha and Delaney's A."""
        a, b = self.objectives(first, by), self.objectives(second, by)
        return OptimizerPair(run_wilcoxon_test(a, b)[0], compute_vargha_delaney(a, b))

    def spent(self, name: str, target: float, by: str) -> tuple[np.ndarray, np.ndarray]:
        """The cost of each search until `target` times the floor or in all (seeds,), and whether it
        got there.
        """
        spent, reached = [], []
        for search in self.run_searches(name, by):
            hit = search.history.objective <= target * self.floor
            at = int(hit.argmax()) if hit.any() else -1
            spent.append(
                range(len(hit))[at] if by == "iterations" else int(search.history.simulations[at])
            )
            reached.append(bool(hit.any()))
        return np.array(spent), np.array(reached)

    def running_time(self, name: str, target: float, by: str) -> float:
        """Expected "iterations" or "simulations" to `target` times the floor."""
        return compute_expected_running_time(*self.spent(name, target, by))

    @functools.cached_property
    def ends(self) -> dict[str, valleys.Ends]:
        """{reading: where least squares lead from the end of each seed's search}.

        Where that reaches the floor, the search was not caught in a local optimum: it was not done.
        """
        self.tell("Figure 9: descending from where the searches ended, and from random points")
        names = (*LEVEL, "random_search")
        starts = np.array([search.values for name in names for search in self.run_searches(name)])
        ends = self._descents(
            self.problem, starts, lambda: valleys.run_descents(self.problem, starts, self.floor)
        )
        parts = {name: slice(k * self.seeds, (k + 1) * self.seeds) for k, name in enumerate(names)}
        return {
            name: valleys.Ends(ends.objective[part], ends.values[part])
            for name, part in parts.items()
        }

    def random_ends(self, problem: Problem) -> valleys.Ends:
        """The control: where least squares lead from random points of the bounds."""
        points = valleys.draw_uniform_points(problem, RANDOM, self.seed)
        return self._descents(
            problem, points, lambda: valleys.run_descents(problem, points, self.floor)
        )

    def _descents(
        self, problem: Problem, starts: np.ndarray, descend: Callable[[], valleys.Ends]
    ) -> valleys.Ends:
        """Where descents from these starts (n, free) end, read back where the same code made them
        before.
        """
        text = f"descents {self.floor!r} {hashlib.sha256(starts.tobytes()).hexdigest()}"

        def compute() -> tuple[np.ndarray, ...]:
            ends = descend()
            return ends.objective, ends.values

        return valleys.Ends(*SearchStore(problem, Limits()).arrays(text, compute))

    @functools.cached_property
    def control(self) -> valleys.Ends:
        """Where descents from random points end."""
        return self.random_ends(self.problem)

    def above_bottom(self, name: str) -> np.ndarray:
        """(seeds,) where the searches of a reading end, over the bottom of the valley that each is
        in.
        """
        return self.objectives(name) / self.ends[name].objective

    def shares(self, name: str) -> Shares:
        """How often a search ends at the floor and in its valley."""
        at, bottom = self.objectives(name), self.ends[name].objective
        counts = (
            bottom <= FLOOR_FACTOR * self.floor,
            at <= FLOOR_FACTOR * self.floor,
            at <= FLOOR_FACTOR * bottom,
        )
        return Shares(self.seeds, *(int(np.count_nonzero(count)) for count in counts))

    @property
    def control_shares(self) -> Shares:
        """How often random points do."""
        there = int(np.count_nonzero(self.control.objective <= FLOOR_FACTOR * self.floor))
        return Shares(RANDOM, there, 0, 0)

    @property
    def has_traded_parameter(self) -> bool:
        """Whether the model has the parameter along which the paper's valleys lie, and leaves it
        free.
        """
        return TRADED in self.problem.space.names and not self.problem.per_event

    @functools.cached_property
    def path(self) -> tuple[np.ndarray, valleys.Ends]:
        """Values of C beyond its bounds, and the best fit at each."""
        wide = valleys.rebound_problem(self.problem, TRADED, *WIDE)
        grid = np.linspace(*WIDE, 63)
        low = np.array([values for _, _, values in self.control.group_valleys()[:2]])
        return grid, self._descents(
            wide, low, lambda: valleys.follow_valley(wide, low, TRADED, grid, self.floor)
        )

    @functools.cached_property
    def ends_by_bounds(self) -> dict[tuple[float, float], valleys.Ends]:
        """{bounds of C: where random points descend within them}."""
        own = next(p.bounds for p in self.problem.parameters if p.name == TRADED)
        others = {
            bounds: self.random_ends(valleys.rebound_problem(self.problem, TRADED, *bounds))
            for bounds in (WIDE, NARROW)
        }
        return {own: self.control, **others}

    @functools.cached_property
    def _fits(self) -> dict[str, list[list[Fit]]]:
        """The fits of each search to the dips, made when asked for."""
        return {}

    def fits(self, name: str) -> list[list[Fit]]:
        """For each seed of a reading the fits of the fitted events, then of those held out."""
        if name not in self._fits:
            literal = READINGS[name].literal
            self._fits[name] = [self.respond(search, literal) for search in self.run_searches(name)]
        return self._fits[name]

    def respond(self, search: SearchResult, literal: bool = False) -> list[Fit]:
        """All events, played through the model with what a search ended at."""
        problem = self.printed_problem if literal and self.literal else self.problem
        whole = problem.full(search.values)[0]
        roles = ["train"] * len(self.train) + ["validate"] * len(self.held_out)
        events = (*self.train, *self.held_out)
        return [
            respond(problem.model, whole, e, role) for e, role in zip(events, roles, strict=True)
        ]

    def select_held_out(self, kind: str) -> list[int]:
        """Which of `fitted` are the held-out events of an "interpolation" or "extrapolation"."""
        kinds = compare_depths(self.held_out, self.train)
        chosen = [len(self.train) + k for k, each in enumerate(kinds) if each == kind]
        if not chosen:
            which = "no deeper" if kind == "interpolation" else "deeper"
            raise UserError(
                f"there is no held-out event for the {kind}: a dip {which} than the fitted one is"
                f" needed; name one in {DATA.validate}, or leave the table out with {TASK.parts}"
            )
        return chosen

    def residuals(self, kind: str) -> dict[str, np.ndarray]:
        """Eq. (21) of P and Q, {reading: (seeds, 2)} [pu], a mean over the held-out events of one
        kind.
        """
        events = self.select_held_out(kind)

        def residual(fits: list[Fit], channel: str) -> float:
            each = [
                (getattr(fits[e].event.record, channel), getattr(fits[e], channel)) for e in events
            ]
            return float(np.mean([compute_mean_residual(*powers) for powers in each]))

        names = (*COMPARED, *TEN.values())
        return {
            name: np.array([[residual(fits, c) for c in "PQ"] for fits in self.fits(name)])
            for name in names
        }

    @functools.cached_property
    def uniformity(self) -> dict[str, dict[str, np.ndarray]]:
        """{"50 points in 7 dimensions": {way: discrepancies}}."""
        self.tell("Figures 3 and 4: maps and flights")
        n, d = printed.POPULATION, len(printed.NAMES)
        return {
            f"{n} points in {k} dimensions": dict(maps.measure_discrepancies(n, k, ALPHAS))
            for k in (d, 2)
        }

    @functools.cached_property
    def tails(self) -> dict[str, np.ndarray]:
        """Lévy steps of Eq. (15), {formula: (n,)}."""
        return maps.draw_tails()

    @functools.cached_property
    def bias(self) -> dict[str, tuple[float, float]]:
        """How far searches are drawn to zero."""
        self.tell("section 5: the bias toward zero")
        return equations.measure_bias()
