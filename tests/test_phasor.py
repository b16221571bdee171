"""Phasors of synthetic three-phase waveforms against the amplitudes and angles they were made of."""

import numpy as np
import pytest

from tractexp.errors import UserError
from tractexp.record.phasor import fundamental, measure, sequences, track

PHASES = np.array([100, 80 * np.exp(-2.2j), 95 * np.exp(2.0j)])  # unbalanced on purpose
FREQUENCIES = [48.5, 50.0, 51.7]
RATES = [1000.0, 1200.0, 3200.0, 6400.0]


def waves(phasors, f, t):
    """Instantaneous values (K, N) of RMS phasors (K,)."""
    return np.sqrt(2) * np.real(np.asarray(phasors)[:, None] * np.exp(2j * np.pi * f * t))


def seconds(rate, length=0.5):
    return np.arange(round(rate * length)) / rate


@pytest.mark.parametrize("f", FREQUENCIES)
@pytest.mark.parametrize("rate", RATES)
def test_phasor_at_known_frequency_is_exact(rate, f):
    _, X = fundamental(waves(PHASES, f, seconds(rate)), rate, f)
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
    np.testing.assert_allclose(track(voltages, rate, 50.0)[middle], (f + slope * t)[middle], atol=1e-3)


def test_harmonics_and_offset_vanish_at_nominal_frequency():
    t = seconds(3200.0)
    k = np.arange(3)[:, None]
    distorted = waves(PHASES, 50.0, t) + 2 + 5 * np.cos(5 * (2 * np.pi * 50 * t - 2 * np.pi / 3 * k))
    _, X = fundamental(distorted, 3200.0, 50.0)
    np.testing.assert_allclose(X, PHASES[:, None] * np.ones(X.shape[1]), rtol=1e-11)


@pytest.mark.parametrize("f", [48.5, 51.7])
def test_five_percent_fifth_harmonic_off_nominal_leaks_less_than_a_thousandth(f):
    t = seconds(3200.0)
    k = np.arange(3)[:, None]
    distorted = waves(PHASES, f, t) + 5 * np.sqrt(2) * np.cos(5 * (2 * np.pi * f * t - 2 * np.pi / 3 * k))
    _, X = fundamental(distorted, 3200.0, f)
    assert np.abs(X - PHASES[:, None]).max() < 1e-3 * 100


def test_plain_window_of_nominal_length_would_leak_far_more():
    """Negative control: the accuracy above comes from the adapted window, not from an easy signal."""
    f, N = 51.7, 64
    x = waves(PHASES[:1], f, seconds(3200.0))[0]
    n = np.arange(N)
    plain = np.array([x[i : i + N] @ np.exp(-2j * np.pi * n / N) for i in range(400)]) * np.sqrt(2) / N
    assert np.ptp(np.abs(plain)) > 1.0


def test_sequences_are_separated():
    a = np.exp(2j * np.pi / 3)
    V1, V2 = 3.0 - 1.0j, 0.4 + 0.2j
    positive, negative = sequences(np.array([[V1 + V2], [a**2 * V1 + a * V2], [a * V1 + a**2 * V2]]))
    np.testing.assert_allclose([positive[0], negative[0]], [V1, V2], rtol=1e-14)


@pytest.mark.parametrize("f", FREQUENCIES)
def test_power_is_three_v_conjugate_i_and_positive_when_consumed(f):
    lag = np.exp(-1j * np.deg2rad(30))
    balanced = np.exp(-2j * np.pi / 3 * np.arange(3))
    made = measure(waves(np.concatenate([100 * balanced, 0.2 * lag * balanced]), f, seconds(3200.0)), 3200.0, 50.0)
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
