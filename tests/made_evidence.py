"""Tables of evidence written by hand, a row a set of effects, as docs/missing-effects.md has them
for a reader with a pencil.
"""

import numpy as np

from tractexp.discrepancy.evidence import Evidence, PredictedError, SetEvidence
from tractexp.discrepancy.gap import GapTest
from tractexp.inference.criteria import Criteria
from tractexp.inference.fitting import Refit


def fitted(deviance, parameters, *names):
    """A fit of these effects with so many parameters."""
    return Refit(names, np.zeros(0), deviance, parameters)


def held_out(gain, expected, left=0.0, criteria=None):
    """What held-out events say of a set."""
    criteria = criteria or Criteria()
    return GapTest(None, None, gain, left, expected, criteria.shown, None)


def closing(share, criteria=None):
    """A gap of which held-out events show so much explained."""
    return held_out(100.0, 100.0, 100.0 * (1 / share - 1), criteria)


CONFIRMED, MILD, DENIED = held_out(50.0, 55.0), held_out(3.0, 6.0), held_out(-2.0, 60.0)


def row(*names, deviance=0.0, **columns):
    """A set that leaves nothing of the fitted events, unless columns say otherwise."""
    fit = fitted(deviance, len(names), *names)
    return SetEvidence(fit, names, names, **{"behind": 0.0, "p_left": 1.0} | columns)


def table(*rows, base_p=0.0, **base):
    """These sets beside a base model that leaves something."""
    return Evidence(row(deviance=100.0, p_left=base_p, **base), rows)


def predicted(*names, squares, noise=0.0, deviance=0.0, stalls=()):
    """A set by what it leaves of held-out events in blocks of time, and of the fitted events."""
    blocks = np.ones(len(squares))
    error = PredictedError(np.asarray(squares), noise * blocks, blocks, np.zeros(0), stalls)
    return row(*names, deviance=deviance, behind=np.nan, prediction=error)
