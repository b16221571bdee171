"""The noise that an estimate leaves, and the samples that a robust loss takes for outliers."""

from dataclasses import replace

import numpy as np

from tractexp.inference.likelihood import Likelihood
from tractexp.inference.observed import Observed
from tractexp.noise.color import (
    FEWEST_NOISE_SAMPLES,
    cut_stretches,
    fit_autoregression,
    white_noise,
)
from tractexp.noise.model import Noise, Pair

OUTLIER = 5.0  # robust standard deviations from which a robust loss takes a sample for an outlier


def estimate_noise_at(
    observed: Observed,
    likelihood: Likelihood,
    unit: np.ndarray,
    input_modes: np.ndarray | None,
    whole: bool = False,
) -> Noise:
    """The noise that a fit leaves in quiet.

    Where only noise is left the whole residual tells more; and where too little is quiet, it has to
    do.

    Parameters
    ----------
    observed : Observed
        The problem, driven by smoothed voltages.
    likelihood : Likelihood
        Whose residuals they are.
    unit : (D,)
        Coordinates of the fit.
    input_modes : (k, C, N) [pu] or None
        That of `Observed.input_errors`.
    whole : bool
        Whether the whole residual is taken.

    Returns
    -------
    Noise
    """
    measured = likelihood.problem.drive.measurements
    rows, J = replace(likelihood, noise=Noise.white(*[1.0] * len(measured))).jacobian(unit)
    residual = rows.reshape(measured.shape)
    values = likelihood.values(unit)
    return observed.noise(
        residual, likelihood.valid, J, values, input_modes, whole
    ) or fit_residual_noise(likelihood, residual)


def fit_residual_noise(likelihood: Likelihood, residuals: np.ndarray) -> Noise:
    """An autoregression of each event's and channel's residual (2, N); what the fit has absorbed is
    given back.
    """
    drive = likelihood.problem.drive
    absorbed = likelihood.free + 2 * drive.events
    back = np.sqrt(likelihood.samples / max(likelihood.samples - absorbed, 1))
    pairs: list[Pair] = []
    for part in drive.parts:
        pair = []
        for c in range(drive.channels):
            pieces = cut_stretches(residuals[c, part], likelihood.valid[c, part])
            enough = sum(map(len, pieces)) >= FEWEST_NOISE_SAMPLES
            pair.append(
                fit_autoregression(pieces).scale_noise(back) if enough else white_noise(1.0)
            )
        pairs.append(tuple(pair))
    return Noise(tuple(pairs))


def drop_outliers(likelihood: Likelihood, unit: np.ndarray) -> Likelihood:
    """The likelihood without the samples beyond `OUTLIER` robust standard deviations of the fit at
    `unit` (1, D).
    """
    drive = likelihood.problem.drive
    valid = drive.weights > 0
    residuals = np.abs(replace(likelihood, valid=valid).residuals(unit)[0])
    for part in drive.parts:
        for c in range(drive.channels):
            sample = residuals[c, part][valid[c, part]]
            if len(sample):
                valid[c, part] &= residuals[c, part] <= max(
                    OUTLIER * 1.4826 * float(np.median(sample)), 1e-12
                )
    return replace(likelihood, valid=valid)
