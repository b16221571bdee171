"""What events say of an extension of a model, `GapTest`."""

from types import SimpleNamespace

import numpy as np
import pytest

from tractexp.discrepancy.gap import GapTest


@pytest.mark.parametrize(
    ("gain", "expected", "outcome"),
    [
        (11.0, 100.0, "shown"),
        (-1.0, 100.0, "denied"),
        (5.0, 100.0, "denied"),
        (5.0, 12.0, "mild"),
        (-1.0, 6.0, "mild"),
        (-np.inf, np.inf, "denied"),
    ],
)
def test_an_extension_of_which_events_show_little_is_neither_shown_nor_denied(
    gain, expected, outcome
):
    """A true one gains about what both curves are apart."""
    assert GapTest(None, None, gain, 0.0, expected, 10.8, None).outcome == outcome


def test_what_only_gets_worse_explains_nothing():
    shares = [GapTest(None, None, gain, 0.0, 1.0, 1.0, None).explained_share for gain in (-5, 0, 5)]
    assert shares == [0, 0, 1]


def test_no_share_is_told_of_a_gap_within_the_error_of_the_noise():
    """273 came out once, where less was left than noise leaves by that much more than there had
    been.
    """

    def closed(before, after):
        curves = (
            SimpleNamespace(error=SimpleNamespace(square=square)) for square in (before, after)
        )
        return GapTest(*curves, 1.0, 1.0, 1.0, 10.8, None).closed_share

    assert closed(4e-4, 1e-4) == pytest.approx(0.75)
    assert closed(4e-4, -4e-5) == pytest.approx(1.1)
    assert closed(4e-4, 8e-4) == pytest.approx(-1.0)
    assert all(
        np.isnan(closed(before, after))
        for before, after in ((1e-6, -2.7e-4), (0.0, 1e-5), (-1e-6, 1e-6))
    )
