"""The sentence behind a verdict, `explain`, where sets go by what they predict: rows of a few
numbers in, words out.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_sets import beside_base, off, row, table

from tractexp.discrepancy.evidence import Verdict
from tractexp.discrepancy.explain import explain, explain_rest
from tractexp.discrepancy.proposal.library import find_term
from tractexp.inference.criteria import Criteria

TERM = "answer:torque:slip"
WORDS = f"the best term of the library ({find_term(TERM).words})"


def sentence_on(evidence, word="unexplained", *kept):
    """The sentence where these rows are kept, of effects a, b, c that are told by their names."""
    effects = SimpleNamespace(candidates="abc", label_effect=str)
    context = SimpleNamespace(
        criteria=Criteria(), catalogue=effects, records=SimpleNamespace(window=None)
    )
    return explain(Verdict(word, kept, False), evidence, None, context)


def test_a_name_is_told_beside_what_the_base_model_the_next_set_and_the_best_term_miss():
    one = off("a", error=0.2)
    sets = table(off(error=1.0), one, off("b", error=0.9), term=off(TERM, error=0.3))
    told = sentence_on(sets, "named", replace(one, replicated_share=0.9))
    assert told.startswith(
        "a predicts the held-out events within 20 % of the response, where the base model misses"
        f" 100 %, the next best of 1 other sets (b) 90 % and {WORDS} 30 %;"
    )
    assert told.endswith("; each event, left out in turn, confirms it")


def test_sets_that_predict_alike_are_told_as_alternatives_with_their_errors():
    one, other = off("a", error=0.2), off("b", error=0.21)
    sets = table(off(error=1.0), one, other, term=off(TERM, error=0.9))
    assert sentence_on(sets, "tied", one, other).startswith(
        "a or b: they predict the held-out events within 20 % and 21 % of the response, which"
        " cannot tell them apart, where the base model misses 100 %"
    )


def test_a_name_that_the_best_term_takes_is_told_with_what_both_miss():
    sets = table(off(error=1.0), off("a", error=0.3), term=off(TERM, error=0.1))
    assert sentence_on(sets) == (
        "a would be named, but misses 30 % of the response of the held-out events,"
        f" and {WORDS} 10 %"
    )


def test_a_name_that_an_event_left_out_denies_is_told_with_why():
    """Not with the best term of the library, which is there and leaves more."""
    denied = replace(off("a", error=0.1), replicated_share=-0.2)
    sets = table(off(error=1.0), denied, term=off(TERM, error=0.9))
    assert sentence_on(sets) == (
        "a would be named, but of what an event shows of it 0% is left where that is not fitted:"
        " 50% of each confirms it"
    )


def test_a_set_that_divides_the_error_by_too_little_is_the_nearest():
    assert sentence_on(table(off(error=1.0), off("a", error=0.6))) == (
        "the model and the records disagree, and none of the 3 effects tested predicts the held-out"
        " events well enough to be named: a, the nearest, misses 60 % of the response there, where"
        " the base model misses 100 %; a name must divide that by 2.25"
    )


def test_a_lead_of_few_blocks_is_said_to_be_chance():
    bare, one = off(error=1.0), off("a", error=0.3)
    bare.prediction.squares[3] += 60.0
    one.prediction.squares[4] += 3.0
    assert sentence_on(table(bare, one)).endswith("; that may be chance in so few blocks")


def test_a_pair_that_hardly_needs_its_second_is_said_to_do_so():
    bare, one, pair = off(error=1.0), off("a", error=0.3), off("a", "b", error=0.4)
    bare.prediction.squares[3] += 60.0
    one.prediction.squares[4] += 3.0
    told = sentence_on(table(bare, one, pair))
    assert "none of the 3 effects tested, alone or up to 2 together," in told
    assert "a and b, the nearest, miss" in told
    assert told.endswith("; one of them alone does hardly worse")


def test_where_no_set_beats_the_base_model_none_is_near():
    assert sentence_on(table(off(error=0.1), off("a", error=0.2))) == (
        "the model and the records disagree, and none of the 3 effects tested predicts the held-out"
        " events better than the base model, which misses 10 % of the response there"
    )


@pytest.mark.parametrize(("error", "is_told"), [(0.5, True), (0.4, False)])
def test_what_does_not_divide_the_error_by_itself_is_told_with_the_best_set_that_has_it(
    error, is_told
):
    one, pair = off("a", error=error), off("a", "b", error=0.35)
    sets = table(off(error=1.0), one, pair, term=off(TERM, error=0.9))
    told = sentence_on(sets, "named", replace(one, replicated_share=0.9))
    assert ("; a and b miss 35 %, the least, and all sets that come near have it;" in told) == (
        is_told
    )


@pytest.mark.parametrize(
    ("names", "faults", "told"),
    [
        (
            ("dc_link_lag", "inrush"),
            ("load_change",),
            "dc_link_lag and inrush beside load_change, the nearest, close 66% of the gap",
        ),
        (
            ("dc_link_lag",),
            ("load_change",),
            "dc_link_lag beside load_change, the nearest, closes 66%",
        ),
        ((), ("load_change", "time_skew"), "load_change and time_skew, the nearest, close 66%"),
        (("dc_link_lag",), (), "dc_link_lag, the nearest, closes 66%"),
    ],
)
def test_faults_of_the_measurement_are_not_counted_among_the_effects_together(names, faults, told):
    catalogue = SimpleNamespace(label_effect=lambda name: name, candidates=range(19))
    context = SimpleNamespace(catalogue=catalogue)
    tests = SimpleNamespace(loudest="pushes into the balances")
    best = row(*names, p_left=0.001, tests=tests)
    evidence = replace(beside_base(best), faults=faults)
    assert told in explain_rest(evidence, SimpleNamespace(closed_shares=(0.66, 0.5)), context)
    assert "nan" not in explain_rest(
        evidence, SimpleNamespace(closed_shares=(np.nan, np.nan)), context
    )
