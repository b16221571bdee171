"""The free numbers of a fit, `FreeSet`: how far clocks are believed to be off."""

import numpy as np
import pytest

from tractexp.configuration.plugin import get
from tractexp.inference.catalogue import build_candidate
from tractexp.inference.context import FAULT_PRIOR
from tractexp.inference.free_set import FreeSet
from tractexp.parameter import Box


def deviation_of_skew(prior):
    """How far clocks are believed to be off [s]."""
    skew = build_candidate(get("effect", "time_skew")())
    known = {
        "of_measurement": ("time_skew",),
        "members": (),
        "__getitem__": lambda self, name: skew,
    }
    catalogue = type("One", (), known)()
    one = np.array([0.0])
    box = Box(one - 0.01, one + 0.01, ("skew",))
    at = FreeSet(box, one, one, one, 1, catalogue, prior)
    return at.prior_deviation[0] * at.width("skew")


def test_clocks_are_believed_to_be_off_by_a_few_milliseconds():
    assert deviation_of_skew(FAULT_PRIOR) == pytest.approx(0.005, rel=0.02)
    assert deviation_of_skew(2 * FAULT_PRIOR) == pytest.approx(0.01, rel=0.02)
