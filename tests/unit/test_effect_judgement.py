"""What the data say of each effect, `judge_effects`, and of one outside the model, `assess_effect`:
a score in, a word out.
"""

from types import SimpleNamespace

import pytest

from tractexp.configuration.plugin import get
from tractexp.discrepancy.judgement import assess_effect, judge_effects
from tractexp.inference.catalogue import build_candidate
from tractexp.inference.score_test import Score

LEAST = 0.01  # pu, the smallest relevant stator resistance
CRITICAL = 0.05


def judge(size=0.0, deviation=0.001, p=0.5):
    """The word on a stator resistance of one linear step's size and deviation."""
    score = Score("stator_resistance", 0.0, p, {"R_s": size}, {"R_s": deviation}, {})
    return assess_effect(build_candidate(get("effect", "stator_resistance")()), score, CRITICAL)[0]


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


def test_every_effect_has_a_status_and_the_reason():
    names = ("stator_resistance", "second_cage", "time_skew", "load_change")
    score = Score("stator_resistance", 0.0, 0.5, {"R_s": 0.0}, {"R_s": 0.001}, {})
    effects = {name: build_candidate(get("effect", name)()) for name in names}
    findings = SimpleNamespace(
        context=SimpleNamespace(criteria=SimpleNamespace(naming_false_alarms=0.02)),
        first=SimpleNamespace(chance=SimpleNamespace(critical_p=lambda p: p)),
        last=SimpleNamespace(
            scores=[score], fit=SimpleNamespace(names=("second_cage", "time_skew"))
        ),
        catalogue=SimpleNamespace(
            untestable={"frequency_dependence": "f is not recorded"}, candidates=effects.values()
        ),
        names=("second_cage",),
    )
    told = {one.name: (one.status, one.why) for one in judge_effects(findings)}
    assert told.pop("stator_resistance") == (
        "ruled out",
        "beside second_cage and time_skew, R_s is within 0.0016 pu of 0",
    )
    assert told == {
        "frequency_dependence": ("not testable", "f is not recorded"),
        "load_change": ("irrelevant", "in the fit as a nuisance, not above its noise"),
        "second_cage": ("relevant", "added"),
        "time_skew": ("relevant", "in the best explanation, which was not accepted"),
    }
