"""Which sets are fitted next, `shortlist`: made scores in, names out."""

from types import SimpleNamespace

import numpy as np

from tractexp.discrepancy.explanations import shortlist
from tractexp.inference.fitting import Refit

TEXTBOOK = {"a_of_other_law": "a"}


def step(fitted, drops):
    """The tests at the fit of a set, with what each effect would lower its deviance by."""
    catalogue = SimpleNamespace(textbook=lambda names: tuple(TEXTBOOK.get(n, n) for n in names))
    scores = [SimpleNamespace(name=name, drop=drop) for name, drop in drops.items()]
    fit = Refit(fitted, np.zeros(1), 100.0, len(fitted))
    return SimpleNamespace(context=SimpleNamespace(catalogue=catalogue), fit=fit, scores=scores)


def test_single_effects_are_fitted_in_the_order_of_what_they_lower():
    assert shortlist([step((), {"b": 9.0, "a": 30.0, "c": 20.0})], 1) == [("a",), ("c",), ("b",)]


def test_beside_a_law_of_another_form_its_own_textbook_is_not_sought():
    last = step(("a_of_other_law", "b"), {"a": 30.0, "b": 20.0, "c": 10.0})
    assert shortlist([step((), {}), last], 3) == [("a_of_other_law", "b", "c")]
