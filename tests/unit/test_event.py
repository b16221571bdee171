"""Where a dip is found, how deep, and what is refused."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tractexp.errors import UserError
from tractexp.record import Record, describe, detect, dips, find_dips
from tractexp.record.event import estimate_noise
from tractexp.record.fall import find_falls, sample_noise
from tractexp.record.own_base import OwnBase


def dip(step=1e-3, length=1.0, start=0.3, duration=0.15, depth=0.5, sigma=0.002, slow=0.0, seed=0):
    """A voltage that falls at once and recovers, all but the share `slow` of the depth, at once."""
    t = np.arange(round(length / step)) * step
    inside = (t > start - step / 2) & (t < start + duration - step / 2)
    U = np.where(inside, 1 - depth, 1.0)
    after = t >= start + duration - step / 2
    U[after] -= slow * depth * np.exp(-(t[after] - start - duration) / 0.2)
    rng = np.random.default_rng(seed)
    P, Q = 0.8 * U**1.5, 0.4 * U**2
    U, P, Q = (x + sigma * rng.standard_normal(len(t)) for x in (U, P, Q))
    return Record(name="dip", t=t, U=U, P=P, Q=Q, source="dip.csv")


@pytest.mark.parametrize("depth", [0.08, 0.3, 0.5, 0.65])
@pytest.mark.parametrize("step", [1e-3, 5e-3, 10e-3, 20e-3])
def test_a_clean_cut_dip_is_found_to_the_sample(step, depth):
    event = detect(dip(step=step, start=0.4, duration=0.2, depth=depth))
    assert (event.t_start, event.t_end) == (
        pytest.approx(0.4, abs=1e-9),
        pytest.approx(0.6, abs=1e-9),
    )
    assert event.depth == pytest.approx(depth, abs=4 * 0.002)
    assert event.start == round(0.4 / step)


def test_steady_state_and_noise_are_those_of_the_samples_before():
    event = detect(dip(length=3.0, start=2.0, sigma=0.004))
    assert event.steady == slice(1000, 2000)
    error_of_mean, error_of_sigma = 4 * 0.004 / np.sqrt(1000), 4 * 0.004 / np.sqrt(2000)
    np.testing.assert_allclose([event.U0, event.P0, event.Q0], [1.0, 0.8, 0.4], atol=error_of_mean)
    np.testing.assert_allclose(
        [event.noise_U, event.noise_P, event.noise_Q], 0.004, atol=error_of_sigma
    )
    assert event.f0 == 50.0


def test_noise_ignores_a_linear_trend_and_gaps():
    t = np.linspace(0, 1, 1000)
    wave = 0.01 * np.random.default_rng(3).standard_normal(1000)
    values = 5 + 3 * t + wave
    values[100:110] = np.nan
    x = np.column_stack([np.ones(990), t[np.isfinite(values)]])
    rest = np.linalg.lstsq(x, values[np.isfinite(values)], rcond=None)[1][0]
    assert estimate_noise(t, values) == pytest.approx(np.sqrt(rest / 988), rel=1e-9)


def test_noise_from_sample_to_sample_is_the_standard_deviation_whatever_is_slow():
    t = np.arange(40000) / 1000
    values = np.random.default_rng(2).normal(scale=0.003, size=len(t)) + 0.05 * np.sin(t)
    assert sample_noise(values) == pytest.approx(0.003, rel=0.02)


def test_a_dip_begins_where_the_voltage_leaves_a_tenth_of_the_margin():
    """3 % make it a dip; it began where 0.3 % were missing."""
    U = np.ones(1000)
    U[300:400] = np.maximum(1 - 0.00055 * np.arange(1, 101), 0.9)
    U[400:500] = 0.9
    assert find_dips(np.arange(1000) / 1000, U) == [(305, 500)]


def test_the_steady_state_ends_where_a_swell_before_the_dip_begins():
    U = np.ones(1200)
    U[500:560], U[600:700] = 1.1, 0.6
    made = Record("made", np.arange(1200) / 1000, U, np.ones(1200), np.ones(1200), source="made")
    assert detect(made).steady == slice(0, 500)


def test_recorded_frequency_gives_f0():
    made = dip()
    f = np.where(made.t < 0.3, 49.9, 50.3)
    with_f = Record(name="dip", t=made.t, U=made.U, P=made.P, Q=made.Q, f=f)
    assert detect(with_f).f0 == pytest.approx(49.9)


def test_slow_recovery_ends_the_dip_when_a_fifth_of_the_depth_is_left():
    event = detect(dip(slow=0.4, sigma=0.0))
    assert event.t_end == pytest.approx(0.45 + 0.2 * np.log(2), abs=0.002)  # 0.4 exp(-t/0.2) = 0.2


def test_a_voltage_that_settles_a_little_lower_has_recovered():
    made = dip(sigma=0.0005)
    U = np.where(made.t >= 0.449, 0.96, made.U)
    assert detect(Record(name="dip", t=made.t, U=U, P=made.P, Q=made.Q)).t_end == pytest.approx(
        0.45, abs=0.002
    )


def test_a_noisy_record_without_dip_stays_silent():
    for seed in range(20):
        t = np.arange(5000) * 1e-3
        assert find_dips(t, 1 + 0.02 * np.random.default_rng(seed).standard_normal(5000)) == []


def test_slow_drift_of_ten_percent_is_no_dip():
    t = np.arange(20000) * 1e-3
    U = 1 - 0.005 * t + 0.001 * np.random.default_rng(0).standard_normal(len(t))
    assert find_dips(t, U) == []


def test_several_dips_are_found_in_order_and_close_ones_are_one():
    t = np.arange(10000) * 1e-3
    U = np.ones(10000)
    for start, end in ((1000, 1150), (4000, 4040), (7000, 7100), (7110, 7200)):
        U[start:end] = 0.7
    assert find_dips(t, U) == [(1000, 1150), (4000, 4040), (7000, 7200)]


@settings(max_examples=60, deadline=None)
@given(
    depth=st.floats(0.05, 0.9),
    start=st.integers(10, 500),
    duration=st.integers(5, 400),
    scale=st.floats(0.6, 1.4),
    seed=st.integers(0, 1000),
)
def test_any_noisy_dip_is_found_once_to_two_samples(depth, start, duration, scale, seed):
    U = np.ones(1000)
    U[start : start + duration] -= depth
    U = scale * (U + 0.001 * np.random.default_rng(seed).standard_normal(1000))
    [(a, b)] = find_dips(np.arange(1000) * 1e-3, U)
    assert abs(a - start) <= 2
    assert abs(b - start - duration) <= 2


def test_no_dip_is_refused_with_the_largest_deviation():
    with pytest.raises(
        UserError,
        match=r"dip.csv: there is no dip: .* falls at most 2 % below it .* must exceed 3 %",
    ):
        detect(dip(depth=0.02, sigma=0.0))


@pytest.mark.parametrize("edge", [0.0, 0.06, 0.1])
@pytest.mark.parametrize("rate", [50, 200, 1000])
@pytest.mark.parametrize("drift", [-0.01, 0.01, -0.02, -0.05])
def test_a_dip_begins_where_it_begins_and_not_where_a_drift_crosses_a_threshold(drift, rate, edge):
    """The voltage drifts for a second, and on; the dip takes `edge` [s] to its depth."""
    t = np.arange(round(4 * rate)) / rate
    fall = np.clip((t - 2 + 1e-9) / max(edge, 1e-6), 0, 1) * (t < 2.3)
    U = (1 + drift * np.clip(t - 1, 0, None)) * (1 - 0.3 * fall)
    U += 5e-4 * np.random.default_rng(1).standard_normal(len(t))
    (start, _), *_ = find_dips(t, U)
    assert t[start] == pytest.approx(2, abs=max(2 / rate, 0.012))


def test_a_swell_alone_is_refused_and_said():
    made = dip(depth=-0.1, sigma=0.0)
    with pytest.raises(UserError, match=r"it rises by 10 % at t = 0.3 s: a swell is not fitted"):
        detect(made)


def test_a_record_that_starts_inside_the_dip_is_refused():
    with pytest.raises(
        UserError, match=r"the dip starts at sample 1 .*give a record that starts earlier"
    ):
        detect(dip(start=-0.05, sigma=0.0))


def test_too_few_samples_before_are_refused():
    with pytest.raises(
        UserError,
        match=r"dip.csv: the dip starts at sample 9 \(t = 0.008 s\): .* at least 10 samples",
    ):
        detect(dip(start=0.008, sigma=0.0))


def test_a_record_that_ends_right_after_the_dip_began_is_refused():
    with pytest.raises(
        UserError,
        match=r"dip.csv: the record is shorter than the dip: it ends at t = 0.999 s with U = ",
    ):
        detect(dip(start=0.901, duration=0.5))


def test_a_record_that_ends_in_its_dip_is_an_event_to_its_end():
    event = detect(dip(start=0.6, duration=5.0, sigma=0.0))
    assert event.unfinished
    assert (event.start, event.end, event.record.samples) == (600, 999, 1000)
    assert event.depth == pytest.approx(0.5)
    assert event.duration == pytest.approx(0.399)
    [note] = event.record.notes
    assert note == "the record ends at t = 0.999 s, 0.4 s into the dip: it is fitted to its end"
    assert not detect(dip()).unfinished


def test_lost_power_before_the_dip_is_refused():
    made = dip()
    P = np.where(made.t < 0.295, np.nan, made.P)
    with pytest.raises(UserError, match="P and Q have fewer than 10 values"):
        detect(Record(name="dip", t=made.t, U=made.U, P=P, Q=made.Q))


def test_the_sentence_a_user_reads():
    said = describe(detect(dip(sigma=0.0)))
    assert said == (
        "dip: dip of 50 % lasting 150 ms at t = 0.300 s, 300 samples before it, 1000 Hz, "
        "noise 0.00 % in P and 0.00 % in Q, of P"
    )


def test_the_sentence_mentions_what_is_unusual():
    made = dip()
    P = np.where(np.arange(made.samples) == 700, np.nan, -made.P)
    said = describe(detect(Record(name="dip", t=made.t, U=made.U, P=P, Q=made.Q)))
    assert "P is -0.8 before the dip" in said
    assert "1 samples lack P or Q" in said


def levels(*changes, length=4.0, sigma=5e-4, U2=None, seed=0):
    """A record whose voltage is 1 but for (start, end, level)."""
    t = np.arange(round(length * 1000)) * 1e-3
    U = np.ones(len(t))
    for start, end, level in changes:
        U[(t >= start) & (t < end)] = level
    U += sigma * np.random.default_rng(seed).standard_normal(len(t))
    return Record(name="made", t=t, U=U, P=0.8 * U**1.5, Q=0.4 * U**2, U2=U2)


class TestSwells:
    """A swell before a dip is not the level that the dip falls from."""

    @pytest.mark.parametrize("rise", [0.05, 0.15, 0.3])
    @pytest.mark.parametrize("gap", [0.0, 0.05, 0.6])
    def test_before_a_dip(self, rise, gap):
        made = levels((1.0, 1.5, 1 + rise), (1.5 + gap, 1.7 + gap, 0.7))
        event = detect(made)
        assert event.depth == pytest.approx(0.3, abs=0.005)
        assert event.duration == pytest.approx(0.2, abs=0.003)
        np.testing.assert_allclose([event.U0, event.P0, event.Q0], [1.0, 0.8, 0.4], atol=2e-3)

    def test_a_long_one_that_returns_leaves_no_dip(self):
        made = levels((1.0, 3.0, 1.1), length=5.0)
        assert find_dips(made.t, made.U) == []

    def test_a_step_up_becomes_the_level_after_a_second(self):
        made = levels((1.0, 9.0, 1.1), (4.0, 4.2, 0.66), length=6.0)
        assert detect(made).depth == pytest.approx(0.4, abs=0.01)

    def test_alone_is_refused_by_its_name(self):
        with pytest.raises(
            UserError, match=r"falls at most .* it rises by 15.* % .*: a swell is not fitted"
        ):
            detect(levels((1.0, 1.5, 1.15)))


class TestWhatIsNoDip:
    """Refused by its true name."""

    def test_an_interruption(self):
        with pytest.raises(
            UserError,
            match=r"the voltage is gone from t = 1 to 1.4 s \(U falls to .*\): an interruption",
        ):
            detect(levels((1.0, 1.4, 0.01), sigma=1e-5))

    def test_a_dead_line(self):
        with pytest.raises(
            UserError, match=r"the voltage is gone from t = 1 s on .*: the line is dead"
        ):
            detect(levels((1.0, 9.0, 0.01), sigma=1e-5))

    def test_an_open_pole(self):
        U2 = np.zeros(8000)
        U2[1000:6000] = 0.365
        with pytest.raises(
            UserError, match=r"U2 is 57.9 % of U for 5 s at t = 1 s, .*: one pole is open"
        ):
            detect(levels((1.0, 6.0, 0.63), length=8.0, sigma=0.0, U2=U2))

    def test_a_fault_of_one_phase_is_one(self):
        U2 = np.zeros(4000)
        U2[1000:1200] = 0.3
        assert detect(levels((1.0, 1.2, 0.7), U2=U2)).depth == pytest.approx(0.3, abs=0.01)

    def test_a_tap_step_down(self):
        with pytest.raises(
            UserError, match=r"falls by 5 % at t = 1 s and stays there for the 3 s .*: a step"
        ):
            detect(levels((1.0, 9.0, 0.95)))

    def test_a_ramp(self):
        t = np.arange(20000) * 1e-3
        U = 1 - 0.005 * t
        with pytest.raises(UserError, match=r"falls by 10 % .*, but slowly: a ramp, no dip"):
            detect(Record(name="made", t=t, U=U, P=0.8 * U, Q=0.4 * U))

    def test_a_dip_smaller_than_the_noise_says_how_large_it_must_be(self):
        with pytest.raises(UserError, match=r"but a dip must exceed 3 % and the noise, here \d"):
            detect(levels((1.0, 1.2, 0.97), sigma=0.02))

    def test_frequency_is_not_asked_for_while_there_is_no_voltage(self):
        made = levels((1.0, 9.0, 1e-4), sigma=1e-6)
        f = np.where(made.U < 0.05, -191.944, 50.0)
        dead = Record(name="made", t=made.t, U=made.U, P=made.P, Q=made.Q, f=f).check()
        with pytest.raises(UserError, match="the line is dead"):
            detect(dead)
        with pytest.raises(
            UserError, match=r"f = 70 is more than 20 % off the nominal 50 Hz at a voltage of 1"
        ):
            Record(
                name="made", t=made.t, U=made.U, P=made.P, Q=made.Q, f=np.where(made.t < 1, 70.0, f)
            ).check()


class TestDirection:
    def test_a_load_counted_the_wrong_way(self):
        made = dip(sigma=0.0)
        told = describe(detect(Record(name="made", t=made.t, U=made.U, P=-made.P, Q=-made.Q)))
        assert "|P| goes as U^1.5 when the voltage falls, as a load's" in told
        assert "data.reverse_current=true" in told

    def test_regeneration(self):
        made = dip(sigma=0.0)
        told = describe(
            detect(
                Record(name="made", t=made.t, U=made.U, P=-0.5 + 0 * made.P, Q=0.02 + 0 * made.Q)
            )
        )
        assert "regeneration (a braking train)" in told
        assert "reverse_current" not in told

    def test_a_train_that_motors_again_after_the_dip(self):
        made = dip(sigma=0.0)
        P = np.where(made.t < 0.6, -0.4, 0.7)
        told = describe(detect(Record(name="made", t=made.t, U=made.U, P=P, Q=0.1 * P)))
        assert "P is -0.4 before the dip: P changes its sign at normal voltage" in told

    def test_noise_is_no_load(self):
        made = dip(sigma=0.0)
        P = -1e-4 + 1e-3 * np.random.default_rng(0).standard_normal(made.samples)
        assert "no more than noise, so this is no load" in describe(
            detect(Record(name="made", t=made.t, U=made.U, P=P, Q=P))
        )


class TestFuse:
    """A voltage that is lost while P + jQ over U, the current, stays."""

    def record(self, left, U2=None, current=1.0):
        t = np.arange(3000) / 1000
        U = np.where(t < 1.0, 1.0, left)
        I = np.where(t < 1.0, 1.0, current)
        unbalance = None if U2 is None else np.where(t < 1.0, 1e-3, U2)
        return Record("made", t, U, 0.8 * U * I, 0.4 * U * I, U2=unbalance, source="made.csv")

    @pytest.mark.parametrize(("left", "U2"), [(2 / 3, 1 / 3), (1e-3, None)])
    def test_it_is_refused_by_its_name(self, left, U2):
        with pytest.raises(
            UserError, match="while the current stays as it was: a fuse of the voltage transformers"
        ):
            detect(self.record(left, U2))

    def test_a_fault_of_one_phase_that_moves_the_current_by_a_tenth_is_none(self):
        made = self.record(
            np.where(np.arange(3000) < 1270, 0.46, 1.0),
            np.where(np.arange(3000) < 1270, 0.26, 1e-3),
        )
        swings = 1 - 0.03 - 0.06 * np.cos(2 * np.pi * (made.t - 1.0) / 0.27) * (made.t >= 1.0)
        assert detect(replace(made, P=made.P * swings, Q=made.Q * swings)).end == pytest.approx(
            1270, abs=10
        )

    def test_a_fault_that_lasts_to_the_end_is_none(self):
        made = self.record(0.79, 0.21)
        assert detect(made.part(slice(0, 1250))).unfinished

    @pytest.mark.parametrize(("left", "U2"), [(2 / 3, 1 / 3), (1e-3, None)])
    def test_a_current_that_goes_with_the_voltage_is_none(self, left, U2):
        with pytest.raises(UserError) as refusal:
            detect(self.record(left, U2, current=0.5))
        assert "fuse" not in str(refusal.value)


def test_a_voltage_beyond_all_measure_ends_in_no_warning():
    """Bits lost in a file may make 1e30 of a voltage, beside which all others are nothing."""
    t = np.arange(800) / 200
    U = np.where((t >= 2) & (t < 2.15), 0.7, 1.0)
    U[500], U[600] = 1e30, 1e30
    assert detect(
        Record("made", t, U, 0.8 * np.ones(800), 0.4 * np.ones(800))
    ).depth == pytest.approx(0.3)


@pytest.mark.parametrize("size", [0.1, 110.0])
def test_dips_and_swells_are_the_same_in_any_unit_of_voltage(size):
    """A swell that rises slowly, two dips, and a long rise that ends in a dip, which
    is no swell.
    """
    t = np.arange(9000) / 1000
    U = 1 + 0.0005 * np.random.default_rng(3).standard_normal(9000)
    U[600:700] += np.minimum(0.005 * np.arange(100), 0.1)
    for first, stop, change in (
        (1500, 1600, -0.05),
        (2500, 2700, -0.6),
        (4000, 7000, 0.1),
        (7000, 7200, -0.3),
    ):
        U[first:stop] += change
    lower, higher = find_falls(t, U)
    assert [start for start, _ in lower] == [1500, 2500, 7000]
    assert [end for _, end in higher] == [700]
    assert 601 <= higher[0][0] <= 603  # where it leaves a tenth of the margin
    assert find_falls(t, size * U) == (lower, higher)


def test_the_end_of_a_dip_that_never_ends_is_that_of_the_record():
    t = np.arange(1000) / 1000
    U = np.where(t < 0.5, 1.0, 0.6)
    (dip,) = dips.cut_dips(
        [Record("long", t, U, 0.8 * U, 0.3 * U, source="long.csv")], "long.csv", 1.0, 10.0
    )
    assert (dip.start, dip.end) == (0.5, t[-1])


def test_a_load_without_active_power_before_its_dip_has_no_level():
    t = np.arange(1000) / 1000
    U = np.where((t > 0.5) & (t < 0.6), 0.6, 1.0)
    record = Record("gaps", t, U, np.where(t <= 0.5, np.nan, 0.8), 0.3 * U, source="gaps.csv")
    assert dips.level(record) == (1.0, 0.0)


def test_one_base_beside_a_record_of_which_nobody_said_the_mva():
    """Both are in the unit of one file then: 5 per unit of it are 2.5 of a record that has 2 of
    them as its own.
    """
    own = OwnBase(power=50.0, file_power=10.0, in_mva=True)
    there = SimpleNamespace(
        base=SimpleNamespace(power=2.0),
        file_base=SimpleNamespace(power=1.0, in_mva=False, origin=""),
    )
    assert own.compute_ratio(there) == 2.5
