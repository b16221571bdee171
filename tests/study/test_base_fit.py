"""The base model's own fit, `fit_base_model`: it ends in the best of its valleys, and
`examine_beneath` an effect it is looked at in that one's.
"""

from types import SimpleNamespace
from typing import Any

import pytest
from made_context import bench
from made_dips import FAST, LOUD, base, events

from tractexp.discrepancy.explanations import examine_beneath
from tractexp.inference import multistart
from tractexp.inference.base_fit import fit_base_model


def test_the_base_model_is_fitted_in_the_better_of_two_valleys(monkeypatch):
    """Where the reactive static load may stand for a part of the motor's, the box alone led to the
    worse side.
    """
    made = events(
        "feeder_impedance", size=0.6377, seed=287367529, count=4, noise=LOUD, recorder=FAST
    )[:3]
    best = fit_base_model(bench(base(), made, ()))
    monkeypatch.setattr(
        multistart, "place_along_least_certain", lambda likelihood, unit: unit[None]
    )
    worse = fit_base_model(bench(base(), made, ())).fit
    assert worse.deviance > best.fit.deviance + 100
    first: Any = SimpleNamespace(
        context=best.context, noise=best.noise, fit=best.fit, score_fit=lambda at, fit, noise: fit
    )
    assert examine_beneath(first, best.fit) is first
    below: Any = examine_beneath(first, worse)
    assert below.deviance == pytest.approx(worse.deviance, rel=0.02)
