"""Which state before a dip is taken as steady, and what is said of a load that is not."""

from dataclasses import replace

import numpy as np
import pytest

import tractexp
from tractexp.cache.provenance import hash_record
from tractexp.errors import UserError
from tractexp.record import Record, detect

BEGIN, END = 2.0, 2.15  # s, of the dip


def record(course=None, rate=200.0, noise=1e-3, seed=0, tap=0.0):
    """A dip of 30 % of a load of 0.8 + 0.4j that `course` of time [s] multiplies; a tap changer
    steps at 1.5 s.
    """
    t, rng = np.arange(int(4 * rate)) / rate, np.random.default_rng(seed)
    U = np.where((t >= BEGIN) & (t < END), 0.7, 1.0) * np.where(t < 1.5, 1.0 + tap, 1.0)
    size = 1.0 if course is None else course(t)
    P, Q = 0.8 * size * U**1.5, 0.4 * size * U**2
    U, P, Q = (x + noise * rng.standard_normal(len(t)) for x in (U, P, Q))
    return Record("made", t, U, P, Q, source="made.csv")


def step(at, before, after=1.0):
    return lambda t: np.where(t < at - 1e-9, before, after)


@pytest.mark.parametrize("before", [0.0, 0.5, 1.1, 3.0])
@pytest.mark.parametrize("rate", [50, 200, 1000])
def test_the_steady_state_is_that_after_the_last_step(rate, before):
    whole = record(step(1.7, before), rate)
    event = detect(whole)
    assert 1.7 <= event.record.t[event.steady.start] <= 1.74
    np.testing.assert_allclose([event.P0, event.Q0], [0.8, 0.4], atol=2e-3)
    assert event.steady.start == 0  # what was before is not fitted
    assert event.record.digest == hash_record(whole)
    assert event.record.t[event.start] == pytest.approx(BEGIN)
    [note] = event.record.notes
    assert "while the voltage stays: the steady state before the dip is that of the 0." in note


def test_of_several_steps_the_last_counts():
    event = detect(record(lambda t: 1 + 4.0 * ((t >= 0.9) & (t < 1.6))))
    np.testing.assert_allclose(event.P0, 0.8, atol=1e-3)
    assert event.record.t[event.steady.start] >= 1.6


def test_a_step_right_before_the_dip_is_refused():
    with pytest.raises(
        UserError,
        match=r"made.csv: the load changes at t = 1.9\d* s \(P 2.* to 0.*: no steady state",
    ):
        detect(record(step(1.94, 3.0)))


def test_a_dip_that_p_and_q_show_a_little_earlier_is_no_step_before_it():
    made = record()
    early = replace(made, P=np.roll(made.P, -1), Q=np.roll(made.Q, -1))
    assert detect(early).record is early


def test_a_tap_changer_before_the_dip_ends_the_state_before_it():
    event = detect(record(tap=0.02))
    np.testing.assert_allclose(event.U0, 1.0, atol=5e-4)
    assert "the voltage changes by -2 % at t = 1.5" in " ".join(event.record.notes)


def test_a_load_that_comes_to_rest_is_taken_where_it_rests():
    event = detect(record(lambda t: 1 + np.where(t < 1.5, 3.0, 3 * np.exp(-(t - 1.5) / 0.06))))
    np.testing.assert_allclose(event.P0, 0.8, rtol=0.02)
    assert "the load comes to rest before the dip" in event.record.notes[0]


@pytest.mark.parametrize(
    ("course", "words"),
    [
        (lambda t: 1 + 0.2 * (t - BEGIN), "P rises by 1"),
        (lambda t: 1 + 0.1 * np.sin(2 * np.pi * t), "P swings by 1"),
        (lambda t: 1 + 0.1 * np.sin(6 * np.pi * t), "P swings by 1"),
    ],
)
def test_a_ramp_and_a_swing_are_said_with_what_they_do_to_the_mean(course, words):
    event = detect(record(course))
    [note] = event.record.notes
    late = slice(event.steady.stop - 20, event.steady.stop)
    away = 100 * (event.record.P[late].mean() - event.P0) / np.hypot(event.P0, event.Q0)
    assert f"the load is not steady before the dip: {words}" in note
    assert f"right before the dip P is {away:+.2g} %" in note


@pytest.mark.parametrize("noise", [0.0, 1e-3, 0.02])
@pytest.mark.parametrize("seed", range(5))
def test_a_steady_load_is_left_as_it_is(noise, seed):
    event = detect(record(noise=noise, seed=seed))
    assert event.record.notes == ()
    assert event.steady == slice(event.start - 200, event.start)


@pytest.mark.parametrize(
    "name", ["tibet_30pct", "tibet_50pct", "tibet_65pct", "tibet_50pct_comtrade"]
)
def test_nothing_is_said_of_the_shipped_records(name):
    for event in tractexp.read(name):
        assert event.steady == slice(0, event.start)
        assert not [note for note in event.record.notes if "steady" in note or "the load " in note]


def test_times_in_a_wrong_unit_end_in_no_traceback():
    made = record()
    assert detect(replace(made, t=1e9 * made.t)).steady.stop > 0


@pytest.mark.parametrize(("rate", "seed"), [(100.0, 87), (100.0, 109), (100.0, 139), (200.0, 7)])
def test_noise_of_the_voltage_is_no_tap_changer(rate, seed):
    """Noise of 1 %: the means of two cycles differ by as much, in these four more than in 196
    others of each rate.
    """
    assert detect(record(rate=rate, noise=1e-2, seed=seed)).record.notes == ()
