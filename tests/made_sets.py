"""Rows of evidence as few numbers: sets of effects by what they leave of held-out events."""

import numpy as np

from tractexp.discrepancy.evidence import Evidence, PredictedError, SetEvidence
from tractexp.inference.fitting import Refit

BLOCKS = 20


def off(*names, error, uneven=0.0):
    """A set whose squared error is so large, equal in all blocks or `uneven` among them."""
    pattern = 1 + uneven * np.cos(np.arange(BLOCKS) * (1 + len("".join(names))))
    nothing = np.zeros(BLOCKS)
    prediction = PredictedError(error**2 * pattern, nothing, np.ones(BLOCKS), nothing)
    return SetEvidence(Refit(names, nothing, 0.0, 1), names, names, prediction=prediction)


def table(*sets, term=None):
    """Evidence of these sets; the first is the base model."""
    return Evidence(sets[0], sets[1:], term=term)
