"""The band for the next dip, `measure_band`: known answers, noise, stalls, and the scatter of
parameters.
"""

import numpy as np
import pytest

from tractexp.domain import Playback
from tractexp.errors import UserError
from tractexp.identification.forecast import Forecast
from tractexp.inference.prediction_band import (
    PredictionBand,
    find_largest_change,
    find_noise_peak,
    find_scatter,
    measure_band,
)
from tractexp.record import Record, detect

START, SAMPLES, STEP = 150, 1000, 0.002
CHANGE = 0.3  # pu of P in the dip


def play(noise=0.0, missed=0.0, seed=1):
    """An event whose P changes by `CHANGE`, of which the model misses a share in the dip."""
    t = STEP * np.arange(SAMPLES)
    dip = (np.arange(SAMPLES) >= START) & (np.arange(SAMPLES) < 400)
    rng = np.random.default_rng(seed)
    P = 1.0 - CHANGE * dip
    Q = np.full(SAMPLES, 0.5)
    wide = noise * rng.standard_normal((2, SAMPLES))
    event = detect(Record("made", t, 1.0 - 0.3 * dip, P + wide[0], Q + wide[1]))
    return Playback.of_power(event, P + missed * CHANGE * dip, Q)


def test_what_is_missed_is_a_share_of_the_change_in_the_channel_that_misses_it():
    band = measure_band([play(missed=0.1)])
    assert band.share == pytest.approx((0.1 / 0.9, 0.0), abs=1e-9)
    assert band.noise == pytest.approx((0.0, 0.0), abs=1e-12)


def test_it_grows_with_the_next_change_and_with_fewer_known_events():
    one, three = (PredictionBand((0.0, 0.0), (0.01, 0.02), events) for events in (1, 3))
    half = one.find_half_width(0.5, 1000, np.zeros(2))
    assert one.find_half_width(1.0, 1000, np.zeros(2)) == pytest.approx(2 * half)
    assert half[1] == pytest.approx(2 * half[0])
    assert (half > three.find_half_width(0.5, 1000, np.zeros(2))).all()
    assert half[0] > 0.01 * 0.5


def test_of_an_exact_model_the_noise_alone_is_left_and_19_of_20_events_are_within():
    known = [[play(noise=0.002, seed=4 * load + k) for k in range(4)] for load in range(20)]
    bands = [measure_band(events) for events in known]
    halves = [band.find_half_width(CHANGE, SAMPLES - START, np.zeros(2)) for band in bands]
    played = [play(noise=0.002, seed=seed) for seed in range(100, 300)]
    left = [[one.P - one.event.record.P, one.Q - one.event.record.Q] for one in played]
    worst = np.abs(np.array(left))[:, :, START:].max(axis=2)
    held = [(worst <= half).mean(axis=0) for half in halves]
    assert (np.mean(held, axis=0) > 0.95).all()
    assert (np.mean(halves, axis=0) < 5 * 0.002).all()


def test_what_the_noise_of_known_events_hides_is_not_taken_to_be_nothing():
    """An error of one sample and two standard deviations is hidden in the known events and six in
    one that is three times as large: more than six of ten bands are as wide. Of the largest
    excursion of noise taken from what the known events show every fourth is.
    """
    error = np.where(np.arange(SAMPLES) == START + 20, 2 * 0.002, 0.0)
    held = []
    for load in range(60):
        played = [play(noise=0.002, seed=3 * load + k) for k in range(3)]
        known = [Playback.of_power(one.event, one.P + error, one.Q) for one in played]
        half = measure_band(known).find_half_width(3 * CHANGE, SAMPLES - START, np.zeros(2))
        held.append(half[0] >= 6 * 0.002)
    assert np.mean(held) > 0.6


def test_the_peak_of_one_sample_is_that_of_a_95_percent_interval_and_grows_slowly():
    assert find_noise_peak(1) == pytest.approx(1.96, abs=0.01)
    assert 3.9 < find_noise_peak(1000) < 4.2


def test_a_model_whose_motor_stalls_on_a_known_event_promises_nothing():
    one = play()
    stalled = Playback.of_power(one.event, np.full(SAMPLES, np.nan), one.Q)
    assert measure_band([one, stalled]) is None
    standstill = np.where(np.arange(SAMPLES) > START, 6.0, 1.0)
    assert measure_band([Playback.of_power(one.event, standstill, one.Q)]) is None


def test_an_oscillation_of_the_systems_frequency_is_no_change_of_the_load():
    ringing = np.sin(2 * np.pi * 50 * 1e-4 * np.arange(2000))
    assert find_largest_change(0.2 + ringing, 1e-4, 50.0) == pytest.approx(0.2, rel=1e-6)


def test_the_scatter_is_that_of_a_linear_model_and_a_side_without_steady_state_is_avoided():
    slopes = np.array([[1.0, 2.0], [0.5, -1.0]])
    root = np.array([[0.3, 0.0], [0.1, 0.2]])

    def calculate(values):
        if values[0] > 0:
            raise UserError("no steady state")
        return (slopes @ values)[:, None] * np.array([0.5, 1.0])

    expected = np.sqrt(np.sum((slopes @ root.T) ** 2, axis=1))
    assert find_scatter(calculate, np.zeros(2), root) == pytest.approx(expected)


def test_a_result_of_an_earlier_version_promises_nothing():
    assert Forecast.from_content({}, ["a"], np.zeros(1)) is None


def test_the_stored_scatter_is_read_by_the_names_of_the_parameters():
    content = {"noise": [0.1, 0.2], "share": [0.0, 0.0], "events": 2}
    content |= {"scatter": {"b": [1.0, 2.0], "a": [3.0, 4.0]}}
    forecast = Forecast.from_content(content, ["a", "fixed", "b"], np.zeros(3))
    assert forecast.root.tolist() == [[3.0, 0.0, 1.0], [4.0, 0.0, 2.0]]
