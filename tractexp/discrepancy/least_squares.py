"""Fits and tests where what is left is no noise: least squares, every channel alike.

Under a wrong model the likelihood of the noise before the dip is no likelihood: a few samples at
the edges, many times louder than that noise, bend every parameter. Least squares asks for no noise,
and the covariance of its estimates holds where residuals are correlated within blocks, and where
they are noise.

Source: White 1982; Bell and McCaffrey 2002 (CR3), as in `tractexp.inference.sandwich`.
"""

from dataclasses import replace

import numpy as np

from tractexp.discrepancy.disagreement import Disagreement
from tractexp.inference.blocks import cut_blocks
from tractexp.inference.chance import draw_chance
from tractexp.inference.context import Context
from tractexp.inference.fitting import Refit
from tractexp.inference.linearization import linearize_fit, remove_explained
from tractexp.inference.noise_in_quiet import QuietNoise
from tractexp.inference.sandwich import compute_moves_without_blocks, compute_robust_root
from tractexp.inference.score_test import ScoreTest
from tractexp.noise import Noise


def estimate_residual_noise(context: Context, fit: Refit) -> Noise:
    """White noise as loud as what a fit leaves, alike in each channel.

    Under it the deviance is the sum of squares by which names are judged.
    """
    residual = context.residual(fit.unit, fit.names)
    level = float(np.sqrt(np.mean(residual[context.valid] ** 2)))
    return Noise(Noise.white(*[level] * len(residual)).pairs, np.eye(len(residual)))


def examine_least_squares(quiet: QuietNoise, fit: Refit, noise: Noise, seed: int) -> Disagreement:
    """All tests at a fit by least squares, under the noise that it shows where little happens, and
    a covariance of its parameters that holds where what it leaves is no noise. It was fitted under
    `noise`, that of `estimate_residual_noise`.
    """
    quiet = replace(quiet, context=quiet.context.with_measured_power)
    t = linearize_fit(quiet.context, fit, noise)
    root = _compute_robust_rows(quiet.context, t.build_score_test(noise))
    own = quiet.estimate_noise(
        fit.unit, remove_explained(t, t.residual[None])[0], t.residual, t.explaining_columns
    )
    projection = t.build_score_test(own)
    chance = draw_chance(t, projection, own, seed)
    return Disagreement(fit, own, t, projection, chance, root)


def _compute_robust_rows(context: Context, projection: ScoreTest) -> np.ndarray:
    """Rows (k, d) whose inverse products are the covariance of all that is free, from blocks left
    out in turn.
    """
    J = projection.Q @ projection.R  # with the rows of the prior
    r = projection.r[0] + projection.Q @ projection.along[0]
    measured = context.drive.measurements
    columns = J[: measured.size].reshape(*measured.shape, -1)
    rows = r[: measured.size].reshape(measured.shape)
    blocks = cut_blocks(context.events, context.drive, J.shape[1])
    return compute_robust_root(J, compute_moves_without_blocks(columns, rows, blocks, J.T @ J))[0]
