"""Events of the printed equations with noise."""

import numpy as np
import uncertainty as study
from written_out import printed_dip


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
