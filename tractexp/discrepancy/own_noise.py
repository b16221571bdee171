"""What a fit is worth where the noise depends on the model: of waveforms, whose model passes on that of the voltage.

A model that smooths more makes the noise of its own output smaller, and under another model's noise that looks like an
effect. Minus twice the log-likelihood under the fit's own noise, with the determinant, does not reward it.
"""

import numpy as np

from tractexp.discrepancy.fitting import Refit, refit
from tractexp.discrepancy.noise_in_quiet import QuietNoise
from tractexp.noise import Noise


def surprise(quiet: QuietNoise, fit: Refit, noise: Noise) -> float:
    """Minus twice the log-likelihood of what a fit leaves under a noise, but for a constant."""
    return fit.deviance + noise.log_determinant(quiet.bench.drive, quiet.bench.known)


def under_own(quiet: QuietNoise, fit: Refit, faults: tuple[str, ...] | None = None) -> tuple[Refit, float]:
    """A set fitted anew under the noise of its own fit, and its surprise; `faults` as of `refit`."""
    noise = quiet.of_fit(fit.unit)
    again = refit(quiet.bench, noise, [(fit.names, fit.unit)], faults)[0]
    return again, surprise(quiet, again, noise)


def gained(before: float, after: float, parameters: int) -> float:
    """The p of a gain in surprise by so many parameters."""
    from scipy.special import chdtrc

    return float(chdtrc(max(parameters, 1), np.maximum(before - after, 0.0)))
