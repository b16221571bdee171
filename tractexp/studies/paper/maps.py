"""Chaotic maps and Lévy flights: what Figures 3 and 4 show, and how even a flock they scatter.

Tent orbits and flights are taken from the optimizer itself, so that what is measured is what
searches.
"""

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from tractexp.configuration.plugin import build
from tractexp.identification.optimizer import Box

FLOCK_DRAWS = 200  # flocks of each kind whose discrepancy is taken
LEVY_STEPS = 200_000  # Lévy steps whose tail is measured
LEVY_TAIL_SHARE = 0.005  # share of the steps that count as the tail


def build_issa(**settings: Any) -> Any:
    """ISSA with some settings."""
    return build("optimizer", {"name": "issa", **settings})


def compute_tent_orbit(alpha: float, n: int, d: int, rng: np.random.Generator) -> np.ndarray:
    """(n, d) iterates of the tent map, Eq. (14), one orbit in each column."""
    return build_issa(tent_alpha=alpha, population=n).initial(Box.unit(d), rng)


def compute_logistic_orbit(n: int, d: int, rng: np.random.Generator) -> np.ndarray:
    """(n, d) iterates of the logistic map z -> 4 z (1 - z), one orbit in each column."""
    orbit = [rng.random(d)]
    for _ in range(n - 1):
        orbit.append(4 * orbit[-1] * (1 - orbit[-1]))
    return np.array(orbit)


def draw_sobol(n: int, d: int, rng: np.random.Generator) -> np.ndarray:
    """(n, d) scrambled Sobol points."""
    from scipy.stats import qmc

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of balance lost where n is no power of two
        return qmc.Sobol(d, rng=rng).random(n)


def list_flocks(
    n: int, d: int, alphas: tuple[float, ...]
) -> dict[str, Callable[[np.random.Generator], np.ndarray]]:
    """The ways to scatter n sparrows over d coordinates, by name."""
    ways = {
        f"tent, alpha = {a:g}": lambda rng, a=a: compute_tent_orbit(a, n, d, rng) for a in alphas
    }
    return ways | {
        "logistic": lambda rng: compute_logistic_orbit(n, d, rng),
        "uniform": lambda rng: rng.random((n, d)),
        "Sobol": lambda rng: draw_sobol(n, d, rng),
    }


def measure_discrepancies(
    n: int, d: int, alphas: tuple[float, ...], draws: int = FLOCK_DRAWS
) -> Mapping[str, np.ndarray]:
    """Centered discrepancy of each way to scatter, (draws,) each: the lower, the more even. Source:
    Hickernell 1998.
    """
    from scipy.stats import qmc

    rng = np.random.default_rng(0)
    return {
        name: np.array([qmc.discrepancy(np.clip(draw(rng), 0, 1)) for _ in range(draws)])
        for name, draw in list_flocks(n, d, alphas).items()
    }


def draw_flights(formula: str, n: int, d: int, seed: int = 0) -> np.ndarray:
    """(n, d) Lévy steps of Eq. (15), "mantegna" or as "printed"."""
    return build_issa(levy_formula=formula).flight((n, d), np.random.default_rng(seed))


def draw_tails() -> dict[str, np.ndarray]:
    """Steps of Eq. (15), {formula: (STEPS,)}."""
    return {
        formula: draw_flights(formula, LEVY_STEPS, 1)[:, 0] for formula in ("mantegna", "printed")
    }


def estimate_tail_exponent(steps: np.ndarray) -> float:
    """a in P(|s| > x) ~ x^-a, from the largest of the steps (n,). Source: Hill 1975."""
    size = np.sort(np.abs(steps.ravel()))
    k = max(2, round(LEVY_TAIL_SHARE * len(size)))
    return float(1 / np.mean(np.log(size[-k:] / size[-k - 1])))
