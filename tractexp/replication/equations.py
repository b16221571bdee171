"""What the printed equations and values can and cannot be, in numbers."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.identification.search import Limits, search
from tractexp.plugin import build
from tractexp.replication import printed

Field = Callable[[np.ndarray], np.ndarray]


def steady_state_sine(column: Sequence[float], U0: float = 1.0) -> float:
    """|2 T_m X'/(C U0²)|, whose arcsine is in Eq. (3): it must not exceed 1."""
    value = dict(zip(printed.NAMES, column, strict=True))
    return abs(2 * value["T_m"] * value["X_prime"] / (value["C"] * U0**2))


def refusals(model: Any, drive: Any) -> dict[str, str]:
    """What the model answers to each column of Table 3; "" where it has a steady state."""
    return {name: model.refusal(np.array(column), drive) or "" for name, column in printed.TABLE_3.items()}


@dataclass(frozen=True)
class Consistency:
    """The mean squares of P and Q that Table 3 implies, and by how much each printed objective then misses."""

    pairs: Mapping[str, tuple[float, float]]  # "issa and ssa" -> mean squares of P and Q
    best: tuple[float, float]  # non-negative, with the smallest relative misses
    misses: Mapping[str, float]  # of the printed objective, relative


def consistency() -> Consistency:
    """Eq. (8) is epsilon_p² mean(P²) + epsilon_q² mean(Q²) by Eq. (20): three columns, two unknowns of one record."""
    from scipy.optimize import nnls

    names = list(printed.TABLE_3)
    rows = np.array([[printed.EPSILON_P[n] ** 2, printed.EPSILON_Q[n] ** 2] for n in names])
    goal = np.array([printed.OBJECTIVE[n] for n in names])
    pairs = {}
    for i, j in ((0, 1), (0, 2), (1, 2)):
        P, Q = np.linalg.solve(rows[[i, j]], goal[[i, j]])
        pairs[f"{names[i]} and {names[j]}"] = float(P), float(Q)
    best, _ = nnls(rows / goal[:, None], np.ones(3))
    misses = (rows @ best - goal) / goal
    return Consistency(pairs, (float(best[0]), float(best[1])), dict(zip(names, misses.tolist(), strict=True)))


def classical(f: Field, y: np.ndarray, h: float) -> np.ndarray:
    """One step of the classical Runge-Kutta method."""
    k1 = f(y)
    k2 = f(y + h / 2 * k1)
    k3 = f(y + h / 2 * k2)
    k4 = f(y + h * k3)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def as_printed(f: Field, y: np.ndarray, h: float) -> np.ndarray:
    """One step of Eq. (4) as printed, h/6 in the second and third stage, its twice named K1 read as K3 and K4."""
    k1 = f(y)
    k2 = f(y + h / 6 * k1)
    k3 = f(y + h / 6 * k2)
    k4 = f(y + h * k3)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def order(step: Callable[[Field, np.ndarray, float], np.ndarray], halvings: int = 5) -> float:
    """The order of a method: the slope of log error over log step, for an oscillator over one radian."""
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
    exact = np.array([np.cos(1.0), -np.sin(1.0)])
    counts, errors = 8 * 2 ** np.arange(halvings), []
    for n in counts:
        y = np.array([1.0, 0.0])
        for _ in range(n):
            y = step(lambda y: turn @ y, y, 1 / n)
        errors.append(np.linalg.norm(y - exact))
    return float(-np.polyfit(np.log(counts), np.log(errors), 1)[0])


class Sphere:
    """The sum of squares about an optimum, in the box [-5, 5]^d: a problem for the search loop."""

    def __init__(self, optimum: np.ndarray):
        self.optimum = optimum
        self.lower, self.upper = np.full(len(optimum), -5.0), np.full(len(optimum), 5.0)

    def objective(self, values: np.ndarray) -> np.ndarray:
        return np.sum((values - self.optimum) ** 2, axis=1)

    def residuals(self, values: np.ndarray) -> np.ndarray:
        return values - self.optimum


def bias(budget: int = 10_000, seeds: int = 7) -> dict[str, tuple[float, float]]:
    """Median error on the sphere in ten dimensions, its optimum at zero and one unit off in each coordinate.

    Raw units and, for the sparrow searches, one scalar for A⁺L, as printed. An unbiased search has one size of error.
    """
    shift = np.where(np.arange(10) % 2 == 0, 1.0, -1.0)
    found = {}
    for name in printed.COMPARED:
        settings = {"name": name, "space": "raw"} | ({} if name == "pso" else {"step": "scalar"})
        medians = [
            np.median([search(Sphere(optimum), build("optimizer", settings), s, Limits(budget)).objective
                       for s in range(seeds)])
            for optimum in (np.zeros(10), shift)
        ]  # fmt: skip
        found[name] = float(medians[0]), float(medians[1])
    return found
