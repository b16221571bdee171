"""What the printed equations and values can and cannot be, in numbers."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.configuration.plugin import build
from tractexp.identification.result import ACCEPTED
from tractexp.identification.search import Limits, search
from tractexp.studies.paper import maps, printed
from tractexp.studies.paper.printed import LABELS

# T', X', C, M, T_m of a motor that has a steady state at U0 = 1
FAIR = (0.06, 0.75, 0.85, 0.0026, 0.36)
PRINTED_TOLERANCE = 0.01  # of a printed number that rounding explains
Field = Callable[[np.ndarray], np.ndarray]


def compute_steady_state_sine(column: Sequence[float]) -> float:
    """|2 T_m X'/(C U0²)| at U0 = 1 pu, whose arcsine is in Eq. (3): it must not exceed 1."""
    value = dict(zip(printed.NAMES, column, strict=True))
    return abs(2 * value["T_m"] * value["X_prime"] / value["C"])


def list_refusals(model: Any, drive: Any) -> dict[str, str]:
    """The refusal of each column of Table 3 by the model; "" where it has a steady state."""
    return {
        name: model.refusal(np.array(column), drive) or ""
        for name, column in printed.TABLE_3.items()
    }


@dataclass(frozen=True)
class Consistency:
    """The mean squares of P and Q that Table 3 implies, and by how much each printed objective then
    misses.
    """

    pairs: Mapping[str, tuple[float, float]]  # "issa and ssa" -> mean squares of P and Q
    best: tuple[float, float]  # non-negative, with the smallest relative misses
    misses: Mapping[str, float]  # of the printed objective, relative


def check_consistency() -> Consistency:
    """The mean squares of P and Q by which errors and objectives of Table 3 agree best.

    By Eq. (20) the objective of Eq. (8) is epsilon_p² mean(P²) + epsilon_q² mean(Q²). The means are
    two unknowns of one record, and the table has three columns: each pair of columns gives both,
    and all three are fitted by non-negative least squares of relative misses.
    """
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
    return Consistency(
        pairs, (float(best[0]), float(best[1])), dict(zip(names, misses.tolist(), strict=True))
    )


def step_classically(f: Field, y: np.ndarray, h: float) -> np.ndarray:
    """One step of the classical Runge-Kutta method."""
    return _step_runge_kutta(f, y, h, h / 2)


def step_as_printed(f: Field, y: np.ndarray, h: float) -> np.ndarray:
    """One step of Eq. (4) as printed, h/6 in the second and third stage, its twice named K1 read as
    K3 and K4.
    """
    return _step_runge_kutta(f, y, h, h / 6)


def _step_runge_kutta(f: Field, y: np.ndarray, h: float, inner: float) -> np.ndarray:
    """A step of the classical method, its stages `inner` apart."""
    k1 = f(y)
    k2 = f(y + inner * k1)
    k3 = f(y + inner * k2)
    k4 = f(y + h * k3)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def order(step: Callable[[Field, np.ndarray, float], np.ndarray], halvings: int = 5) -> float:
    """The order of a method: the slope of log error over log step, for an oscillator over one
    radian.
    """
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
    exact = np.array([np.cos(1.0), -np.sin(1.0)])
    counts, errors = 8 * 2 ** np.arange(halvings), []
    for n in counts:
        y = np.array([1.0, 0.0])
        for _ in range(n):
            y = step(lambda y: turn @ y, y, 1 / n)
        errors.append(np.linalg.norm(y - exact))
    return float(-np.polyfit(np.log(counts), np.log(errors), 1)[0])


@dataclass(frozen=True)
class Check:
    """A printed number and its place, the value that an equation gives, and whether both agree."""

    where: str
    printed: str
    gives: str
    holds: bool


def check_printed_numbers() -> list[Check]:
    """The printed numbers, put into the printed equations."""
    return [*_check_steady_states(), *_check_errors(), *_check_methods(), *_check_rankings()]


def _check_steady_states() -> list[Check]:
    """Eqs. (1) to (3) and the definitions below them."""
    residual = compute_rest_residual(FAIR)
    results = [
        Check(
            "Eq. (3)",
            "the steady state of Eq. (1)",
            f"with it the derivatives of Eq. (1) are {residual:.0e}",
            residual < 1e-12,
        )
    ]
    for name, column in printed.TABLE_3.items():
        value, sine = (
            dict(zip(printed.NAMES, column, strict=True)),
            compute_steady_state_sine(column),
        )
        where = f"Table 3, {LABELS[name]}"
        C, T = value["C"], value["T_prime"]
        results += [
            Check(
                where,
                f"T_m = {value['T_m']:g}, X' = {value['X_prime']:g}, C = {C:g}",
                f"Eq. (3) takes the arcsine of 2 T_m X'/(C U0²), in size {sine:.2f} at U0 = 1: it"
                " must not exceed 1",
                sine <= 1,
            ),
            Check(
                where,
                f"C = {C:g}",
                "C = (X - X')/X, with X' between 0 and X, lies between 0 and 1",
                0 < C < 1,
            ),
            Check(where, f"T' = {T:g} s", "T' = X'/X T0' is a time constant: positive", T > 0),
        ]
    return results


def _check_errors() -> list[Check]:
    """Eqs. (8) and (20)."""
    results = []
    for name, label in LABELS.items():
        if name in printed.EPSILON_P:
            P, Q = printed.EPSILON_P[name], printed.EPSILON_Q[name]
            results.append(
                Check(
                    f"Table 3, {label}",
                    f"epsilon_p {100 * P:g} %, epsilon_q {100 * Q:g} %",
                    f"section 4.2 accepts less than {100 * ACCEPTED:g} %",
                    max(P, Q) < ACCEPTED,
                )
            )
    gap = check_consistency()
    for pair, (P, Q) in gap.pairs.items():
        first, second = pair.split(" and ")
        results.append(
            Check(
                f"Table 3, {LABELS[first]} and {LABELS[second]}",
                "errors and objectives of one record",
                "Eq. (8) is epsilon_p² mean(P²) + epsilon_q² mean(Q²), Eq. (20): the means are"
                f" {P:.2f} and {Q:.2f}, and no mean of squares is negative",
                min(P, Q) >= 0,
            )
        )
    misses = ", ".join(f"{LABELS[n]} {100 * m:+.0f} %" for n, m in gap.misses.items())
    results.append(
        Check(
            "Table 3, all three",
            "errors and objectives of one record",
            f"the means that fit best miss the printed objectives by {misses}",
            max(map(abs, gap.misses.values())) < PRINTED_TOLERANCE,
        )
    )
    return results


def _check_methods() -> list[Check]:
    """Eqs. (4) and (15), and what is printed twice."""
    wrong, right = order(step_as_printed), order(step_classically)
    slopes = {
        formula: maps.estimate_tail_exponent(steps) for formula, steps in maps.draw_tails().items()
    }
    return [
        Check(
            "Eq. (4)",
            "the fourth-order Runge-Kutta method",
            f"measured order {wrong:.2f}; with h/2 for h/6 in the second and third stage"
            f" {right:.2f}",
            wrong > 3.5,
        ),
        Check(
            "Eq. (15)",
            "Lévy steps with beta = 3/2",
            f"-mu/|nu|^beta has the tail exponent {slopes['printed']:.2f}; Mantegna's"
            f" mu/|nu|^(1/beta) {slopes['mantegna']:.2f}",
            abs(slopes["printed"] - 1.5) < 0.2,
        ),
        Check(
            "section 4.3",
            "SD = 20 of N = 50",
            "section 4.2 has 20 % of perceivers, which are 10",
            False,
        ),
        Check(
            "step 5",
            "the perturbation is chosen by fitness",
            "section 3.2.3 chooses it by the stage of the search",
            False,
        ),
        Check(
            "section 4.4.2",
            "the dip to extrapolate to is of less than 50 %",
            "beyond the fitted dip of 50 % lies a deeper one; one of less is to interpolate, as in"
            " 4.4.1",
            False,
        ),
    ]


def _check_rankings() -> list[Check]:
    """Whether the paper's tables say of ISSA what its text does."""
    results = []
    tables = {
        "epsilon_p": printed.EPSILON_P,
        "epsilon_q": printed.EPSILON_Q,
        "Obj.E": printed.OBJECTIVE,
    }
    for said, table in tables.items():
        results.append(_check_lowest("Table 3", said, table))
    P = printed.EPSILON_P
    results.append(
        Check(
            "Table 3",
            "SSA is more accurate than PSO",
            f"its epsilon_p is {100 * P['ssa']:g} %, PSO's {100 * P['pso']:g} %",
            P["ssa"] < P["pso"],
        )
    )
    for where, rows in (("Table 4", printed.INTERPOLATION), ("Table 5", printed.EXTRAPOLATION)):
        for c, channel in enumerate("PQ"):
            results.append(
                _check_lowest(
                    where, f"residual of {channel}", {n: pair[c] for n, pair in rows.items()}
                )
            )
    return results


def _check_lowest(where: str, what: str, table: Mapping[str, float]) -> Check:
    """Whether ISSA has the lowest value of a table."""
    best = min(table, key=lambda name: table[name])
    return Check(
        where,
        f"ISSA has the lowest {what}",
        f"the lowest is {LABELS[best]}'s, {table[best]:g}",
        best == "issa",
    )


def compute_rest_residual(motor: Sequence[float]) -> float:
    """The largest derivative of Eq. (1), as printed, in the state of Eq. (3) at U0 = 1 pu;
    `motor` is T', X', C, M, T_m.
    """
    T_prime, X_prime, C, M, T_m = motor
    delta = 0.5 * np.arcsin(-2 * T_m * X_prime / C)
    E = C * np.cos(delta)
    slip = C * np.sin(delta) / (T_prime * E)  # omega - omega_s
    slopes = (
        (-E + C * np.cos(delta)) / T_prime,
        -C * np.sin(delta) / (T_prime * E) + slip,
        (-E * np.sin(delta) / X_prime - T_m) / M,
    )
    return float(np.max(np.abs(slopes)))


def compute_motor_reactive(value: Mapping[str, float], U0: float) -> float:
    """Q_d [pu] before the event, Eqs. (2) and (3)."""
    sine = -2 * value["T_m"] * value["X_prime"] / (value["C"] * U0**2)
    delta = 0.5 * np.arcsin(np.clip(sine, -1, 1))
    return float(U0 * (U0 - value["C"] * U0 * np.cos(delta) ** 2) / value["X_prime"])


class Sphere:
    """The sum of squares about an optimum, in the box [-5, 5]^d: a problem for the search loop."""

    def __init__(self, optimum: np.ndarray):
        """A sum of squares with its minimum at a point."""
        self.optimum = optimum
        self.lower, self.upper = np.full(len(optimum), -5.0), np.full(len(optimum), 5.0)

    def objective(self, values: np.ndarray) -> np.ndarray:
        """The objective (n,) of points (n, d)."""
        return np.sum((values - self.optimum) ** 2, axis=1)

    def residuals(self, values: np.ndarray) -> np.ndarray:
        """The distances (n, d) from the minimum."""
        return values - self.optimum


def measure_bias(budget: int = 10_000, seeds: int = 7) -> dict[str, tuple[float, float]]:
    """Median error on the sphere in ten dimensions, its optimum at zero and one unit off in each
    coordinate.

    Raw units and, for the sparrow searches, one scalar for A⁺L, as printed. An unbiased search has
    one size of error.
    """
    shift = np.where(np.arange(10) % 2 == 0, 1.0, -1.0)
    biases = {}
    for name in printed.COMPARED:
        settings = {"name": name, "space": "raw"} | ({} if name == "pso" else {"step": "scalar"})
        medians = [
            np.median(
                [
                    search(
                        Sphere(optimum), build("optimizer", settings), s, Limits(budget)
                    ).objective
                    for s in range(seeds)
                ]
            )
            for optimum in (np.zeros(10), shift)
        ]
        biases[name] = float(medians[0]), float(medians[1])
    return biases
