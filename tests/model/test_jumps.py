"""What a recorder's filter makes of a jump lies within what `_find_jump_samples` leaves open there;
nothing is where nothing jumps.
"""

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from tractexp.inference.jumps import AROUND, _find_jump_samples

RATE, FINER = 3200.0, 12


def jumping(at: float, size: float, cutoff: float) -> tuple[np.ndarray, np.ndarray]:
    """A sine that falls by `size` of itself `at` [s]: as sampled at once, and behind an anti-alias
    filter, (N,).
    """
    t = np.arange(400 * FINER) / (RATE * FINER)
    wave = np.cos(2 * np.pi * 50 * t)
    fallen = np.where(t >= at, wave * size, 0.0)
    seen = sosfilt(butter(2, 2 * cutoff / FINER, output="sos"), fallen)
    still = sosfilt(butter(2, 2 * cutoff / FINER, output="sos"), wave * size)
    # what the filter's lag does to a sine is in the voltage as well
    steady = np.where(t >= at, still, 0.0)
    return steady[::FINER], seen[::FINER]


@pytest.mark.parametrize("cutoff", [0.25, 0.4])
@pytest.mark.parametrize("at", [0.06, 0.0601, 0.06022])
def test_what_a_filter_makes_of_a_jump_lies_within_what_is_open(at, cutoff):
    calculated, recorded = jumping(at, 0.3, cutoff)
    off, doubt = np.abs(recorded - calculated), dict(_find_jump_samples(calculated))
    assert doubt
    bad = [k for k in np.flatnonzero(off > 0.012) if off[k] > 3 * doubt.get(k, 0.0)]
    assert off.max() > 0.06  # the filter does matter
    assert not bad
    assert len(doubt) <= 4 * AROUND


def test_a_sine_with_harmonics_has_no_jump():
    t = np.arange(400) / RATE
    assert _find_jump_samples(np.cos(2 * np.pi * 50 * t) + 0.1 * np.cos(2 * np.pi * 350 * t)) == []
    assert _find_jump_samples(np.zeros(400)) == []
