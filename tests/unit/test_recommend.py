"""What to do next, `recommend_next`, by a verdict, a grade and rows of few numbers."""

from types import SimpleNamespace

import pytest
from made_sets import DENIED, MILD, beside_base, off, row, table

from tractexp.discrepancy.recommend import recommend_confirmation, recommend_next
from tractexp.identification.adequacy import Grade
from tractexp.inference.criteria import Criteria


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
        context=SimpleNamespace(criteria=Criteria()),
    )
    assert recommend_next(findings).startswith(told)


TERM = SimpleNamespace(term=SimpleNamespace(words="a torque that falls"))
DIP = SimpleNamespace(sentence=lambda: "record a deep dip")


def recommend(word, grade="adequate", event=None, term=None, evidence=None):
    """What to do next of a verdict and a grade; a candidate is confirmed by an event as deep."""
    findings = SimpleNamespace(
        next_event=event,
        unrecorded_course={},
        verdict=SimpleNamespace(word=word),
        proposed=SimpleNamespace(proposal=term),
        final_grade=SimpleNamespace(adequacy=SimpleNamespace(grade=Grade(grade))),
        evidence=evidence or beside_base(row("a")),
        names=("a",),
        undetermined_values={},
        context=SimpleNamespace(
            events=[SimpleNamespace(record=SimpleNamespace(name="dip1"))], criteria=Criteria()
        ),
        train=SimpleNamespace(by_event=(400.0,)),
        all_fitted=False,
    )
    return recommend_next(findings)


@pytest.mark.parametrize(
    ("choice", "told"),
    [
        ({"word": "named"}, "use the extended model; judge it on further events"),
        ({"word": "named", "grade": "effect_missing"}, "find what is missing still: "),
        ({"word": "candidate"}, "record a further dip as deep as dip1 and hold it out: "),
        ({"word": "candidate", "grade": "wrong_model"}, "find what is missing still: "),
        ({"word": "none"}, "use the base model; what is missing, if anything, is below"),
        (
            {"word": "none", "evidence": table(off(error=0.1))},
            "use the base model: what it misses is no difference to anyone",
        ),
        ({"word": "tied", "event": DIP}, "record a deep dip"),
    ],
)
def test_what_to_do_next_follows_from_the_word_and_the_grade(choice, told):
    assert recommend(**choice).startswith(told)


@pytest.mark.parametrize(("event", "end"), [(None, "to a model"), (DIP, "; record a deep dip")])
def test_a_proposed_term_is_asked_for_on_site(event, end):
    told = recommend("unexplained", event=event, term=TERM)
    assert told.startswith("ask what on site acts like a torque that falls; ")
    assert told.endswith(end)
