"""Events of the printed equations with noise, and the least squares of a likelihood."""

import numpy as np
import uncertainty as study
from written_out import printed_dip

from tractexp.inference.least_squares import descend
from tractexp.inference.problem import Problem

NOISE = 0.004  # of a single dip


def problem(events, bounds=None, load=None):
    """That of a load model, by default that of third order."""
    return Problem(load or study.model(), events, bounds)


def records(depths, deviation, seed=1, truth=study.TYPICAL, correlation=0.0, Q_s0=0.35):
    """One event a depth; the noise deviates by so much and is correlated from sample to sample."""
    rng = np.random.default_rng(seed)
    made = []
    for k, depth in enumerate(depths):
        t, U = study.Shape(depth).voltage()
        clean = printed_dip(depth, tuple(truth), Q_s0)
        made.append(
            study.event(
                t, U, clean + study.noise(rng, len(t), deviation, correlation), f"dip {k + 1}"
            )
        )
    return made


def one_dip(error=None, depth=0.5, seed=5, Q_s0=0.35, bounds=None):
    """The problem of one dip with white noise, and an `error` (2, N) besides."""
    t, U = study.Shape(depth).voltage()
    power = printed_dip(depth, tuple(study.TYPICAL), Q_s0)
    power = power + NOISE * np.random.default_rng(seed).standard_normal(power.shape)
    return problem([study.event(t, U, power + (0 if error is None else error))], bounds)


def minimum(likelihood, start, held=None, **settings):
    """The coordinates (d,) near those of the start where the rows of a likelihood are least."""
    frozen = None if held is None else np.isin(np.arange(len(start)), held)[None]
    settings = {"tolerance": 1e-8, **settings}
    return descend(likelihood.rows, start[None], frozen, **settings).unit[0]
