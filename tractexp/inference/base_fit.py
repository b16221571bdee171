"""The base model's own fit, with the faults of the measurement free, and the noise
that it shows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.inference.context import Context
from tractexp.inference.fitting import Refit, refit, refit_from
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.multistart import find_local_minima
from tractexp.inference.noise import ROUNDS_OF_NOISE
from tractexp.inference.noise_in_quiet import QuietNoise, assume_white_noise
from tractexp.noise import Noise


@dataclass(frozen=True, eq=False)
class BaseFit:
    """The base model's own fit, before any effect is tried.

    Attributes
    ----------
    context : Context
        The records, coordinates and kernels.
    fit : Refit
        The best fit, faults of the measurement free.
    noise : Noise
        That of its residual.
    quiet : QuietNoise
        What estimates the noise of any further fit.
    local_minima : tuple of (D,) arrays
        Coordinates of the best fits from all over the box of the base model.
    """

    context: Context
    fit: Refit
    noise: Noise
    quiet: QuietNoise
    local_minima: tuple[np.ndarray, ...]

    def minima_but(self, unit: np.ndarray) -> list[np.ndarray]:
        """The local minima but the one nearest to coordinates (D,), by the base model's
        parameters.
        """
        base = self.context.coordinates.base
        far = [float(np.linalg.norm((minimum - unit)[base])) for minimum in self.local_minima]
        return [
            minimum
            for minimum, distance in zip(self.local_minima, far, strict=True)
            if distance > min(far)
        ]


def fit_base_model(context: Context) -> BaseFit:
    """Fit the base model from all over its box.

    The search is that of its own kernel, which is the fastest; the fit has the faults of the
    measurement free.

    Parameters
    ----------
    context : Context
        The records, coordinates and kernels.

    Returns
    -------
    BaseFit
    """
    # the first may not stay the best: faults are free
    at = context.coordinates
    ends = find_local_minima(Likelihood.from_problem(context.kernels.bare))
    minima = np.tile(at.null, (len(ends), 1))
    minima[:, [*at.base, *at.before]] = ends
    return fit_from_starts(context, list(minima), list(minima))


def fit_from_starts(
    context: Context, starts: Sequence[np.ndarray], local_minima: Sequence[np.ndarray]
) -> BaseFit:
    """Fit the base model from given starts, noise and fit in turn.

    The first noise is what precedes the dips, each later one what the fit before left in quiet.

    Parameters
    ----------
    context : Context
        The records, coordinates and kernels.
    starts : sequence of (D,) arrays
        Coordinates that descents begin from.
    local_minima : sequence of (D,) arrays
        Kept in what is returned.

    Returns
    -------
    BaseFit
    """
    noise = assume_white_noise(context)
    fit = refit(context, noise, [((), start) for start in starts])[0]
    quiet = QuietNoise.from_context(context, fit.unit)
    for _ in range(ROUNDS_OF_NOISE):
        noise = quiet.of_fit(fit.unit)
        fit = refit_from(context, noise, (), fit.unit)
    return BaseFit(context, fit, noise, quiet, tuple(local_minima))
