"""How a load wanders, as `find` estimates it from the stretches before its events and from what is
left of them.
"""

import numpy as np
import pytest

from tractexp.noise.random_walk import Load, find


def steady(samples):
    """A load that takes the same power throughout, in one event."""
    return Load(np.tile([[1.0], [0.0]], samples), np.array([[1.0, 0.0]]))


def draw_white(rng, samples):
    """White noise of P and Q."""
    return rng.normal(size=(2, samples))


def draw_walk(rng, samples, size):
    """A random walk of P, by steps of this size."""
    return np.cumsum(rng.normal(size=(2, samples)) * np.array([[size], [0.0]]), axis=1)


def draw_calm(rng):
    """What three events show before them of a load that does not wander."""
    return [draw_white(rng, 250) for _ in range(3)]


def test_steady_noise_is_seldom_said_to_wander():
    """Half a chi-square of one degree beyond 2, less what fast noise takes: 6 %."""
    rng = np.random.default_rng(8)
    said = sum(find(draw_calm(rng), 0.002, steady(250)) is not None for _ in range(150))
    assert 0.03 < said / 150 < 0.1


def test_a_load_that_wanders_is_seen_before_its_events():
    rng = np.random.default_rng(8)
    walks = [calm + draw_walk(rng, 250, 0.05) for calm in draw_calm(rng)]
    found = find(walks, 0.002, steady(250))
    assert 1.0 < found.intensity[0] / (0.05**2 / 0.002) < 2.0  # the larger end of its interval
    assert found.intensity[1] < found.intensity[0] / 2


def test_a_load_that_seems_steady_before_the_events_may_wander_within_them():
    """What is left of the events adds evidence, as long as the stretches before do not speak
    against it.
    """
    rng = np.random.default_rng(11)
    columns = rng.normal(size=(3, 2, 1000))
    calm = draw_calm(rng)

    def is_found(left):
        rests = [(left(), columns, np.ones(1000)) for _ in range(3)]
        return find(calm, 0.002, steady(1000), rests) is not None

    assert find(calm, 0.002, steady(1000)) is None
    assert not is_found(lambda: draw_white(rng, 1000))
    assert is_found(lambda: draw_white(rng, 1000) + draw_walk(rng, 1000, 0.03))
    # what an effect may explain is no walk
    assert not is_found(lambda: draw_white(rng, 1000) + 5 * columns[0])


def wander_within():
    """What is left of an event shows a little more than the stretch before it."""
    rng = np.random.default_rng(24)
    left = draw_white(rng, 1000) + draw_walk(rng, 1000, 0.012)
    return [(left, np.zeros((1, 2, 1000)), np.ones(1000))]


@pytest.mark.parametrize("rests", [list, wander_within])
def test_a_lower_likelihood_lets_a_load_wander(rests, monkeypatch):
    """Of noise in which no walk is, and of a walk that is hardly one."""
    before = [draw_white(np.random.default_rng(73), 250)]
    assert find(before, 0.002, steady(1000), rests()) is None
    monkeypatch.setattr("tractexp.noise.random_walk.LEAST_WANDERING", 1.5)
    assert find(before, 0.002, steady(1000), rests()) is not None
