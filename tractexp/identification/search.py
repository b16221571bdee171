"""The one search loop: it clips, evaluates, keeps the best, counts, enforces the budget and records
the history.

No optimizer does any of this, so none can misreport, and all are compared by the same count of
simulations.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tractexp.errors import Stopped, UserError
from tractexp.identification.optimizer import REFUSED, Box, Optimizer
from tractexp.identification.polish import Elite, polish

UNKNOWN = 1e30  # stands for an objective that is not a finite number: worse than any miss
# least-squares steps, of d + 2 simulations, that a budget keeps back for the polish,
POLISH_STEPS = 450
POLISH_SHARE = 2 / 3  # but never more than this share of it


class Objective(Protocol):
    """A problem in the unit cube: what an identification or a benchmark function offers."""

    lower: np.ndarray  # (d,) raw bounds
    upper: np.ndarray  # (d,)

    def objective(self, values: np.ndarray) -> np.ndarray:
        """Raw values (n, d) -> objectives (n,); `REFUSED` plus a measure of the miss where there is
        none.
        """
        ...

    def residuals(self, values: np.ndarray) -> np.ndarray:
        """Raw values (n, d) -> residuals (n, m), nan in the rows that cannot be simulated."""
        ...


@dataclass(frozen=True)
class Limits:
    """When a search ends, beside its own end; None: no such limit.

    Attributes
    ----------
    simulations : int or None
        The budget.
    seconds : float or None [s]
        The time.
    target : float or None
        The objective at which nothing is left to search for.
    """

    simulations: int | None = None
    seconds: float | None = None
    target: float | None = None  # objective


@dataclass(frozen=True)
class History:
    """The course of a search, one row an iteration.

    Attributes
    ----------
    simulations : (n,) ints
        Spent by the end of each iteration.
    objective : (n,)
        The best so far.
    values : (n, d)
        Where that is, in physical units.
    seconds : (n,)
        Since the search began.
    """

    simulations: np.ndarray  # simulations spent by the end of the iteration
    objective: np.ndarray  # best so far
    values: np.ndarray  # where
    seconds: np.ndarray


@dataclass(frozen=True)
class SearchResult:
    """What a search found.

    Attributes
    ----------
    values : (d,)
        The best point, in physical units.
    objective : float
        There.
    simulations, refused, iterations : int
        Simulations made, those of them that could not be made, and iterations.
    seconds : float
        How long it took.
    status : str
        The sentence that says why it ended.
    history : History
        Its course.
    """

    values: np.ndarray  # (d,) raw
    objective: float
    simulations: int
    refused: int
    iterations: int
    seconds: float
    status: str
    history: History


class _Stop(Exception):
    """A limit is reached; the message is the status sentence."""


class _Reached(_Stop):
    """The target is reached: there is nothing left to polish."""


class _Counter:
    """The batch objective handed to an optimizer, in that optimizer's own box."""

    def __init__(self, problem: Objective, unit: bool, limits: Limits):
        """Count what a search asks of a problem, in the unit cube or in the parameters' own units,
        within limits.
        """
        self.problem, self.unit, self.limits = problem, unit, limits
        d = len(problem.lower)
        self.raw = Box(problem.lower, problem.upper)
        self.box = Box.unit(d) if unit else self.raw
        self.simulations = self.refused = 0
        self.best = np.inf
        self.best_values = np.full(d, np.nan)
        self.elite: Elite | None = None
        self.started = time.perf_counter()

    @property
    def seconds(self) -> float:
        """How long the search has taken [s]."""
        return time.perf_counter() - self.started

    @property
    def budget(self) -> int | None:
        """The simulations that it may make; None: any number."""
        return self.limits.simulations

    def _admit(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
        """The points that a limit still allows, clipped; these in physical units; and how many were
        cut off.

        Raises `_Stop` where a limit allows none.
        """
        limits = self.limits
        if limits.seconds is not None and self.seconds >= limits.seconds:
            raise _Stop(f"stopped at the time limit of {limits.seconds:g} s")
        x = self.box.clip(np.atleast_2d(x))
        if np.isnan(x).any():
            raise UserError(
                "the optimizer proposed a point that is not a number; this is a fault of its plugin"
            )
        asked = len(x)
        if limits.simulations is not None:
            remaining = limits.simulations - self.simulations
            if remaining <= 0:
                raise _Stop(f"stopped at the budget of {limits.simulations} simulations")
            x = x[:remaining]
        return x, self.raw.from_unit(x) if self.unit else x, asked - len(x)

    def _note(self, x: np.ndarray, raw: np.ndarray, f: np.ndarray, cut: int) -> None:
        """Count evaluated points `x` (n, d) with objectives `f` (n,), keep the best, and stop the
        search at its target or where `cut` points found no room in the budget.
        """
        self.simulations += len(f)
        self.refused += int(np.count_nonzero(f >= REFUSED))
        first = int(np.argmin(f))
        if f[first] < self.best:
            self.best = float(f[first])
            self.best_values = raw[first].copy()
        if self.elite is not None:
            self.elite.add(x, f)
        if self.limits.target is not None and self.best <= self.limits.target:
            raise _Reached(f"reached the target objective {self.limits.target:g}")
        if cut:
            raise _Stop(f"stopped at the budget of {self.limits.simulations} simulations")

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points (n, d) clipped into the box and their objectives (n,); what is not finite counts
        as unknown.
        """
        x, raw, cut = self._admit(x)
        f = self.problem.objective(raw)
        f = np.where(np.isfinite(f), f, UNKNOWN)
        self._note(x, raw, f, cut)
        return x, f

    def residuals(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points (n, d) clipped into the box and their residuals (n, m), nan where one cannot be
        simulated.
        """
        x, raw, cut = self._admit(x)
        r = self.problem.residuals(raw)
        f = np.einsum("nm,nm->n", r, r)
        self._note(x, raw, np.where(np.isfinite(f), f, REFUSED), cut)
        return x, r


def _reserve_polish(limits: Limits, dimension: int) -> Limits:
    """The part of `limits` that a polished search may spend before the polish."""
    simulations = limits.simulations
    seconds = limits.seconds
    if simulations is not None:
        simulations -= min(int(simulations * POLISH_SHARE), POLISH_STEPS * (dimension + 2))
    return Limits(
        simulations, None if seconds is None else seconds * (1 - POLISH_SHARE), limits.target
    )


def _begin_search(
    counter: _Counter, optimizer: Optimizer, rng: np.random.Generator
) -> Iterator[None]:
    """Return the optimizer's iterations, none of which has begun.

    Raises `UserError` where `search` runs at its call, as it does without a `yield`: there would
    be no iterations, and no budget would end it.
    """
    why = (
        f"optimizer '{optimizer.name}': its search never yields; write `yield` at the end of each"
        " iteration, the first population being the first"
    )
    try:
        iterations = optimizer.search(counter, counter.box, rng)
    except _Stop:
        raise UserError(why) from None
    if counter.simulations or not isinstance(iterations, Iterator):
        raise UserError(why)
    return iterations


def _run_iterations(
    counter: _Counter, optimizer: Optimizer, rng: np.random.Generator
) -> Iterator[None]:
    """The optimizer's iterations, then, where asked for, the polish in what the limits have kept
    back for it.
    """
    if not optimizer.polish:
        yield from _begin_search(counter, optimizer, rng)
        return
    limits = counter.limits
    counter.elite = Elite(counter.box)
    counter.limits = _reserve_polish(limits, counter.box.dimension)
    try:
        yield from _begin_search(counter, optimizer, rng)
    except _Reached:
        raise
    except _Stop:
        pass  # its share is spent: the polish has the rest
    counter.limits = limits
    yield from polish(counter, counter.elite)


def search(
    problem: Objective,
    optimizer: Optimizer,
    seed: int,
    limits: Limits = Limits(),
    progress: Callable[[int, float, int], None] | None = None,
) -> SearchResult:
    """Search the box of a problem by an optimizer.

    Parameters
    ----------
    problem : Objective
        Bounds, objective and residuals.
    optimizer : Optimizer
        What proposes points.
    seed : int
        The same seed gives the same history, bit for bit.
    limits : Limits
        When the search ends, beside its own end.
    progress : (iteration, best objective, simulations) -> None
        Called after each iteration.

    Returns
    -------
    SearchResult

    Raises
    ------
    Stopped
        At Ctrl-C, with what was found so far.
    UserError
        For an optimizer that never yields or never evaluates, or that proposes what is not a
        number.
    """
    counter = _Counter(problem, optimizer.space == "unit", limits)
    rows: list[tuple[int, float, np.ndarray, float]] = []

    def note() -> None:
        rows.append((counter.simulations, counter.best, counter.best_values, counter.seconds))
        if progress is not None:
            progress(len(rows) - 1, counter.best, counter.simulations)

    try:
        for _ in _run_iterations(counter, optimizer, np.random.default_rng(seed)):
            note()
        if not counter.simulations:
            raise UserError(
                f"optimizer '{optimizer.name}': its search ended and never called `evaluate`; give"
                " it points of the box, (n, d), and it gives their objectives, (n,)"
            )
        status = f"finished its {max(len(rows) - 1, 0)} iterations"
    except _Stop as stop:
        status = str(stop)
    except KeyboardInterrupt as stop:
        ended = _build_result(counter, rows, f"was stopped after {counter.simulations} simulations")
        raise Stopped.from_interrupt(stop, state=ended) from None
    if not rows or rows[-1][0] < counter.simulations:
        note()
    return _build_result(counter, rows, status)


def _build_result(
    counter: _Counter, rows: list[tuple[int, float, np.ndarray, float]], status: str
) -> SearchResult:
    """What a search found: the best of all its evaluations, and its history, one row (simulations,
    best, values, seconds) an iteration.
    """
    rows = rows or [(counter.simulations, counter.best, counter.best_values, counter.seconds)]
    simulations, best, values, seconds = zip(*rows, strict=True)
    history = History(np.array(simulations), np.array(best), np.array(values), np.array(seconds))
    return SearchResult(
        counter.best_values,
        counter.best,
        counter.simulations,
        counter.refused,
        len(rows) - 1,
        counter.seconds,
        status,
        history,
    )
