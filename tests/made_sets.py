"""Rows of evidence as few numbers: sets of effects by what they leave of held-out events, or by
what these say of sets that leave nothing of the fitted ones.
"""

import numpy as np

from tractexp.discrepancy.evidence import Evidence, PredictedError, SetEvidence
from tractexp.discrepancy.gap import GapTest
from tractexp.inference.criteria import Criteria
from tractexp.inference.fitting import Refit

BLOCKS = 20
SHOWN = Criteria().shown


def off(*names, error, uneven=0.0):
    """A set whose squared error is so large, equal in all blocks or `uneven` among them."""
    pattern = 1 + uneven * np.cos(np.arange(BLOCKS) * (1 + len("".join(names))))
    nothing = np.zeros(BLOCKS)
    prediction = PredictedError(error**2 * pattern, nothing, np.ones(BLOCKS), nothing)
    return SetEvidence(Refit(names, nothing, 0.0, 1), names, names, prediction=prediction)


def table(*sets, term=None):
    """Evidence of these sets; the first is the base model."""
    return Evidence(sets[0], sets[1:], term=term)


def fitted(deviance, parameters, *names):
    """A fit of these effects with so many parameters."""
    return Refit(names, np.zeros(0), deviance, parameters)


def held_out(gain, expected, left=0.0, shown=SHOWN):
    """What held-out events say of a set."""
    return GapTest(None, None, gain, left, expected, shown, None)


CONFIRMED, MILD, DENIED = held_out(50.0, 55.0), held_out(3.0, 6.0), held_out(-2.0, 60.0)


def row(*names, deviance=0.0, **columns):
    """A set that leaves nothing of the fitted events, unless columns say otherwise."""
    fit = fitted(deviance, len(names), *names)
    return SetEvidence(fit, names, names, **{"behind": 0.0, "p_left": 1.0} | columns)


def beside_base(*rows, base_p=0.0, **base):
    """Evidence of these sets; the base model leaves something of the fitted events."""
    return Evidence(row(deviance=100.0, p_left=base_p, **base), rows)
