"""The base model's own fit, with the faults of the measurement free, and the noise
that it shows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.inference.context import Context
from tractexp.inference.fitting import Refit, refit
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.multistart import valleys
from tractexp.inference.noise_in_quiet import QuietNoise, white
from tractexp.noise import Noise

BASE_FIT_ROUNDS = 2  # of noise and fit in turn


@dataclass(frozen=True, eq=False)
class BaseFit:
    """The fit, its noise, and the valleys of the base model: its best fits (D,) from all over its
    box.
    """

    context: Context
    fit: Refit
    noise: Noise
    quiet: QuietNoise
    local_minima: tuple[np.ndarray, ...]

    def minima_but(self, unit: np.ndarray) -> list[np.ndarray]:
        """The valleys but the one nearest to coordinates (D,)."""
        base = self.context.coordinates.base
        far = [float(np.linalg.norm((minimum - unit)[base])) for minimum in self.local_minima]
        return [
            minimum
            for minimum, distance in zip(self.local_minima, far, strict=True)
            if distance > min(far)
        ]


def base_fit(context: Context) -> BaseFit:
    """Fit the base model from all over its box, where its own fast kernel fits it best."""
    # the first may not stay the best: faults are free
    minima = minima_of(context, Likelihood.from_problem(context.kernels.bare))
    return fitted_from(context, minima, minima)


def minima_of(context: Context, bare: Likelihood) -> list[np.ndarray]:
    """Coordinates (D,) of the best fits of the base model alone by this likelihood, from all over
    its box.
    """
    at, ends = context.coordinates, valleys(bare)
    minima = np.tile(at.null, (len(ends), 1))
    minima[:, [*at.base, *at.before]] = ends
    return list(minima)


def fitted_from(
    context: Context, starts: Sequence[np.ndarray], local_minima: Sequence[np.ndarray]
) -> BaseFit:
    """Fit the base model from these starts (D,): noise and fit in turn, the first time with what
    precedes the dips.
    """
    noise = white(context)
    fit = refit(context, noise, [((), start) for start in starts])[0]
    quiet = QuietNoise.from_context(context, fit.unit)
    for _ in range(BASE_FIT_ROUNDS):
        noise = quiet.of_fit(fit.unit)
        fit = refit(context, noise, [((), fit.unit)])[0]
    return BaseFit(context, fit, noise, quiet, tuple(local_minima))
