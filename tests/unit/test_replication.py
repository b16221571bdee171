"""Each event left out in turn, `find_least_share`: the least share of what is expected, of events
that noise does not hide.
"""

import numpy as np
import pytest

import tractexp
from tractexp.discrepancy.explain import explain_replication
from tractexp.discrepancy.replication import find_hidden, find_least_share


@pytest.mark.parametrize(
    ("expected", "gained", "share"),
    [
        ((4.0, 2.0, 1.0), (4.0, 1.8, 0.6), 0.6),
        ((4.0, 2.0, 1.0), (4.0, -1.0, 1.0), -0.5),  # without it an event is predicted better
        ((4.0, 0.05, 1.0), (4.0, -9.0, 1.0), 1.0),  # noise hides the second
        ((np.inf, 2.0, 1.0), (np.inf, 2.0, 1.0), 1.0),  # the motor stalls without it
        ((4.0, 2.0, 1.0), (-np.inf, 2.0, 1.0), -np.inf),  # and here with it
    ],
)
def test_the_least_share_counts(expected, gained, share):
    assert find_least_share(expected, gained, (0.1, 0.1, 0.1)) == share


@pytest.mark.parametrize(("samples", "level"), [(400, 1e-3), (1600, 1e-3), (400, 1e-2)])
def test_noise_hides_what_its_squares_scatter_by(samples, level):
    """At least as much as in 95 of 100 draws, and not twice that of 999 in 1,000."""
    rng = np.random.default_rng(5)
    t = np.arange(400 + samples) * 2.5e-3
    U = np.where((t >= 1.0) & (t < 1.25), 0.7, 1.0)
    P, Q = 0.6 + level * rng.standard_normal((2, len(t)))
    event = tractexp.read({"t": t, "U": U, "P": P, "Q": Q, "f": np.full(len(t), 50.0)})[0]
    squares = np.sum((level * rng.standard_normal((2000, 2, samples))) ** 2, axis=(1, 2))
    usual, rare = np.quantile(np.abs(squares - squares.mean()), (0.95, 0.999))
    assert usual < find_hidden(event) < 2 * rare


def test_events_that_noise_hides_confirm_nothing():
    slight = 0.05, 0.05, 0.05
    assert np.isnan(find_least_share(slight, slight, (0.1, 0.1, 0.1)))


@pytest.mark.parametrize(
    ("replicated", "told"),
    [
        (None, "none is left to confirm it"),
        (np.nan, "no event by itself, left out, shows more of it than noise hides"),
        (0.3, "of what an event shows of it 30% is left where that is not fitted"),
        (-2.0, "of what an event shows of it 0% is left where that is not fitted"),
    ],
)
def test_why_events_left_out_do_not_confirm_is_told_by_what_they_showed(replicated, told):
    assert explain_replication(replicated).startswith(told)
