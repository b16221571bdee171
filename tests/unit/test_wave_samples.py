"""Samples of waveforms by themselves: what is cut out, what is periodic, per unit of what, and the
blocks of residuals that `cut_blocks` makes.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from tractexp.inference.blocks import cut_blocks
from tractexp.inference.interval import compute_interval_factor
from tractexp.record.periodic import Periodic
from tractexp.record.record import Base
from tractexp.record.synthetic import build_synthetic_event
from tractexp.record.wave_event import _scale
from tractexp.record.waves import Waves

RATE, FREQUENCY = 1000.0, 50.0


def test_a_part_of_the_samples_has_those_from_one_time_to_another():
    waves = Waves(np.arange(600.0).reshape(6, 100), start=2.0, rate=100.0, late=np.arange(6.0))
    assert (waves.phases, waves.end) == (3, pytest.approx(2.99))
    part = waves.between(2.1, 2.2)
    assert part.samples[0].tolist() == list(range(10, 21))
    assert (part.start, part.end) == (pytest.approx(2.1), pytest.approx(2.2))
    assert waves.between(0.0, 9.0).samples.shape == (6, 100)


@pytest.mark.parametrize("late", [None, np.arange(6.0)])
def test_samples_come_back_from_plain_data(late):
    waves = Waves(np.arange(12.0).reshape(6, 2), 1.0, RATE, {"name": "one_cycle"}, late)
    back = Waves.from_content(waves.to_dict())
    assert (back.start, back.rate, back.estimator) == (1.0, RATE, {"name": "one_cycle"})
    assert (back.samples == waves.samples).all()
    assert (back.late is None) if late is None else (back.late == late).all()


def test_what_is_periodic_is_fitted_as_far_as_samples_and_rate_allow():
    t = np.arange(200) / RATE
    x = np.array(
        [0.3 + np.cos(2 * np.pi * FREQUENCY * t) + 0.1 * np.sin(6 * np.pi * FREQUENCY * t)]
    )
    series = Periodic.from_samples(t, x, FREQUENCY, RATE)
    assert len(series.coefficients) == 2 * int(0.45 * RATE / FREQUENCY) + 1
    assert pytest.approx(x, abs=1e-12) == (series.basis(t) @ series.coefficients).T
    assert series.rest == pytest.approx([0.0], abs=1e-12)
    few = Periodic.from_samples(
        t[:20], x[:, :20], FREQUENCY, RATE
    )  # three samples for each of its numbers
    assert len(few.coefficients) == 2 * ((20 // 3 - 1) // 2) + 1


@pytest.mark.parametrize(
    ("phases", "volts", "amperes"),
    [(3, np.sqrt(2 / 3), np.sqrt(2 / 3)), (1, np.sqrt(2), np.sqrt(2))],
)
def test_one_per_unit_is_the_peak_of_a_phase(phases, volts, amperes):
    """Of line voltages and the power of three phases, or of the one voltage and power that there
    are.
    """
    record = SimpleNamespace(base=Base(voltage=110.0, power=20.0, frequency=FREQUENCY))
    V, I = _scale(record, phases)[[0, -1]]
    assert (pytest.approx(110.0 * volts), pytest.approx(20.0 / 110.0 * amperes)) == (V, I)
    assert phases / 2 * V * I == pytest.approx(20.0)


def test_a_voltage_that_nobody_recorded_is_an_event_of_its_load():
    t = 0.1 + np.arange(800) / RATE
    v = np.where((t > 0.3) & (t < 0.5), 0.6, 1.0) + 0.0j
    event = build_synthetic_event("planned", t, v, (1.0, 0.8, 0.6), FREQUENCY, 201, 400)
    assert (event.depth, event.U0, event.P0, event.Q0, event.dips) == (
        pytest.approx(0.4),
        1.0,
        0.8,
        0.6,
        1,
    )
    assert event.steady == slice(0, 201)
    waves = event.record.waves
    assert (waves.start, waves.rate, waves.phases) == (pytest.approx(0.1), pytest.approx(RATE), 3)
    drawn = event.currents[0] + 1j * event.currents[1]
    S = v[0] * np.conj(drawn / event.turn)  # P + jQ in the frame that turns
    assert pytest.approx(np.full(800, 0.8 + 0.6j)) == S
    assert (event.v_zero == 0).all()


def test_blocks_are_counted_from_the_start_of_each_dip():
    """Tenths of a second; what is left over of them is before the dip, or in the last block."""
    parts = [slice(0, 1050), slice(1050, 2100)]
    drive = SimpleNamespace(events=2, part=parts.__getitem__, parts=parts)
    events = [SimpleNamespace(start=230, record=SimpleNamespace(step=0.001)) for _ in range(2)]
    whole, after = cut_blocks(events, drive), cut_blocks(events, drive, from_dip=True)
    assert [b.start for b in whole[:4]] == [0, 30, 130, 230]
    assert [b.start for b in after[:2]] == [230, 330]
    assert 1050 + 230 in [b.start for b in after]
    assert all(b.stop - b.start >= 30 for b in whole)
    assert sum(b.stop - b.start for b in whole) == 2100
    assert sum(b.stop - b.start for b in after) == 2 * (1050 - 230)
    # shorter ones, three for each parameter
    assert len(cut_blocks(events, drive, parameters=20)) > 2 * len(whole)
    assert compute_interval_factor(1) == pytest.approx(12.706, rel=1e-4)
    assert compute_interval_factor(999) == pytest.approx(1.962, rel=1e-3)
