"""What is left is told by its shape, `find_remainders`: what is planted comes back, and noise is
nothing.
"""

import numpy as np
import pytest
from made_dips import FAST, events

from tractexp.discrepancy.remainder import MOST_SHAPES, find_remainders
from tractexp.noise import Autoregression, Noise

LEVEL = 0.002


@pytest.fixture(scope="module")
def made():
    return events(count=2, recorder=FAST)


def noise_of(made, seed=0):
    samples = sum(event.record.samples for event in made)
    return LEVEL * np.random.default_rng(seed).standard_normal((2, samples))


def found(made, residual, **settings):
    return find_remainders(residual, made, Noise.white(LEVEL, LEVEL), **settings)


def after(event, k, shape):
    """`shape` of the time since sample `k` [s], nothing before."""
    t = event.record.t - event.record.t[k]
    return np.where(t >= 0, shape(np.maximum(t, 0)), 0.0)


def test_a_damped_oscillation_is_told_by_start_frequency_damping_and_size(made):
    first = made[0]
    residual, k = noise_of(made), first.end + 50
    ring = after(first, k, lambda t: 0.01 * np.exp(-t / 0.2) * np.cos(2 * np.pi * 23 * t + 0.7))
    residual[0, : first.record.samples] += ring
    (told,) = found(made, residual)
    assert (told.event, told.channel, told.kind, told.ended) == ("event1", "P", "ringing", True)
    assert told.start == pytest.approx(first.record.t[k], abs=2 * first.record.step)
    assert told.after == pytest.approx(0.1, abs=0.005)
    assert told.frequency == pytest.approx(23, abs=0.3)
    assert told.time_constant == pytest.approx(0.2, rel=0.2)
    assert told.damping == pytest.approx(1 / (2 * np.pi * 23 * 0.2), rel=0.2)
    assert told.size == pytest.approx(0.01, rel=0.15)
    assert told.noise == pytest.approx(told.size / first.noise_P)
    assert told.share > 0.8
    assert str(told).startswith(
        "P of event1 rings at 23 Hz from t = 0.748 s on, 0.1 s after the dip ends, at first by"
    )
    assert "damping ratio 0.03" in str(told)


def test_an_offset_that_decays_is_told_by_its_side_and_time_constant(made):
    second = made[1]
    residual, n = noise_of(made, 1), made[0].record.samples
    residual[1, n:] += after(second, second.start, lambda t: -0.012 * np.exp(-t / 0.15))
    (told,) = found(made, residual)
    assert (told.event, told.channel, told.kind, told.ended) == ("event2", "Q", "decay", False)
    assert told.frequency is None
    assert told.size == pytest.approx(-0.012, rel=0.15)
    assert told.time_constant == pytest.approx(0.15, rel=0.2)
    assert "Q of event2 is down by 0.01" in str(told)
    assert "as the dip begins" in str(told)
    assert "dies away" in str(told)


def test_what_stays_is_a_step_and_what_is_over_at_once_a_pulse(made):
    step, pulse = noise_of(made, 2), noise_of(made, 3)
    step[0, 700 : made[0].record.samples] += 0.004
    pulse[1, 700:702] += 0.03
    (stays,), (over, *_) = found(made, step), found(made, pulse)
    assert (stays.kind, stays.time_constant) == ("step", None)
    assert stays.size == pytest.approx(0.004, rel=0.1)
    assert str(stays).endswith(", and stays so")
    assert over.kind == "pulse"
    assert over.start == pytest.approx(made[0].record.t[700], abs=2.5 * made[0].record.step)
    assert "has a pulse up of" in str(over)


def test_the_loudest_comes_first_and_each_is_taken_away_before_the_next(made):
    residual, n = noise_of(made, 4), made[0].record.samples
    residual[0, 600:n] += 0.004
    residual[1, n + 700 :] -= 0.008
    loud, quiet = found(made, residual)
    assert [(s.event, s.channel, s.kind) for s in (loud, quiet)] == [
        ("event2", "Q", "step"),
        ("event1", "P", "step"),
    ]
    assert loud.share > quiet.share > 0
    assert loud.share + quiet.share < 1.05


def test_noise_has_no_shape_white_or_colored(made):
    """At a false-alarm rate of 5 %, one in twelve at most in nearly all draws."""
    assert sum(bool(found(made, noise_of(made, seed))) for seed in range(10, 13)) <= 1
    color = Autoregression(np.array([[0.0], [0.9]]), np.array([1.0, np.sqrt(1 - 0.81)]))
    colored = Noise(((color, color),))
    lengths = [event.record.samples for event in made]
    spoken = 0
    for seed in range(3):
        drawn = LEVEL * colored.draw(np.random.default_rng(seed), 1, lengths)[0]
        spoken += bool(found(made, drawn))
    assert spoken <= 1
    assert (
        len(found(made, 20 * LEVEL * np.random.default_rng(5).standard_normal((2, sum(lengths)))))
        <= MOST_SHAPES
    )
