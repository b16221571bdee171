"""The decision by itself, `decide`: numbers in, a word out, as docs/missing-effects.md has it for a
reader with a pencil.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tractexp.discrepancy.decide import decide
from tractexp.discrepancy.evidence import Evidence, PredictedError, SetEvidence
from tractexp.discrepancy.gap import GapTest
from tractexp.discrepancy.ranking import beats, find_nearest, rank_sets
from tractexp.inference.criteria import Criteria
from tractexp.inference.fitting import Refit


def held_out(gain, expected):
    return GapTest(None, None, gain, 0.0, expected, Criteria().shown, None)


def row(*names, deviance=0.0, **columns):
    """A set that leaves nothing of the fitted events, unless columns say otherwise."""
    fit = Refit(names, np.zeros(0), deviance, len(names))
    return SetEvidence(fit, names, names, **{"behind": 0.0, "p_left": 1.0} | columns)


def word(*rows, base_p=0.0, **base):
    """The verdict on these sets beside a base model that leaves something."""
    verdict = decide(Evidence(row(deviance=100.0, p_left=base_p, **base), rows), Criteria())
    return verdict.word, verdict.sets


CONFIRMED, MILD, DENIED = held_out(50.0, 55.0), held_out(3.0, 6.0), held_out(-2.0, 60.0)


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
    base = off(error=held_out, deviance=100.0)
    base = replace(base, fitted_error=off(error=fitted, deviance=0.0).prediction)
    verdict = decide(Evidence(base, ()), Criteria())
    assert (verdict.word, verdict.complete) == (told, False)


def test_of_one_family_the_best_member_is_kept():
    member = replace(row("a_member", behind=2.0, gap=CONFIRMED), family=("a",))
    assert word(row("a", gap=CONFIRMED), member) == ("named", (("a",),))


def off(*names, error, deviance):
    """A set by what it leaves of held-out events in twenty blocks, and of the fitted events."""
    blocks = np.ones(20)
    prediction = PredictedError(error**2 * blocks, 0 * blocks, blocks, np.zeros(0))
    return replace(row(*names, deviance=deviance), behind=np.nan, prediction=prediction)


@pytest.mark.parametrize(
    ("share", "told"),
    [(0.9, "named"), (0.49, "candidate"), (np.nan, "candidate"), (None, "candidate")],
)
def test_what_held_out_events_chose_is_named_if_each_event_left_out_in_turn_shows_it(share, told):
    """Whatever the fitted events alone put first."""
    a = replace(off("a", error=0.1, deviance=50.0), replicated_share=share)
    sets = a, off("b", error=0.9, deviance=40.0)
    verdict = decide(Evidence(off(error=1.0, deviance=100.0), sets), Criteria())
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
        rows.append(
            row(
                name.strip("`"),
                behind=behind,
                p_left=p_left,
                gap=held_out(gain, expected),
                **of_all,
            )
        )
    assert word(*rows) == ("named", (("undervoltage_trip",),))


def test_however_much_a_set_that_survives_leaves_it_is_ahead_of_one_that_stalls():
    """A set that stalls leaves all: no fit brings it before one that does not."""
    blocks = np.ones(10)

    def predicted(*names, squares, deviance, stalls=()):
        error = PredictedError(squares, 0.01 * blocks, blocks, np.zeros(1), stalls)
        return row(*names, deviance=deviance, prediction=error)

    stalling = predicted("a", squares=np.inf * blocks, deviance=1.0, stalls=("dip3",))
    surviving = predicted("b", squares=1e6 * blocks, deviance=1e6)
    base = predicted(squares=np.inf * blocks, deviance=1e9, stalls=("dip3",))
    table, criteria = Evidence(base, (stalling, surviving)), Criteria()
    assert rank_sets(table, criteria) == [surviving, stalling]
    assert find_nearest(table, criteria) is surviving
    assert beats(surviving, stalling, criteria)
    assert beats(surviving, base, criteria)
    assert not beats(stalling, base, criteria)
