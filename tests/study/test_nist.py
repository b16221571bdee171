"""Least squares and standard errors against certified answers: the 27 nonlinear problems of NIST
StRD, both starts.

`descend`, `compute_central_differences` and `Information` are what an estimate and its uncertainty
are computed by; here their rows are the Institute's problems instead of a simulated load. As in an
estimate, a descent is repeated in units of what the last one left, and the box is then drawn about
its end, as a user does by `model.bounds`.


Rows are computed in extended precision, where the machine has it, and rounded. Lanczos1 leaves
1e-13 of 1: its own rounding in double precision leaves three digits of the residual, so that no
method has more of its deviations.

`python tests/study/test_nist.py` prints the table.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from tractexp.inference.differences import compute_central_differences
from tractexp.inference.information import Information
from tractexp.inference.least_squares import descend
from tractexp.parameter import Box

FILES = Path(__file__).parents[1] / "oracle" / "nist"
Real = np.longdouble
PI = Real("3.141592653589793238462643383279")
EXTENDED = np.finfo(Real).eps < 1e-18  # not on every machine
VALUES, DEVIATIONS = 6, 4  # digits asked for
# the box: up to so many times the larger start, down to such a part of the smaller
WIDER, LOWER = 3, 50
PASSES = 2  # in each box
STEPS, GAIN = 2000, 1e-12  # of a descent: at most, and the gain in mean squares that ends it


def exponential_rise(x, b1, b2):
    return b1 * (1 - np.exp(-b2 * x))


def decay_over_line(x, b1, b2, b3):
    return np.exp(-b1 * x) / (b2 + b3 * x)


def two_peaks(x, b1, b2, b3, b4, b5, b6, b7, b8):
    return (
        b1 * np.exp(-b2 * x)
        + b3 * np.exp(-((x - b4) ** 2) / b5**2)
        + b6 * np.exp(-((x - b7) ** 2) / b8**2)
    )


def cubic_over_cubic(x, b1, b2, b3, b4, b5, b6, b7):
    return (b1 + b2 * x + b3 * x**2 + b4 * x**3) / (1 + b5 * x + b6 * x**2 + b7 * x**3)


def three_decays(x, b1, b2, b3, b4, b5, b6):
    return b1 * np.exp(-b2 * x) + b3 * np.exp(-b4 * x) + b5 * np.exp(-b6 * x)


def harmonics(x, b1, b2, b3, b4, b5, b6, b7, b8, b9):
    year, first, second = (2 * PI * x / period for period in (12, b4, b7))
    yearly = b1 + b2 * np.cos(year) + b3 * np.sin(year)
    return (
        yearly + b5 * np.cos(first) + b6 * np.sin(first) + b8 * np.cos(second) + b9 * np.sin(second)
    )


MODELS: dict[str, Callable] = {
    "Bennett5": lambda x, b1, b2, b3: b1 * (b2 + x) ** (-1 / b3),
    "BoxBOD": exponential_rise,
    "Chwirut1": decay_over_line,
    "Chwirut2": decay_over_line,
    "DanWood": lambda x, b1, b2: b1 * x**b2,
    "ENSO": harmonics,
    "Eckerle4": lambda x, b1, b2, b3: b1 / b2 * np.exp(-(((x - b3) / b2) ** 2) / 2),
    "Gauss1": two_peaks,
    "Gauss2": two_peaks,
    "Gauss3": two_peaks,
    "Hahn1": cubic_over_cubic,
    "Kirby2": lambda x, b1, b2, b3, b4, b5: (b1 + b2 * x + b3 * x**2) / (1 + b4 * x + b5 * x**2),
    "Lanczos1": three_decays,
    "Lanczos2": three_decays,
    "Lanczos3": three_decays,
    "MGH09": lambda x, b1, b2, b3, b4: b1 * (x**2 + x * b2) / (x**2 + x * b3 + b4),
    "MGH10": lambda x, b1, b2, b3: b1 * np.exp(b2 / (x + b3)),
    "MGH17": lambda x, b1, b2, b3, b4, b5: b1 + b2 * np.exp(-x * b4) + b3 * np.exp(-x * b5),
    "Misra1a": exponential_rise,
    "Misra1b": lambda x, b1, b2: b1 * (1 - (1 + b2 * x / 2) ** -2),
    "Misra1c": lambda x, b1, b2: b1 * (1 - (1 + 2 * b2 * x) ** Real(-0.5)),
    "Misra1d": lambda x, b1, b2: b1 * b2 * x / (1 + b2 * x),
    "Nelson": lambda x, b1, b2, b3: b1 - b2 * x[0] * np.exp(-b3 * x[1]),
    "Rat42": lambda x, b1, b2, b3: b1 / (1 + np.exp(b2 - b3 * x)),
    "Rat43": lambda x, b1, b2, b3, b4: b1 / (1 + np.exp(b2 - b3 * x)) ** (1 / b4),
    "Roszman1": lambda x, b1, b2, b3, b4: b1 - b2 * x - np.arctan(b3 / (x - b4)) / PI,
    "Thurber": cubic_over_cubic,
}
# amplitudes of sines and cosines: the starts do not know their phases
EITHER_SIGN = {"ENSO": [1, 2, 4, 5, 7, 8]}


@dataclass(frozen=True, eq=False)
class Regression:
    """One problem: `x` (N,) or (2, N), `y` (N,), `starts` (2, d), and the certified values and
    deviations (d,).
    """

    name: str
    x: np.ndarray
    y: np.ndarray
    starts: np.ndarray
    values: np.ndarray
    deviations: np.ndarray
    left: float  # certified residual sum of squares

    @classmethod
    def read(cls, name: str) -> "Regression":
        """Lines 41 to 60 hold the starts and the certified answers, and the data follow."""
        lines = (FILES / f"{name}.dat").read_text(encoding="ascii").splitlines()
        answers = np.array(
            [line.split("=")[1].split() for line in lines[40:60] if "=" in line], dtype=float
        )
        (left,) = [
            float(line.split(":")[1])
            for line in lines[40:60]
            if line.startswith("Residual Sum of Squares")
        ]
        data = np.array(
            [[Real(word) for word in line.split()] for line in lines[60:] if line.strip()]
        ).T
        y = np.log(data[0]) if name == "Nelson" else data[0]
        return cls(
            name,
            data[1] if len(data) == 2 else data[1:],
            y,
            answers[:, :2].T,
            *answers[:, 2:].T,
            left,
        )

    @property
    def box(self) -> Box:
        """What the starts tell of the range, the same for both of them."""
        small, large = np.sort(np.abs(self.starts), axis=0) * np.array([[1 / LOWER], [WIDER]])
        small[EITHER_SIGN.get(self.name, [])] = -large[EITHER_SIGN.get(self.name, [])]
        negative = self.starts[1] < 0
        negative[EITHER_SIGN.get(self.name, [])] = False
        return Box(np.where(negative, -large, small), np.where(negative, -small, large))

    def residuals(self, values: np.ndarray) -> np.ndarray:
        """Calculated minus measured (n, N) at values (n, d), nan where they are no numbers."""
        with np.errstate(all="ignore"):
            rows = (MODELS[self.name](self.x, *values.astype(Real).T[:, :, None]) - self.y).astype(
                float
            )
        return np.where(np.isfinite(rows).all(axis=1, keepdims=True), rows, np.nan)


@dataclass(frozen=True, eq=False)
class Answer:
    """What a fit found: values and deviations (d,), the sum of squares, and how many residuals it
    computed.
    """

    values: np.ndarray
    deviations: np.ndarray
    left: float
    simulations: int


def fitted(problem: Regression, start: np.ndarray) -> Answer:
    """The least squares of a problem from a start (d,), and their standard errors."""
    box, values, spent = problem.box, start, 0
    for _ in range(2):
        for _ in range(PASSES):
            left = float(np.mean(problem.residuals(values[None]) ** 2))

            def rows(unit, lanes, box=box, left=left):
                return problem.residuals(box.from_unit(unit)) / np.sqrt(left)

            end = descend(
                rows, box.to_unit(values)[None], iterations=STEPS, tolerance=GAIN, central=True
            )
            values, spent = box.from_unit(end.unit[0]), spent + end.simulations
        box = Box(np.minimum(0, 2 * values), np.maximum(0, 2 * values))
    return Answer(
        values, standard_errors(problem, box, values), float(end.deviance[0] * left), spent
    )


def standard_errors(problem: Regression, box: Box, values: np.ndarray) -> np.ndarray:
    """Those of independent residuals (d,), whose variance is what is left over the degrees of
    freedom.
    """

    def rows(unit, lanes):
        return problem.residuals(box.from_unit(unit))

    (residual,), (J,) = compute_central_differences(
        rows, box.to_unit(values)[None], np.zeros(1, dtype=int)
    )
    deviation = np.sqrt(residual @ residual / (len(residual) - len(values)))
    names = [f"b{k}" for k in range(1, len(values) + 1)]
    return Information.from_jacobian(
        names, values, box.width, J.T / deviation, np.empty((len(residual), 0))
    ).standard_errors


def digits(number: np.ndarray, certified: np.ndarray) -> float:
    """Significant digits that the worst of several numbers has, as the Institute counts: at most
    the eleven it gives.

    Source: McCullough 1998, the logarithm of the relative error.
    """
    error = np.abs(number - certified) / np.abs(certified)
    return float(np.min(-np.log10(np.clip(error, 1e-11, None))))


@pytest.mark.parametrize("start", [0, pytest.param(1, marks=pytest.mark.long)])  # 1: the nearer
@pytest.mark.parametrize("name", MODELS)
def test_least_squares_have_the_certified_values_and_deviations(name, start):
    problem = Regression.read(name)
    answer = fitted(problem, problem.starts[start])
    limit = DEVIATIONS if EXTENDED or name != "Lanczos1" else 2.5
    assert digits(answer.values, problem.values) >= VALUES
    assert digits(answer.deviations, problem.deviations) >= limit
    assert answer.left == pytest.approx(
        problem.left, rel=1e-6 if EXTENDED or name != "Lanczos1" else 1e-2
    )


def test_every_problem_of_the_institute_is_there():
    assert {path.stem for path in FILES.glob("*.dat")} == set(MODELS)
    assert len(MODELS) == 27


def test_the_certified_answer_is_inside_the_box_and_the_starts_are():
    for name in MODELS:
        problem = Regression.read(name)
        for point in (*problem.starts, problem.values):
            assert np.all((problem.box.lower < point) & (point < problem.box.upper)), name


if __name__ == "__main__":
    print(f"{'problem':10} {'start':>5} {'values':>7} {'deviations':>11} {'residuals':>10}")
    for problem in map(Regression.read, MODELS):
        for k, start in enumerate(problem.starts, 1):
            answer = fitted(problem, start)
            found = (
                digits(answer.values, problem.values),
                digits(answer.deviations, problem.deviations),
            )
            print(
                f"{problem.name:10} {k:5} {found[0]:7.1f} {found[1]:11.1f} {answer.simulations:10}"
            )
