"""The noise of two channels, `Noise`: what is drawn is what `estimate` finds, and white once
whitened.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from tractexp.noise import Autoregression, Noise, white_noise
from tractexp.noise.quiet import estimate
from tractexp.noise.random_walk import Load, RandomWalk


def test_noise_that_is_drawn_is_noise_that_is_found():
    """Correlated channels, one of them colored: mix, level and color come back from a
    long stretch.
    """
    mix = np.linalg.inv(np.array([[0.004, 0.0], [0.002, 0.003]]))
    color = Autoregression(np.array([[0.0], [0.8]]), np.array([1.0, 0.6]))
    noise = Noise(((color, white_noise(1.0)),), mix)
    drawn = noise.draw(np.random.default_rng(7), 1, [40000])[0]
    found = estimate(drawn, np.ones(drawn.shape, dtype=bool), [slice(0, 40000)])
    covariance = np.linalg.inv(mix) @ np.linalg.inv(mix).T
    assert np.cov(drawn) == pytest.approx(covariance, rel=0.1)
    assert found.pair(0)[0].coefficients[-1, 0] == pytest.approx(0.8, abs=0.03)


def test_a_recurrence_is_undone_by_its_own_whitening():
    color = Autoregression(
        np.array([[0.0, 0.0], [0.6, 0.0], [0.9, -0.3]]), np.array([1.5, 1.2, 1.0])
    )
    shocks = np.random.default_rng(0).standard_normal((3, 50))
    made = color.color_shocks(shocks)
    assert made[:, 0] == pytest.approx(shocks[:, 0])
    assert color.whiten(made, np.ones(50, dtype=bool))[:, 2:] == pytest.approx(shocks[:, 2:])


def test_heavy_tails_are_drawn_beyond_what_the_quiet_samples_showed():
    """Quantiles of the law stand for few samples of Student's t; normal and quantised samples stand
    for themselves.
    """
    rng = np.random.default_rng(8)
    whole = slice(0, 400)

    def drawn(rows):
        return estimate(rows, np.ones((2, 400), dtype=bool), [whole]).shocks

    heavy = drawn(rng.standard_t(4, (2, 400)))
    assert all(len(channel) > 400 and 8 < channel.max() < 30 for channel in heavy)
    assert all(channel.std() == pytest.approx(1.0) for channel in heavy)
    for rows in (rng.normal(size=(2, 400)), np.round(2 * rng.normal(size=(2, 400)))):
        assert all(len(channel) <= 400 for channel in drawn(rows))


def test_noise_of_a_wandering_load_is_white_once_whitened():
    """Draws that wander come out of the whitening with unit variance, also in their slow sums."""
    power = np.stack([np.where(np.arange(600) < 300, 1.0, 0.5), np.zeros(600)])
    wander = RandomWalk(np.array([2.0, 0.0]), 0.002, Load(power, np.array([[1.0, 0.0]])))
    noise = Noise(Noise.white(1.0, 1.0).pairs, random_walk=wander)
    drive = SimpleNamespace(
        events=1, samples=600, part=lambda e: slice(0, 600), parts=[slice(0, 600)]
    )
    drawn = noise.draw(np.random.default_rng(9), 400, [600])
    rows = noise.whiten(drawn, drive, np.ones((2, 600), dtype=bool)).reshape(400, 2, 600)
    slow = np.cos(np.pi * (np.arange(600) + 0.5) / 600) * np.sqrt(2 / 600)
    assert np.var(drawn[:, 0] @ slow) > 50
    assert np.var(rows[:, 0] @ slow) == pytest.approx(1.0, abs=0.2)
    assert rows.var() == pytest.approx(1.0, abs=0.02)


def test_samples_scatter_by_the_fast_noise_and_by_errors_of_the_voltage_about_what_wanders():
    """The band around a curve is as wide as the noise that is told, however far a load wanders."""
    n = 400
    load = Load(np.tile([[1.0], [0.0]], n), np.array([[1.0, 0.0]]))
    modes = np.zeros((1, 2, n))
    modes[0, 1, 100] = 4.0
    noise = Noise(
        ((white_noise(3.0), white_noise(3.0)),),
        random_walk=RandomWalk(np.array([200.0, 0.0]), 0.002, load),
        input_modes=modes,
    )
    drive = SimpleNamespace(measurements=np.empty((2, n)), parts=[slice(0, n)])
    expected = np.full((2, n), 3.0)
    expected[1, 100] = 5.0
    assert noise.deviation(drive) == pytest.approx(expected)


def test_noise_drawn_white_has_the_law_of_noise_that_is_whitened():
    """Colored, mixed, wandering noise with heavy tails and a gap: variance in all directions, tails
    and gap alike.
    """
    n, rng = 600, np.random.default_rng(9)
    color = Autoregression(np.array([[0.0], [0.8]]), np.array([1.0, 0.6]))
    wander = RandomWalk(
        np.array([2.0, 0.0]), 0.002, Load(np.tile([[1.0], [0.0]], n), np.array([[1.0, 0.0]]))
    )
    heavy = rng.standard_t(5, (2, 4000))
    shocks = tuple(heavy / heavy.std(axis=1, keepdims=True))
    noise = Noise(((color, white_noise(1.0)),), np.array([[1.0, 0.0], [-0.5, 1.0]]), shocks, wander)
    drive = SimpleNamespace(events=1, samples=n, part=lambda e: slice(0, n), parts=[slice(0, n)])
    valid = np.ones((2, n), dtype=bool)
    valid[1, 250:300] = False
    whitened = noise.whiten(noise.draw(rng, 1000, [n]), drive, valid).reshape(1000, 2, n)
    white = noise.draw_white(rng, 1000, drive, valid).reshape(1000, 2, n)
    assert noise.draw_white(rng, 0, drive, valid).shape == (0, 2 * n)
    directions = np.cos(np.pi * np.outer(np.arange(40), np.arange(n) + 0.5) / n) * np.sqrt(2 / n)
    for rows in (whitened, white):
        assert not rows[:, :, 250:300].any()
        assert rows[:, :, 400:].var(axis=(0, 2)) == pytest.approx(1.0, abs=0.03)
        assert (rows @ directions.T).var(axis=0)[:, 1:] == pytest.approx((n - 50) / n, abs=0.25)
    kurtosis = [(rows[:, :, 400:] ** 4).mean(axis=(0, 2)) for rows in (whitened, white)]
    assert kurtosis[0] == pytest.approx(kurtosis[1], rel=0.2)
    assert kurtosis[1].min() > 4


def test_what_the_reactive_power_of_customers_does_after_a_dip_follows_their_active_power():
    """P and Q of one load wander together: where it takes thrice the reactive power, that wanders
    thrice as much.
    """
    rng, n, count = np.random.default_rng(3), 600, 200
    clean = np.stack([np.ones(n), np.where(np.arange(n) < 300, 0.4, 1.2)])
    walk = np.cumsum(rng.normal(size=(count, 1, n)) * 0.01, axis=2)
    walk -= walk.mean(axis=2, keepdims=True)  # a load that is larger throughout is P0 and Q0
    recorded = clean * walk + 0.05 * rng.normal(size=(count, 2, n))
    load = Load.from_powers(clean, np.array([[1.0, 0.4]]), np.array([0, n]))
    # in which what goes together in P and Q before the dip is P's alone
    mix = np.array([[20.0, 0.0], [-8.0, 20.0]])
    noise = Noise(
        Noise.white(1.0, 1.1).pairs,
        mix,
        random_walk=RandomWalk(np.array([20.0, 0.0]), 0.002, load),
    )
    drive = SimpleNamespace(events=1, samples=n, part=lambda e: slice(0, n), parts=[slice(0, n)])
    rows = noise.whiten(recorded, drive, np.ones((2, n), dtype=bool)).reshape(count, 2, n)
    slow = (np.arange(n) >= 300) / np.sqrt(300)
    assert np.var((mix @ recorded)[:, 1] @ slow) > 20
    assert np.var(rows[:, 1] @ slow) < 2


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_levels_are_drawn_as_far_off_as_quiet_samples_tell_them(memory):
    """Against levels of drawn stretches themselves, one after the other from the same noise."""
    color = Autoregression(np.array([[0.0], [memory]]), np.array([(1 - memory**2) ** -0.5, 1.0]))
    noise = Noise(((color, color),))
    rng = np.random.default_rng(5)
    stretches = noise.draw(rng, 4000, [400])
    seen = np.sqrt((stretches**2).mean(axis=(1, 2))) * (1 - memory**2) ** 0.5
    drawn = noise.draw_levels(rng, 4000, [slice(0, 400)])
    assert np.mean(drawn**2) == pytest.approx(1.0, abs=0.02)
    assert 0.9 < drawn.std() / seen.std() < 2.1  # a colored one's worth is that of its slowest part


def test_an_average_over_ten_samples_is_told_by_more_than_ten_coefficients():
    """Its spectrum has zeros; eight coefficients leave what passes for an oscillation."""
    raw = np.random.default_rng(4).standard_normal((2, 6010)).cumsum(axis=1)
    averaged = (raw[:, 10:] - raw[:, :-10]) / 10
    found = estimate(averaged, np.ones(averaged.shape, dtype=bool), [slice(0, 6000)])
    assert all(color.order > 10 for color in found.pair(0))
