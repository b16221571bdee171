"""The base model's own fit, with the faults of the measurement free, and the noise that it shows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.discrepancy.context import Context
from tractexp.discrepancy.fitting import Refit, refit
from tractexp.discrepancy.noise_in_quiet import QuietNoise, white
from tractexp.identification.likelihood import Likelihood
from tractexp.identification.local_minima import best_fits
from tractexp.noise import Noise

ROUNDS = 2  # of noise and fit in turn


@dataclass(frozen=True, eq=False)
class BaseFit:
    """The fit, its noise, and the valleys of the base model: its best fits (D,) from all over its box."""

    bench: Context
    fit: Refit
    noise: Noise
    quiet: QuietNoise
    valleys: tuple[np.ndarray, ...]

    def valleys_but(self, unit: np.ndarray) -> list[np.ndarray]:
        """The valleys but the one nearest to coordinates (D,)."""
        base = self.bench.coordinates.base
        far = [float(np.linalg.norm((valley - unit)[base])) for valley in self.valleys]
        return [valley for valley, distance in zip(self.valleys, far, strict=True) if distance > min(far)]


def base_fit(bench: Context) -> BaseFit:
    """Fit the base model from all over its box."""
    valleys = _valleys(bench)
    return fitted_from(bench, valleys, valleys)


def fitted_from(bench: Context, starts: Sequence[np.ndarray], valleys: Sequence[np.ndarray]) -> BaseFit:
    """Fit the base model from these starts (D,): noise and fit in turn, the first time with what precedes the dips."""
    noise = white(bench)
    fit = refit(bench, noise, [((), start) for start in starts])[0]
    quiet = QuietNoise.at(bench, fit.unit)
    for _ in range(ROUNDS):
        noise = quiet.of_fit(fit.unit)
        fit = refit(bench, noise, [((), fit.unit)])[0]
    return BaseFit(bench, fit, noise, quiet, tuple(valleys))


def _valleys(bench: Context) -> list[np.ndarray]:
    """The best fits (D,) of the base model alone, by its own fast kernel."""
    at = bench.coordinates
    ends = best_fits(Likelihood.of(bench.kernels.bare))
    starts = np.tile(at.null, (len(ends), 1))
    starts[:, [*at.base, *at.before]] = ends
    return list(starts)
