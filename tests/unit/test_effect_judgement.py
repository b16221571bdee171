"""What the data say of an effect outside the model, `assessment`: a score in, a word out."""

import pytest

from tractexp.configuration.plugin import get
from tractexp.discrepancy.judgement import assessment
from tractexp.inference.catalogue import candidate
from tractexp.inference.score_test import Score

LEAST = 0.01  # pu, the smallest relevant stator resistance
CRITICAL = 0.05


def judge(size=0.0, deviation=0.001, p=0.5):
    """The word on a stator resistance of one linear step's size and deviation."""
    score = Score("stator_resistance", 0.0, p, {"R_s": size}, {"R_s": deviation}, {})
    return assessment(candidate(get("effect", "stator_resistance")()), score, CRITICAL)[0]


@pytest.mark.parametrize(
    ("score", "word"),
    [
        ({}, "ruled out"),
        ({"size": 0.02}, "irrelevant"),
        ({"p": 0.04}, "relevant"),
        ({"deviation": float("inf")}, "not testable"),
    ],
)
def test_an_effect_is_judged_by_its_score_and_by_how_well_its_size_is_known(score, word):
    assert judge(**score) == word


@pytest.mark.parametrize(("power", "is_testable"), [(0.6745, False), (1.0364, True)])
def test_an_effect_is_testable_that_would_be_seen_with_four_chances_in_five(power, is_testable):
    """At its smallest relevant size; the normal quantiles are those of 0.75 and 0.85."""
    word = judge(deviation=LEAST / (1.6449 + power))
    assert (word != "not testable") == is_testable
