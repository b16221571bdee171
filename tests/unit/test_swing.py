"""A swing of the load before a dip: its frequency and size, and what is none."""

import numpy as np
import pytest

import tractexp
from tractexp.record import Record, detect
from tractexp.record.swing import find_swing

RATE = 400.0
TIMES = np.arange(800) / RATE  # a dip after 1 s
VOLTAGE = np.where((TIMES >= 1.0) & (TIMES < 1.2), 0.7, 1.0)


def record(P=1.0, Q=1.0, U=1.0, noise=0.0, seed=0):
    """A load of 0.8 and 0.6 pu; P, Q and U are factors (N,)."""
    draws = noise * np.random.default_rng(seed).standard_normal((2, len(TIMES)))
    voltage = VOLTAGE * U
    return Record(
        "made",
        TIMES,
        voltage,
        0.8 * P * voltage**2 * (1 + draws[0]),
        0.6 * Q * voltage**2 * (1 + draws[1]),
    )


def wave(amplitude, frequency):
    return 1 + amplitude * np.sin(2 * np.pi * frequency * TIMES + 0.3)


@pytest.mark.parametrize(
    ("frequency", "amplitude", "noise"), [(18.5, 0.03, 1e-4), (18.5, 0.03, 0.01), (8.0, 0.02, 1e-3)]
)
def test_a_swing_has_its_frequency_and_size(frequency, amplitude, noise):
    event = detect(record(P=wave(amplitude / 0.8, frequency), noise=noise))
    assert event.swing is not None
    assert event.swing.quantity == "P"
    assert event.swing.frequency == pytest.approx(frequency, abs=0.15)
    assert event.swing.amplitude == pytest.approx(amplitude, rel=0.05)
    assert any("which counts as noise" in note for note in event.record.notes)


def test_a_swing_of_q_is_told_as_one_of_q():
    swing = detect(record(Q=wave(0.05, 12.0), noise=1e-3)).swing
    assert (swing.quantity, round(swing.frequency)) == ("Q", 12)


@pytest.mark.parametrize("seed", range(20))
def test_noise_swings_at_no_frequency(seed):
    assert detect(record(noise=0.02, seed=seed)).swing is None


def test_noise_that_wanders_is_no_swing():
    for seed in range(20):
        steps = np.random.default_rng(seed).standard_normal(len(TIMES))
        slow = np.zeros(len(TIMES))
        for k in range(1, len(TIMES)):
            slow[k] = 0.95 * slow[k - 1] + 0.01 * steps[k]
        assert find_swing(record(P=1 + slow), slice(0, 390)) is None


def test_what_the_voltage_does_is_no_swing_of_the_load():
    assert detect(record(U=wave(0.02, 9.0), noise=1e-3)).swing is None


def test_a_look_and_a_read_tell_it(tmp_path):
    made = record(P=wave(0.03, 18.5), noise=1e-3)
    path = tmp_path / "swing.csv"
    rows = np.column_stack([made.t, made.U, made.P, made.Q])
    np.savetxt(path, rows, "%.9g", ",", header="t,U,P,Q", comments="")
    said = "P swings at 18.5 Hz by ± 2.4 % of the apparent power, which counts as noise"
    assert said in tractexp.look(path, progress=False).events.rows[0]["why"]
    assert any(said in note for note in tractexp.read(path)[0].record.notes)
