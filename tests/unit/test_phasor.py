"""Phasors of synthetic three-phase waveforms against the amplitudes and angles they
were made of.
"""

import numpy as np
import pytest

from tractexp.errors import UserError
from tractexp.record.phasor import compute_sequences
from tractexp.record.phasor_measurement import measure, measure_fundamental, one_cycle, track
from tractexp.recording.estimator import estimator_of

PHASES = np.array([100, 80 * np.exp(-2.2j), 95 * np.exp(2.0j)])  # unbalanced on purpose
FREQUENCIES = [48.5, 50.0, 51.7]
RATES = [1000.0, 1200.0, 3200.0, 6400.0]


def waves(phasors, f, t):
    """Instantaneous values (K, N) of RMS phasors (K,)."""
    return np.sqrt(2) * np.real(np.asarray(phasors)[:, None] * np.exp(2j * np.pi * f * t))


def inside(rate, count):
    """Samples about which a cycle lies within so many."""
    reach = one_cycle(rate, 50.0).reach
    return np.arange(reach, count - reach)


def seconds(rate, length=0.5):
    return np.arange(round(rate * length)) / rate


@pytest.mark.parametrize("f", FREQUENCIES)
@pytest.mark.parametrize("rate", RATES)
def test_phasor_at_known_frequency_is_exact(rate, f):
    x = waves(PHASES, f, seconds(rate))
    X = measure_fundamental(x, rate, f, inside(rate, x.shape[1]))
    np.testing.assert_allclose(X, PHASES[:, None] * np.ones(X.shape[1]), rtol=1e-11)


@pytest.mark.parametrize("f", FREQUENCIES)
@pytest.mark.parametrize("rate", RATES)
def test_tracked_frequency_of_unbalanced_voltages_is_right_to_20_microhertz(rate, f):
    assert track(waves(PHASES, f, seconds(rate)), rate, 50.0) == pytest.approx(f, abs=2e-5)


@pytest.mark.parametrize("f", FREQUENCIES)
def test_tracking_follows_a_ramp_of_frequency(f):
    rate, slope = 3200.0, 0.5  # Hz/s
    t = seconds(rate, 1.0)
    angle = 2 * np.pi * (f * t + slope * t**2 / 2)
    voltages = np.cos(angle - 2 * np.pi / 3 * np.arange(3)[:, None])
    middle = (t > 0.1) & (t < 0.9)
    np.testing.assert_allclose(
        track(voltages, rate, 50.0)[middle], (f + slope * t)[middle], atol=1e-3
    )


def test_harmonics_and_offset_vanish_at_nominal_frequency():
    t = seconds(3200.0)
    k = np.arange(3)[:, None]
    distorted = (
        waves(PHASES, 50.0, t) + 2 + 5 * np.cos(5 * (2 * np.pi * 50 * t - 2 * np.pi / 3 * k))
    )
    X = measure_fundamental(distorted, 3200.0, 50.0, inside(3200.0, len(t)))
    np.testing.assert_allclose(X, PHASES[:, None] * np.ones(X.shape[1]), rtol=1e-11)


@pytest.mark.parametrize("f", [48.5, 51.7])
def test_five_percent_fifth_harmonic_off_nominal_leaks_less_than_a_thousandth(f):
    t = seconds(3200.0)
    k = np.arange(3)[:, None]
    distorted = waves(PHASES, f, t) + 5 * np.sqrt(2) * np.cos(
        5 * (2 * np.pi * f * t - 2 * np.pi / 3 * k)
    )
    X = measure_fundamental(distorted, 3200.0, f, inside(3200.0, len(t)))
    assert np.abs(X - PHASES[:, None]).max() < 1e-3 * 100


def test_plain_window_of_nominal_length_would_leak_far_more():
    """Negative control: the accuracy above comes from the adapted window, not from an
    easy signal.
    """
    f, N = 51.7, 64
    x = waves(PHASES[:1], f, seconds(3200.0))[0]
    n = np.arange(N)
    plain = (
        np.array([x[i : i + N] @ np.exp(-2j * np.pi * n / N) for i in range(400)]) * np.sqrt(2) / N
    )
    assert np.ptp(np.abs(plain)) > 1.0


def test_sequences_are_separated():
    a = np.exp(2j * np.pi / 3)
    V1, V2 = 3.0 - 1.0j, 0.4 + 0.2j
    positive, negative = compute_sequences(
        np.array([[V1 + V2], [a**2 * V1 + a * V2], [a * V1 + a**2 * V2]])
    )
    np.testing.assert_allclose([positive[0], negative[0]], [V1, V2], rtol=1e-14)


@pytest.mark.parametrize("f", FREQUENCIES)
def test_power_is_three_v_conjugate_i_and_positive_when_consumed(f):
    lag = np.exp(-1j * np.deg2rad(30))
    balanced = np.exp(-2j * np.pi / 3 * np.arange(3))
    made = measure(
        waves(np.concatenate([100 * balanced, 0.2 * lag * balanced]), f, seconds(3200.0)),
        3200.0,
        50.0,
    )
    np.testing.assert_allclose(made.S, 60 * np.exp(1j * np.deg2rad(30)), rtol=1e-7)
    np.testing.assert_allclose(made.f, f, atol=1e-5)
    np.testing.assert_allclose(np.abs(made.V2), 0, atol=1e-5)


def test_phasors_are_stamped_at_the_center_of_their_window():
    """A step of amplitude is seen half way when the stamp is at the step."""
    t = seconds(3200.0)
    balanced = np.exp(-2j * np.pi / 3 * np.arange(3))
    x = waves(np.concatenate([balanced, balanced]), 50.0, t) * np.where(t < 0.25, 1.0, 0.5)
    made = measure(x, 3200.0, 50.0, step=1 / 3200)
    half = np.interp(0.75, np.abs(made.V1)[::-1], made.t[::-1])
    assert half == pytest.approx(0.25, abs=1 / 3200)


def test_turning_speed_integrates_to_a_jump_of_the_voltage_angle():
    t = seconds(3200.0)
    balanced = np.exp(-2j * np.pi / 3 * np.arange(3))
    angle = 2 * np.pi * 50 * t + np.where(t < 0.25, 0.0, 0.3)
    x = np.real(np.concatenate([balanced, balanced])[:, None] * np.exp(1j * angle))
    made = measure(x, 3200.0, 50.0)
    assert 2 * np.pi * np.trapezoid(made.f - 50, made.t) == pytest.approx(0.3, rel=1e-3)


def test_skew_turns_a_channel_back_by_the_time_it_was_late():
    t = seconds(3200.0)
    balanced = np.exp(-2j * np.pi / 3 * np.arange(3))
    late = 300e-6
    x = np.concatenate([waves(balanced, 50.0, t), waves(balanced, 50.0, t + late)])
    corrected = measure(x, 3200.0, 50.0, skew=np.array([0, 0, 0, late, late, late]))
    np.testing.assert_allclose(corrected.S, 3.0, rtol=1e-9)
    assert np.abs(measure(x, 3200.0, 50.0).S.imag).min() > 0.28


def test_too_short_a_waveform_is_refused():
    with pytest.raises(UserError, match="100 samples at 3200 Hz are too short"):
        measure(np.ones((6, 100)), 3200.0, 50.0)


def test_a_waveform_must_span_its_estimators_window_and_one_phasor_more():
    window = estimator_of({"name": "m_class"}).averager
    every, rate = 3, 3200.0  # samples from phasor to phasor
    least = 2 * (window(rate, 50.0).reach + every) + 1
    t = np.arange(least) / rate
    whole = measure(three_phase(50.0, t), rate, 50.0, window=window)
    assert len(whole.t) >= 3
    with pytest.raises(UserError, match=f"{least - 1} samples at 3200 Hz are too short"):
        measure(three_phase(50.0, t[:-1]), rate, 50.0, window=window)


def three_phase(f, t, lag=0.5, distortion=0.0, noise=0.0, seed=0):
    """Waves (6, N) of 1 kV and 1 kA, with this share of third, fifth and seventh harmonic together,
    and noise.
    """
    rng, k = np.random.default_rng(seed), np.arange(3)[:, None]
    x = []
    for angle in (0.0, -lag):
        side = np.sqrt(2) * np.cos(2 * np.pi * f * t - 2 * np.pi / 3 * k + angle)
        for h, share in ((3, 0.5), (5, 0.7), (7, np.sqrt(1 - 0.25 - 0.49))):
            turn = h * (2 * np.pi * f * t - 2 * np.pi / 3 * k) + 0.3 * h + angle
            side += np.sqrt(2) * distortion * share * np.cos(turn)
        x.append(side + noise * rng.normal(size=side.shape))
    return np.concatenate(x)


@pytest.mark.parametrize("block", [600, 1777, 5000])
def test_phasors_do_not_depend_on_the_blocks_they_are_measured_in(block):
    """A jump of the angle, a dip and a ramp of frequency lie across the cuts."""
    t = seconds(4000.0, 2.0)
    turned = 0.3 * (t > 0.7) + np.pi * 0.8 * t**2
    x = three_phase(50.3, t + turned / (2 * np.pi * 50.3), 0.4, 0.03, 1e-3) * np.where(
        abs(t - 1.1) < 0.2, 0.4, 1.0
    )
    whole, cut = (measure(x, 4000.0, 50.0, harmonics=(3, 5), block=n) for n in (1 << 20, block))
    for name in ("t", "V", "I", "f"):
        np.testing.assert_allclose(
            getattr(cut, name), getattr(whole, name), rtol=1e-9, atol=1e-9, err_msg=name
        )
    for name, values in whole.more.items():
        np.testing.assert_allclose(cut.more[name], values, rtol=1e-7, atol=1e-9, err_msg=name)


def test_a_dead_voltage_leaves_the_frequency_alone():
    """What a recorder shows of a line that is dead is noise, whose angle jumps about."""
    t = seconds(4000.0, 1.0)
    x = three_phase(50.2, t) * np.where(t < 0.5, 1.0, 0.0)
    x += 1e-4 * np.random.default_rng(0).normal(size=x.shape)
    made = measure(x, 4000.0, 50.0)
    assert np.abs(made.f[made.t < 0.48] - 50.2).max() < 0.05
    assert np.abs(made.f - 50.0).max() < 2.5


def test_waves_are_read_block_by_block():
    """A source that is sliced like an array; never more than a block and its margins."""

    class Source:
        shape = (6, 40_000)
        longest = 0

        def __getitem__(self, at):
            first, stop, _ = at[1].indices(self.shape[1])
            self.longest = max(self.longest, stop - first)
            return three_phase(50.0, np.arange(first, stop) / 4000.0)[at[0]]

    source = Source()
    made = measure(source, 4000.0, 50.0, block=4000)
    np.testing.assert_allclose(np.abs(made.S), 3.0, rtol=1e-6)
    assert source.longest < 6000


@pytest.mark.parametrize("f", [48.0, 50.0, 52.0])
def test_harmonics_and_distortion_are_those_of_the_waves(f):
    made = measure(three_phase(f, seconds(4000.0), 0.5, 0.03), 4000.0, 50.0, harmonics=(3, 5, 7))
    for h, share in ((3, 0.5), (5, 0.7), (7, np.sqrt(1 - 0.25 - 0.49))):
        P = 3 * (0.03 * share) ** 2 * np.cos(0.5)
        np.testing.assert_allclose(made.more[f"P_{h}"], P, rtol=0.02)
    np.testing.assert_allclose(made.more["P_H"], 3 * 0.03**2 * np.cos(0.5), rtol=0.02)
    np.testing.assert_allclose(made.more["THD_u"], 0.03, rtol=0.01)
    np.testing.assert_allclose(made.more["THD_i"], 0.03, rtol=0.01)


def test_without_harmonics_asked_for_there_are_none():
    assert measure(three_phase(50.0, seconds(4000.0)), 4000.0, 50.0).more == {}
