"""The noise that an estimate leaves, and the samples that a robust loss takes for outliers."""

from dataclasses import replace

import numpy as np

from tractexp.errors import UserError
from tractexp.inference.likelihood import Likelihood
from tractexp.inference.noise import estimate_noise, restore_variance
from tractexp.inference.problem import Problem
from tractexp.noise.color import (
    FEWEST_NOISE_SAMPLES,
    cut_stretches,
    fit_autoregression,
    white_noise,
)
from tractexp.noise.model import Noise, Pair
from tractexp.noise.quiet import is_louder
from tractexp.noise.random_walk import remove_slow

OUTLIER = 5.0  # robust standard deviations from which a robust loss takes a sample for an outlier


def estimate_noise_at(
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
    likelihood : Likelihood
        Whose residuals they are; its problem is driven by smoothed voltages.
    unit : (D,)
        Coordinates of the fit.
    input_modes : (k, C, N) [pu] or None
        That of `compute_input_modes`.
    whole : bool
        Whether the whole residual is taken.

    Returns
    -------
    Noise
    """
    problem = likelihood.problem
    valid = likelihood.valid
    rows, J = replace(likelihood, noise=Noise.white(*[1.0] * len(valid))).jacobian(unit)
    residual = rows.reshape(valid.shape)
    try:
        return estimate_noise(
            problem,
            restore_variance(rows, J.basis().leverage).reshape(valid.shape),
            valid,
            problem.drive.parts if whole else select_noisy_stretches(problem, residual, valid),
            (problem, likelihood.values(unit)),
            input_modes,
            residual,
            J.columns.reshape(-1, *valid.shape),
        )
    except UserError:
        return fit_residual_noise(likelihood, residual)


def select_noisy_stretches(
    problem: Problem, residuals: np.ndarray, valid: np.ndarray
) -> list[slice]:
    """The quiet stretches whose residual (C, N) is noise: those after a dip only where no louder
    than before it.

    Where a record has less noise than the model has error, what is left at its end is the model's.
    """
    first = problem.drive.first
    starts = [int(first[e]) + event.start for e, event in enumerate(problem.events)]
    before = [part for part in problem.quiet if part.stop in starts]
    after = [part for part in problem.quiet if part.stop not in starts]
    for c in np.flatnonzero(valid.any(axis=1)):
        calm, late = (
            [remove_slow(residuals[c, p][valid[c, p]]) for p in parts] for parts in (before, after)
        )
        if is_louder(late, calm):
            return before
    return problem.quiet


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
