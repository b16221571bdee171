"""The motors' part of the load: a lower bound where the profile stays flat to the end of its range,
nothing where the records tell it on both sides.
"""

import functools

import numpy as np
import pytest

import tractexp

TRUTH = {"T_prime": 0.12, "X_prime": 0.25, "C": 0.9, "M": 0.006, "T_m": 0.5}
STATIC = {"p_v": 1.4, "q_v": 3.0}
SHAPE = {"depth": 0.3, "duration": 0.2, "rate": 100, "length": 1.5, "P0": 0.9, "Q0": 0.35}


@functools.cache
def identify(noise, upper):
    """A fit to one dip with so much noise [pu], the torque held to less than `upper`."""
    made = tractexp.simulate(tractexp.compose(), TRUTH | STATIC, **SHAPE)
    frame = made.responses[0].to_frame()
    drawn = np.random.default_rng(5).standard_normal((len(frame), 2))
    frame[["P", "Q"]] += noise * drawn
    return tractexp.identify(
        frame,
        bounds={"T_m": (0.05, upper)},
        optimizer="multistart_least_squares",
        budget=600,
        progress=False,
    )


def test_a_share_that_may_be_anything_above_is_told_as_a_lower_bound():
    fit = identify(0.05, 0.55)
    bound = fit.result.share_bound
    low, high = fit.result.intervals["T_m"]
    assert high == pytest.approx(0.55, abs=1e-3)
    P0 = fit.result.before["P0"]
    assert bound["low"] == pytest.approx(low / P0)
    assert bound["low"] < TRUTH["T_m"] / P0 < bound["high"]
    errors = {row["share"]: row["error"] for row in bound["profile"]}
    assert min(errors.values()) >= 1
    assert errors[min(errors)] > errors[max(errors)]
    sentence = f"the motors draw at least {bound['low']:.0%} of P"
    assert sentence in bound["sentence"]
    for text in (str(fit.screen()), str(fit.summary()), fit.report().html):
        assert "motors draw at least" in text


def test_a_share_that_the_records_tell_is_no_bound():
    fit = identify(1e-3, 1.0)
    assert fit.result.share_bound == {}
    assert "at least" not in str(fit.screen())
