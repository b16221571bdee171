"""The verdict on a parameter, `judge`."""

from types import SimpleNamespace

import numpy as np

from tractexp.identification.verdict import IDENTIFIED, judge


def test_an_interval_that_reaches_past_the_bounds_says_so():
    information = SimpleNamespace(
        names=("T_m",),
        values=np.array([0.5]),
        unseen=np.zeros((0, 1)),
        identifiable=np.array([True]),
    )
    half = np.array([0.02])
    inside, past = (
        judge(information, np.array([0.0]), np.array([upper]), half, np.array([1.96]))["T_m"]
        for upper in (1.0, 0.51)
    )
    assert str(inside) == IDENTIFIED
    assert str(past) == f"{IDENTIFIED}: the interval reaches past its bounds"
