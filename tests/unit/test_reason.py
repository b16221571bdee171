"""The sentence behind a verdict, `explain`, where sets leave nothing but noise: rows of few
numbers in, words out.
"""

from types import SimpleNamespace

import pytest
from made_sets import CONFIRMED, MILD, beside_base, row

from tractexp.discrepancy.decide import decide
from tractexp.discrepancy.explain import explain
from tractexp.inference.criteria import Criteria

CONTEXT = SimpleNamespace(
    catalogue=SimpleNamespace(label_effect=lambda name: name, candidates=range(3)),
    criteria=Criteria(),
    records=SimpleNamespace(window=None),
)


def tell(evidence):
    """The word of the verdict, and the sentence behind it."""
    verdict = decide(evidence, Criteria())
    return verdict.word, explain(verdict, evidence, None, CONTEXT)


@pytest.mark.parametrize(
    ("columns", "word", "doubt"),
    [
        ({"gap": CONFIRMED}, "named", ""),
        ({}, "candidate", "; no event was held out to confirm it"),
        ({"gap": MILD}, "candidate", "; the held-out events are too mild to show it"),
        (
            {"gap": CONFIRMED, "grade": "wrong_model"},
            "candidate",
            "; the model with it does not describe this load, so it is no name",
        ),
    ],
)
def test_a_name_says_what_it_was_set_against_and_why_it_is_no_more_than_a_candidate(
    columns, word, doubt
):
    told = "a explains the disagreement, and none of the 2 other effects tested does"
    assert tell(beside_base(row("a", **columns))) == (word, f"{told}{doubt}")


def test_what_only_all_events_show_is_told():
    evidence = beside_base(row(), base_p=0.5, p_of_all=1e-4)
    told = "the fitted events alone show no disagreement, but all events together do"
    assert tell(evidence) == ("unexplained", told)
