"""Where an optimizer is drawn to: its error with the optimum at the center of the box and with it
shifted.

    python benchmarks/bias_audit.py [--json] [--evaluations 10000] [--repeats 7]

Three functions in ten dimensions on the box [-5, 5], searched in its own units ("raw") and rescaled
to the unit cube ("unit"); the shift is a tenth of the box's width in each coordinate, with fixed
signs, so that each function stays what it is around its optimum. An optimizer without a bias has
the same error in both columns; one drawn to zero is far better at the center of the raw box, where
the optimum of a textbook function lies, than beside it. Kudela 2023 (arXiv 2301.01984) calls a
ratio beyond ten a bias. The median of the repeats is given.
"""

import argparse
import json
from collections.abc import Iterator

import numpy as np

from tractexp.configuration.plugin import build, discover
from tractexp.identification.search import Limits, search

DIMENSION, HALF_WIDTH, SHIFT = 10, 5.0, 1.0
# of the shift: no diagonal of the box is favored
SIGNS = np.array([1, -1, -1, 1, 1, 1, -1, 1, -1, -1])
SLOW = ("cobyqa",)  # a millisecond per evaluation: half an hour for its two rows
LITERAL = {"space": "raw", "step": "scalar"}  # as printed, better-only


def sphere(z: np.ndarray) -> np.ndarray:
    """Residuals of sum z^2."""
    return z


def ackley(z: np.ndarray) -> np.ndarray:
    """One residual, the square root of Ackley's function (Ackley 1987)."""
    near = -20 * np.expm1(-0.2 * np.sqrt((z * z).mean(axis=1)))
    waves = np.e - np.exp(np.cos(2 * np.pi * z).mean(axis=1))
    return np.sqrt(np.maximum(near + waves, 0.0))[:, None]


def rastrigin(z: np.ndarray) -> np.ndarray:
    """Residuals of sum z^2 + 10 (1 - cos 2 pi z) (Rastrigin 1974)."""
    return np.sqrt(z * z + 20 * np.sin(np.pi * z) ** 2)


FUNCTIONS = {"sphere": sphere, "Ackley": ackley, "Rastrigin": rastrigin}


class Shifted:
    """A function with its optimum, 0, at `shift` times the signs."""

    lower, upper = np.full(DIMENSION, -HALF_WIDTH), np.full(DIMENSION, HALF_WIDTH)

    def __init__(self, function: str, shift: float):
        self.function, self.center = FUNCTIONS[function], shift * SIGNS

    def residuals(self, values: np.ndarray) -> np.ndarray:
        return self.function(values - self.center)

    def objective(self, values: np.ndarray) -> np.ndarray:
        r = self.residuals(values)
        return np.einsum("nm,nm->n", r, r)


def error(settings: dict, function: str, shift: float, evaluations: int, repeats: int) -> float:
    """The median error of an optimizer on one function."""
    optimizer = build("optimizer", settings)
    problem, limits = Shifted(function, shift), Limits(simulations=evaluations)
    return float(
        np.median([search(problem, optimizer, seed, limits).objective for seed in range(repeats)])
    )


def cases() -> Iterator[tuple[str, dict]]:
    """Every optimizer but the slow in both spaces, and the two sparrow searches as printed."""
    for name in sorted(discover()["optimizer"].keys() - {*SLOW}):
        for space in ("raw", "unit"):
            yield f"{name}, {space}", {"name": name, "space": space}
        if name in ("ssa", "issa"):
            yield f"{name}, raw, scalar step (as printed)", {"name": name, **LITERAL}


def audit(evaluations: int, repeats: int) -> dict[str, dict[str, dict[str, float]]]:
    """{optimizer: {function: {"centered", "shifted"}}} of median errors."""
    return {
        title: {
            function: {
                "centered": error(settings, function, 0.0, evaluations, repeats),
                "shifted": error(settings, function, SHIFT, evaluations, repeats),
            }
            for function in FUNCTIONS
        }
        for title, settings in cases()
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--json", action="store_true", help="print JSON instead of the Markdown table"
    )
    parser.add_argument("--evaluations", type=int, default=10_000)
    parser.add_argument("--repeats", type=int, default=7)
    given = parser.parse_args()
    rows = audit(given.evaluations, given.repeats)
    if given.json:
        print(
            json.dumps(
                {"evaluations": given.evaluations, "repeats": given.repeats, "errors": rows},
                indent=2,
            )
        )
        return
    print("| optimizer | " + " | ".join(f"{f} centered | shifted" for f in FUNCTIONS) + " |")
    print("|---|" + "---|" * (2 * len(FUNCTIONS)))
    for title, errors in rows.items():
        cells = [
            f"{value:.0e}" if value else "0" for pair in errors.values() for value in pair.values()
        ]
        print(f"| {title} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
