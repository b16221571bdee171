"""The gain of a column in one linear step, `compute_signed_drop`, and the statistics of a
`ScoreTest`.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import chdtrc

from tractexp.inference import residual_statistics
from tractexp.inference.score_test import ScoreTest, compute_signed_drop


def test_a_score_is_the_drop_of_the_refitted_linear_problem():
    """(s'r)^2/s's equals the difference of two least-squares fits, with and without the column."""
    rng = np.random.default_rng(5)
    N, s, r = rng.normal(size=(200, 6)), rng.normal(size=200), rng.normal(size=200)
    Q, _ = np.linalg.qr(N)

    def off(y):
        return y - Q @ (Q.T @ y)

    drop, p = compute_signed_drop(off(s)[None], off(r)[None], np.array([0]))
    without = np.linalg.lstsq(N, r, rcond=None)[1][0]
    both = np.linalg.lstsq(np.column_stack([N, s]), r, rcond=None)[1][0]
    assert drop[0] == pytest.approx(without - both, rel=1e-9)
    assert p[0] == pytest.approx(chdtrc(1, without - both), rel=1e-9)


def test_a_size_that_may_only_grow_has_half_of_its_chi_square():
    rng = np.random.default_rng(6)
    s, r = rng.normal(size=100), rng.normal(size=(4000, 100))
    drops, p = compute_signed_drop(s[None], r, np.array([1]))
    assert np.mean(drops == 0) == pytest.approx(0.5, abs=0.03)
    assert np.mean(p < 0.05) == pytest.approx(0.05, abs=0.01)


@pytest.mark.parametrize(("events", "asked"), [(1, False), (2, True)])
def test_parameters_of_each_event_are_asked_for_where_there_are_two(events, asked, monkeypatch):
    monkeypatch.setattr(
        residual_statistics, "compute_residual_statistics", lambda channels, problem: {}
    )
    projection = SimpleNamespace(
        variance_component=lambda: np.zeros(1),
        least_p=np.ones(1),
        channels=lambda layout: None,
        r=np.zeros((1, 3)),
        split=np.ones((1, 3)),
    )
    made = ScoreTest.statistics(projection, SimpleNamespace(events=("a dip",) * events))
    assert ("parameters of each event" in made) == asked
