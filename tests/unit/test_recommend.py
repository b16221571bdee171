"""What to do next, `recommendation`, and the sentence behind a verdict, of rows of few numbers."""

from types import SimpleNamespace

import pytest
from made_sets import CONFIRMED, DENIED, MILD, beside_base, row

from tractexp.discrepancy.decide import decide
from tractexp.discrepancy.explain import explain
from tractexp.discrepancy.recommend import recommend_confirmation, recommendation
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


@pytest.mark.parametrize(
    ("by_event", "told"),
    [
        ((20.0, 400.0), "hold out deep, or a further dip as deep: a, if right, gains"),
        ((400.0,), "record a further dip as deep as mild and hold it out: a, if right, gains"),
        ((3.0, 5.0), "record a deeper dip than those fitted and hold it out: none of them shows a"),
    ],
)
def test_a_candidate_is_confirmed_by_the_event_that_shows_most_of_it(by_event, told):
    """What each of the fitted events would gain, were the candidate right."""
    events = [SimpleNamespace(record=SimpleNamespace(name=name)) for name in ("mild", "deep")]
    findings = SimpleNamespace(
        names=("a",),
        evidence=beside_base(row("a")),
        context=SimpleNamespace(events=events, criteria=Criteria()),
        train=SimpleNamespace(by_event=by_event),
        all_fitted=False,
    )
    assert recommend_confirmation(findings).startswith(told)


@pytest.mark.parametrize(
    ("evidence", "told"),
    [
        (beside_base(row("a", gap=MILD), p_of_all=1e-4), "hold out a deeper dip"),
        (
            beside_base(row("a", gap=DENIED), p_of_all=1e-4),
            "fit the held-out events, too (data.train)",
        ),
        (beside_base(row("a", gap=DENIED)), "look at what is left (unexplained.csv)"),
    ],
)
def test_what_to_do_where_nothing_explains_follows_from_the_held_out_events(evidence, told):
    findings = SimpleNamespace(
        next_event=None,
        unrecorded_course={},
        verdict=SimpleNamespace(word="unexplained"),
        proposed=SimpleNamespace(proposal=None),
        by_likelihood=evidence,
        context=CONTEXT,
    )
    assert recommendation(findings).startswith(told)
