"""Which sets are fitted next, `shortlist_sets`, and whether any is, `is_worth_another`: made scores
in, names out.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from made_sets import fitted

from tractexp.discrepancy.explanations import is_worth_another, shortlist_sets
from tractexp.inference.fitting import Refit

TEXTBOOK = {"a_of_other_law": "a"}


def step(fitted, drops):
    """The tests at the fit of a set, with what each effect would lower its deviance by."""
    catalogue = SimpleNamespace(textbook=lambda names: tuple(TEXTBOOK.get(n, n) for n in names))
    scores = [SimpleNamespace(name=name, drop=drop) for name, drop in drops.items()]
    fit = Refit(fitted, np.zeros(1), 100.0, len(fitted))
    return SimpleNamespace(context=SimpleNamespace(catalogue=catalogue), fit=fit, scores=scores)


def test_single_effects_are_fitted_in_the_order_of_what_they_lower():
    assert shortlist_sets([step((), {"b": 9.0, "a": 30.0, "c": 20.0})], 1) == [
        ("a",),
        ("c",),
        ("b",),
    ]


def test_beside_a_law_of_another_form_its_own_textbook_is_not_sought():
    last = step(("a_of_other_law", "b"), {"a": 30.0, "b": 20.0, "c": 10.0})
    assert shortlist_sets([step((), {}), last], 3) == [("a_of_other_law", "b", "c")]


@pytest.mark.parametrize(
    ("sets", "another"),
    [
        (((),), True),
        (((), ("a",)), True),
        (((), ("a",), ("a", "b")), False),
        # the pair led back to the same one: what follows would be the same search
        (((), ("a",), ("a",)), False),
        (((), ("a",), ("b",)), True),
    ],
)
def test_a_second_effect_is_tried_and_no_third(sets, another):
    assert (
        is_worth_another([SimpleNamespace(fit=fitted(0.0, len(names), *names)) for names in sets])
        == another
    )
