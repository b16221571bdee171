"""Which sets `prediction` seeks beside those that predict best, with searches that only say what
they are asked for.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from made_sets import off

from tractexp.discrepancy import prediction
from tractexp.inference.fitting import Refit

# five effects of the load, a law of the first by another form, and a fault of the measurement
CATALOGUE = SimpleNamespace(
    of_load=("a", "b", "c", "d", "e"),
    textbook=lambda names: tuple({"a_of_other_law": "a"}.get(name, name) for name in names),
)
EFFORT = SimpleNamespace(say=lambda line: None)


def fit(*names, deviance=0.0):
    return Refit(names, np.zeros(1), deviance, len(names))


@pytest.fixture
def ground():
    """The tests of the base model."""
    return SimpleNamespace(
        context=SimpleNamespace(catalogue=CATALOGUE, effort=EFFORT),
        noise=None,
        score_fit=lambda context, fit, noise: SimpleNamespace(fit=fit),
    )


def test_a_second_is_sought_beside_the_best_law_of_each_of_the_two_best_families():
    fits = [
        fit("a", deviance=20.0),
        fit("a_of_other_law", deviance=10.0),
        fit("fault", deviance=11.0),
        fit("b", "c", deviance=12.0),
        fit("b", deviance=30.0),
        fit("c", deviance=40.0),
    ]
    chosen = prediction.select_grounds(CATALOGUE, fits)
    assert [one.names for one in chosen] == [("a_of_other_law",), ("b",)]


def pairs_sought(monkeypatch, ground, known, ranked):
    monkeypatch.setattr(
        prediction, "list_starts", lambda steps, refits, pair: [(pair, np.zeros(1))]
    )
    monkeypatch.setattr(prediction, "refit_sets", lambda context, noise, begin: begin)
    refits = {names: fit(*names) for names in known}
    return [names for names, _ in prediction.search_best_pairs(ground, refits, ranked)]


def test_all_pairs_of_the_four_singles_that_predict_best_are_tried(monkeypatch, ground):
    """Of station xtz T1's waveforms the pair that predicts best has no member that fits best."""
    best_first = [("b",), ("a", "b"), ("a",), ("fault",), ("d",), ("c",), ("e",)]
    ranked = [off(*names, error=0.1) for names in best_first]
    assert sorted(pairs_sought(monkeypatch, ground, [("a", "b")], ranked)) == [
        ("a", "c"),
        ("a", "d"),
        ("b", "c"),
        ("b", "d"),
        ("c", "d"),
    ]


def test_where_all_pairs_were_fitted_none_is_tried(monkeypatch, ground):
    ranked = [off("a", error=0.1), off("b", error=0.2)]
    assert pairs_sought(monkeypatch, ground, [("a", "b")], ranked) == []


@pytest.mark.parametrize(
    ("best", "error", "is_sought"),
    [
        (("a", "b"), 0.02, True),
        (("a", "b"), 0.009, False),  # less than anyone cares about
        (("a",), 0.02, False),
        (("a", "fault"), 0.02, False),
    ],
)
def test_a_third_is_sought_beside_two_effects_of_the_load_that_leave_what_matters(
    monkeypatch, ground, best, error, is_sought
):
    asked = []

    def search(steps, refits, size, say):
        asked.append(([step.fit.names for step in steps[1:]], size))
        return ["found"]

    monkeypatch.setattr(prediction, "search_effect_sets", search)
    found = prediction.search_third(ground, {}, [off(*best, error=error)])
    assert asked == ([([best], 3)] if is_sought else [])
    assert found == (["found"] if is_sought else [])


def test_no_third_is_sought_where_no_set_was_fitted(ground):
    assert prediction.search_third(ground, {}, []) == []
