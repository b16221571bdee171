"""How a load wanders, as `find` estimates it from the stretches before its events and from what is
left of them.
"""

import numpy as np
import pytest

from tractexp.noise.random_walk import Load, Rest, find


def steady(samples):
    """A load that takes the same power throughout, in one event."""
    return Load(np.tile([[1.0], [0.0]], samples), np.array([[1.0, 0.0]]))


def test_a_load_that_wanders_is_seen_before_the_events_and_steady_noise_is_not():
    rng = np.random.default_rng(8)
    calm = lambda: [rng.normal(size=(2, 250)) for _ in range(3)]  # noqa: E731
    spoken = sum(find(calm(), 0.002, steady(250)) is not None for _ in range(150))
    # half a chi-square of one degree beyond 2, less what fast noise takes: 6 %
    assert 0.03 < spoken / 150 < 0.1
    walks = [
        w + np.cumsum(rng.normal(size=(2, 250)) * np.array([[0.05], [0.0]]), axis=1) for w in calm()
    ]
    found = find(walks, 0.002, steady(250))
    assert 1.0 < found.intensity[0] / (0.05**2 / 0.002) < 2.0  # the larger end of its interval
    assert found.intensity[1] < found.intensity[0] / 2


def test_a_load_that_seems_steady_before_the_events_may_wander_within_them():
    """What is left of the events adds evidence, as long as the stretches before do not speak
    against it.
    """
    rng = np.random.default_rng(11)
    white = lambda n: rng.normal(size=(2, n))  # noqa: E731
    walk = lambda n: np.cumsum(rng.normal(size=(2, n)) * np.array([[0.03], [0.0]]), axis=1)  # noqa: E731
    columns = rng.normal(size=(3, 2, 1000))
    rest = lambda left: Rest(left, columns, np.ones(1000))  # noqa: E731
    calm = [white(250) for _ in range(3)]
    assert find(calm, 0.002, steady(1000)) is None
    assert find(calm, 0.002, steady(1000), [rest(white(1000)) for _ in range(3)]) is None
    assert (
        find(calm, 0.002, steady(1000), [rest(white(1000) + walk(1000)) for _ in range(3)])
        is not None
    )
    explained = [rest(white(1000) + 5 * columns[0]) for _ in range(3)]
    assert find(calm, 0.002, steady(1000), explained) is None


def wandering_within():
    """What is left of an event shows a little more than the stretch before it."""
    rng = np.random.default_rng(24)
    left = rng.normal(size=(2, 1000)) + np.cumsum(
        rng.normal(size=(2, 1000)) * np.array([[0.012], [0.0]]), axis=1
    )
    return [Rest(left, np.zeros((1, 2, 1000)), np.ones(1000))]


@pytest.mark.parametrize("rests", [list, wandering_within])
def test_a_lower_likelihood_lets_a_load_wander(rests, monkeypatch):
    """Of noise in which no walk is, and of a walk that is hardly one."""
    before = [np.random.default_rng(73).normal(size=(2, 250))]
    assert find(before, 0.002, steady(1000), rests()) is None
    monkeypatch.setattr("tractexp.noise.random_walk.LEAST_WANDERING", 1.5)
    assert find(before, 0.002, steady(1000), rests()) is not None
