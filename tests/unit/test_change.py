"""Steps of a load: what is one, and what only looks like one."""

import numpy as np
import pytest

from tractexp.record.change import find_voltage_changes, load_changes

N = 20  # samples in a cycle
AT = 50 * N


def stepped(low, high, lasting=50, before=50):
    """Cycles at one level, then at another, then at the first again."""
    return np.repeat([low, high, low], [before * N, lasting * N, 30 * N])


def changes(P, size=1.0):
    return load_changes(np.ones(len(P)), size * P, np.zeros(len(P)), N)


def test_a_step_is_found_where_it_is_with_the_levels_on_either_side():
    one, two = changes(stepped(1.0, 0.8))
    assert one.first <= AT <= one.stop
    assert one.stop - one.first == N
    assert (one.before, one.after) == pytest.approx((1.0, 0.8))
    assert one.ratio == pytest.approx(0.8)
    assert two.first <= AT + 50 * N <= two.stop


@pytest.mark.parametrize(("lasting", "steps"), [(1, 0), (3, 2)])
def test_what_is_over_within_a_cycle_is_a_pulse_and_no_step(lasting, steps):
    assert len(changes(stepped(1.0, 0.8, lasting))) == steps


def test_a_load_that_swings_for_some_cycles_takes_no_step():
    """Each change is abrupt, but of none half is still seen over five cycles."""
    swing = [*[1.0] * 30, 1.3, 0.8, 1.2, 1.1, 0.7, *[1.0] * 30]
    assert changes(np.repeat(swing, N)) == []


@pytest.mark.parametrize("size", [1.0, 10.0])
def test_a_fifth_of_the_greatest_power_is_what_small_loads_are_measured_by(size):
    """Where nearly nothing is drawn, a step by two fifths of that is none: it is 2 % of a fifth of
    the greatest.
    """
    P = np.concatenate([np.full(50 * N, 1.0), stepped(0.01, 0.014)])
    assert [change.after.real for change in changes(P, size)] == pytest.approx([0.01 * size])
    assert len(changes(stepped(0.01, 0.014), size)) == 2  # by itself it is the greatest


def test_a_step_stands_out_from_a_drift_beside_it():
    """A drift of 1.5 % a cycle about a step of 10 %: the change is four times those beside it."""
    drift = np.clip((np.arange(100 * N) - AT) / N, -6, 6) * 0.015
    step = 0.1 * (np.arange(100 * N) >= AT)
    (one,) = changes(1 + drift + step)
    assert one.first <= AT <= one.stop
    assert changes(1 + drift) == []


def test_what_follows_the_voltage_is_an_answer():
    """Up to four times the relative change of the voltage."""
    U = stepped(1.0, 0.98)
    for exponent, steps in ((1.5, 0), (10.0, 2)):
        assert len(load_changes(U, U**exponent, np.zeros(len(U)), N)) == steps
    assert len(find_voltage_changes(U, N)) == 2
    assert find_voltage_changes(stepped(1.0, 0.995), N) == []
