"""Each event left out in turn, `find_least_share`: the least share of what is expected, of events
that noise does not hide.
"""

import numpy as np
import pytest

from tractexp.discrepancy.explain import explain_replication
from tractexp.discrepancy.replication import find_least_share


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
