"""Noise taken out of a sampled voltage: the fundamental and the edges stay, fast noise goes."""

import numpy as np
import pytest

from tractexp.record.noise_filter import NoiseFilter

RATE, F = 3200.0, 50.0
T = np.arange(1600) / RATE
NOISE = 1e-3


def dip(share=0.5):
    """A departure from the periodic course: positive and negative sequence that come and go at
    once.
    """
    there = (T > 0.2) & (T < 0.3)
    return there * (share * np.exp(2j * np.pi * F * T) + 0.2 * np.exp(-2j * np.pi * F * T))


def noise(seed):
    rng = np.random.default_rng(seed)
    return NOISE * (rng.standard_normal(len(T)) + 1j * rng.standard_normal(len(T)))


def test_what_turns_with_the_voltage_either_way_is_kept_whole():
    for way in (1, -1):
        turning = 0.3 * np.exp(2j * np.pi * way * F * T)
        np.testing.assert_allclose(
            NoiseFilter.from_rate(RATE, F)(turning, 2 * NOISE**2)[50:-50],
            turning[50:-50],
            atol=1e-7,
        )
    slow = 0.1 * np.exp(-T / 0.05 + 2j * np.pi * F * T)
    np.testing.assert_allclose(
        NoiseFilter.from_rate(RATE, F)(slow, 2 * NOISE**2)[50:-50], slow[50:-50], atol=2e-5
    )


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_noise_becomes_what_the_weights_say(seed):
    quieting, made = NoiseFilter.from_rate(RATE, F), noise(seed)
    left = quieting(made, 2 * NOISE**2)[100:-100]
    expected = NOISE * np.sqrt(2 * float(quieting.weights @ quieting.weights))
    assert np.sqrt(np.mean(np.abs(left) ** 2)) == pytest.approx(expected, rel=0.1)
    assert expected < 0.55 * NOISE * np.sqrt(2)


def test_an_edge_stays_where_it_is():
    """Within twice the noise everywhere, and as noisy as before only about the edges."""
    clean, made = dip(), noise(4)
    off = np.abs(NoiseFilter.from_rate(RATE, F)(clean + made, 2 * NOISE**2) - clean)
    assert off.max() < 5 * NOISE
    assert np.sqrt(np.mean(off[700:900] ** 2)) < 0.6 * NOISE * np.sqrt(2)
    sums = np.cumsum(NoiseFilter.from_rate(RATE, F)(clean, 2 * NOISE**2) - clean) / RATE
    # s: an error of the flux, whose noise is 1e-3 s / sqrt(RATE) = 2e-5 s and grows
    assert np.abs(sums).max() < 1e-5


def test_what_is_louder_than_noise_is_no_noise():
    ring = 0.05 * np.exp(-T / 0.1) * np.exp(2j * np.pi * 900 * T)
    off = np.abs(NoiseFilter.from_rate(RATE, F)(ring, 2 * NOISE**2) - ring)
    assert off[50:300].max() < 0.05 * 0.05
    # without noise nothing changes
    np.testing.assert_allclose(NoiseFilter.from_rate(RATE, F)(dip(), 0.0), dip(), atol=1e-12)


def test_a_coarse_record_is_left_as_it_is():
    coarse = NoiseFilter.from_rate(16 * F, F)
    assert len(coarse.weights) == 1
    made = noise(5)
    assert coarse(made, 2 * NOISE**2) is made
    assert len(NoiseFilter.from_rate(24 * F, F).weights) > 1


def test_a_short_departure_is_left_as_it_is():
    short = noise(6)[:40]
    assert NoiseFilter.from_rate(RATE, F)(short, 2 * NOISE**2) is short
