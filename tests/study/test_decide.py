"""The decision by itself, `decide`: numbers in, a word out, as docs/missing-effects.md has it for a
reader with a pencil.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_sets import CONFIRMED, DENIED, MILD, beside_base, fitted, held_out, off, row, table

from tractexp.configuration.plugin import get
from tractexp.discrepancy.decide import decide
from tractexp.discrepancy.ranking import beats, find_nearest, rank_sets
from tractexp.inference.criteria import Criteria


def word(*rows, **base):
    """The verdict on these sets beside a base model that leaves something."""
    verdict = decide(beside_base(*rows, **base), Criteria())
    return verdict.word, verdict.sets


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        ([row("a", gap=CONFIRMED)], "named"),
        ([row("a")], "candidate"),  # no event was held out
        ([row("a", gap=MILD)], "candidate"),
        ([row("a", gap=CONFIRMED, grade="wrong_model")], "candidate"),
        ([row("a", gap=CONFIRMED, grade="effect_missing")], "named"),
        ([row("a", gap=CONFIRMED, open_sizes=("a rests on its bound, 1",))], "candidate"),
        ([row("a", gap=DENIED)], "unexplained"),
        ([row("a", gap=CONFIRMED, p_of_all=1e-4)], "unexplained"),
        ([row("a", gap=CONFIRMED, behind_of_all=6.1)], "unexplained"),
        ([row("a", p_left=1e-4)], "unexplained"),
        ([row("a", "b", gap=CONFIRMED, without={"a": CONFIRMED, "b": CONFIRMED})], "named"),
        ([row("a", "b", gap=CONFIRMED, without={"a": CONFIRMED, "b": MILD})], "candidate"),
        ([row("a", "b", gap=CONFIRMED, without={"a": CONFIRMED, "b": DENIED})], "unexplained"),
        # so many together are never a name
        ([row("a", "b", "c", gap=CONFIRMED, without=dict.fromkeys("abc", CONFIRMED))], "candidate"),
        ([row("a", gap=CONFIRMED), row("b", behind=5.9, gap=MILD)], "tied"),
        ([row("a", gap=CONFIRMED), row("b", behind=6.1, gap=CONFIRMED)], "named"),
        ([row("a", gap=CONFIRMED), row("b", behind=3.0, gap=DENIED)], "named"),
        # the best leaves something
        ([row("a", p_left=1e-4), row("b", behind=3.0, gap=CONFIRMED)], "unexplained"),
    ],
)
def test_a_word_follows_from_the_numbers_of_the_sets(rows, told):
    assert word(*rows)[0] == told


@pytest.mark.parametrize(
    ("chosen", "rival", "kept"),
    [
        (1.0, 0.03, (("a",), ("b",))),
        (1.0, 0.0008, (("a",),)),  # it leaves something of all events
        (0.0008, 0.03, (("b",),)),
        (0.0008, 0.0008, ()),
    ],
)
def test_an_explanation_is_kept_by_what_it_leaves_of_all_events(chosen, rival, kept):
    rows = [row(name, gap=CONFIRMED, p_of_all=p) for name, p in (("a", chosen), ("b", rival))]
    assert word(*rows)[1] == kept


def test_where_no_set_is_kept_the_base_model_decides():
    assert word(row(p_left=0.5), base_p=0.5)[0] == "none"
    assert word(row(p_left=0.5), base_p=0.5, p_of_all=1e-4)[0] == "unexplained"
    assert word(row("a", gap=DENIED), base_p=0.5)[0] == "none"
    assert word(row("a", gap=DENIED), base_p=1e-4)[0] == "unexplained"


def test_a_set_without_a_size_in_the_graded_model_is_the_base_model_whose_grade_decides():
    absent = row("a", gap=CONFIRMED, is_absent=True)
    assert word(absent, grade="adequate") == ("none", ())
    assert word(absent, grade="effect_missing") == ("unexplained", ())
    assert word(row("a", is_absent=True), grade="adequate") == ("none", ())


@pytest.mark.parametrize(
    ("fitted", "held_out", "told"),
    [(0.009, 0.009, "none"), (0.009, 0.011, "unexplained"), (0.011, 0.009, "unexplained")],
)
def test_a_base_model_that_leaves_less_than_matters_of_all_events_lacks_nothing(
    fitted, held_out, told
):
    """A held-out dip too mild for what the fitted ones show does not hide that."""
    base = replace(off(error=held_out), fitted_error=off(error=fitted).prediction)
    verdict = decide(table(base), Criteria())
    assert (verdict.word, verdict.complete) == (told, False)


@pytest.mark.parametrize("share", [np.nan, 0.0, -3.7])
def test_what_each_event_left_out_denies_is_kept_only_where_it_alone_explains(share):
    """A skew of clocks was a candidate of two loads that lack nothing, and three effects together
    of one that each event lost nothing by.
    """
    denied = row("a", gap=MILD, is_fitted_to_all=True, replicated_share=share)
    assert word(denied, base_p=0.5) == ("none", ())
    assert word(denied, base_p=1e-4) == ("candidate", (("a",),))
    predicted = replace(off("a", error=0.1), replicated_share=share)
    told = decide(table(off(error=1.0), predicted), Criteria()).word
    assert told == ("candidate" if np.isnan(share) else "unexplained")


@pytest.mark.parametrize(("expected", "told"), [(10.7, "none"), (10.9, "candidate")])
def test_what_the_squares_hide_is_denied_only_where_the_likelihood_hides_it_too(expected, told):
    """A drift that gains 1,900 held out is hidden in each event's squares, and a noise that wanders
    explains it.
    """
    gap = held_out(12.0, expected)
    hidden = row("a", gap=gap, is_fitted_to_all=True, replicated_share=np.nan)
    assert word(hidden, base_p=0.5)[0] == told


def test_of_one_family_the_best_member_is_kept():
    member = replace(row("a_member", behind=2.0, gap=CONFIRMED), family=("a",))
    assert word(row("a", gap=CONFIRMED), member) == ("named", (("a",),))


@pytest.mark.parametrize(
    ("share", "told"),
    [(0.9, "named"), (0.49, "candidate"), (0.01, "candidate"), (None, "candidate")],
)
def test_what_held_out_events_chose_is_named_if_each_event_left_out_in_turn_shows_it(share, told):
    """Whatever the fitted events alone put first."""
    a = replace(off("a", error=0.1), replicated_share=share)
    verdict = decide(table(off(error=1.0), a, off("b", error=0.9)), Criteria())
    assert (verdict.word, verdict.names, verdict.complete) == (told, ("a",), False)


@pytest.mark.parametrize("columns", [{}, {"gap": CONFIRMED, "is_fitted_to_all": True}])
def test_what_all_events_were_fitted_to_is_named_if_each_left_out_in_turn_shows_it(columns):
    assert word(row("a", **columns))[0] == "candidate"
    assert word(row("a", replicated_share=0.3, **columns))[0] == "candidate"
    assert word(row("a", replicated_share=0.6, **columns))[0] == "named"


def test_the_page_s_own_numbers_give_the_verdict_that_it_tells():
    """The table of the shipped contactors: a column a set, to be checked by hand."""
    page = (Path(__file__).parents[2] / "docs" / "missing-effects.md").read_text(encoding="utf-8")
    lines = re.findall(
        r"^\| (.+?) \|(?: .+?)? \| (.+?) \| (.+?) \|$", page.split("### The decision")[1], re.M
    )
    cells = {what.replace("`", ""): values for what, *values in lines}
    rows = []
    for k, name in enumerate(cells["number"]):
        behind, p_left, gain, expected, p_of_all, behind_of_all = (
            float(cells[what][k])
            for what in ("behind", "p_left", "gain", "expected", "all p_left", "all behind")
        )
        of_all = {"p_of_all": p_of_all, "behind_of_all": behind_of_all}
        effect = get("effect", name.strip("`"))
        one = row(
            effect.name,
            behind=behind,
            p_left=p_left,
            gap=held_out(gain, expected),
            **of_all,
        )
        rows.append(replace(one, family=(effect.family or effect.name,)))
    assert word(*rows) == ("named", (("undervoltage_trip",),))


def test_however_much_a_set_that_survives_leaves_it_is_ahead_of_one_that_stalls():
    """A set that stalls leaves all: no fit brings it before one that does not."""

    def stall(row):
        return replace(row, prediction=replace(row.prediction, stalls=("dip3",)))

    stalling, base = stall(off("a", error=np.inf)), stall(off(error=np.inf))
    surviving = replace(off("b", error=1e3), fit=fitted(1e6, 1, "b"))
    sets, criteria = table(base, stalling, surviving), Criteria()
    assert rank_sets(sets, criteria) == [surviving, stalling]
    assert find_nearest(sets, criteria) is surviving
    assert beats(surviving, stalling, criteria)
    assert beats(surviving, base, criteria)
    assert not beats(stalling, base, criteria)
