"""A feeder's trace: the frequency at which the network turns."""

import numpy as np
import pytest

from tractexp.record.phasor import Phasors
from tractexp.recording.trace import _track_frequency

NOMINAL, STEP = 50.0, 0.01  # Hz, s: two phasors a cycle
HALF = 5  # phasors in two and a half cycles


@pytest.mark.parametrize("count", [40, 41, 43, 44])
def test_it_is_the_median_over_five_cycles_or_what_of_them_is_recorded(count):
    """Wherever the record ends between two of the knots."""
    f = NOMINAL + np.random.default_rng(1).normal(size=count)
    t = STEP * np.arange(count)
    V = np.ones((1, count), complex)
    found = _track_frequency(Phasors(t, V, V, f), NOMINAL)
    knots = np.arange(0, count, HALF)
    medians = [np.median(f[max(k - HALF, 0) : k + HALF + 1]) for k in knots]
    np.testing.assert_array_equal(found[knots], medians)
