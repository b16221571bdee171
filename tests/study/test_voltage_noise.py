"""Noise of the voltage: `smooth_voltage` takes it out where that is smooth, and what is left is
part of the noise of the power, `QuietNoise`.
"""

from dataclasses import replace

import numpy as np
import pytest
from made_context import bench
from made_dips import base, events

from hidden_effects import Noise
from tractexp.inference.chance import BLURRED
from tractexp.inference.noise_in_quiet import QuietNoise
from tractexp.noise.voltage import smooth_voltage
from tractexp.record import Record, detect


def test_noise_of_the_voltage_is_taken_out_where_it_is_smooth():
    clean, noisy = (events(noise=Noise(0.002, voltage=v), count=1)[0] for v in (0.0, 0.002))
    untouched = smooth_voltage(clean)
    assert untouched.event is clean
    assert not len(untouched.errors)
    made = smooth_voltage(noisy)
    off = made.event.record.U - clean.record.U
    quiet = slice(0, clean.start - 20)
    assert off[quiet].std() < 0.3 * (noisy.record.U - clean.record.U)[quiet].std()
    # at the edge as it was recorded
    assert made.event.record.U[clean.start] == noisy.record.U[clean.start]


def test_smoothing_stops_beside_an_edge(monkeypatch):
    """A sample that is taken for an edge by chance does not take those beside it along, and they
    theirs.
    """
    rng, time = np.random.default_rng(12), np.arange(1000) * 0.002
    U = np.where(abs(time - 0.6) < 0.1, 0.6, 1.0)

    def as_recorded():
        """How many samples are left as recorded in all but one event of twenty."""
        made = [
            smooth_voltage(_event(time, U + rng.normal(0, 0.005, 1000))).errors for _ in range(60)
        ]
        return np.quantile([(np.count_nonzero(errors, axis=1) == 1).sum() for errors in made], 0.95)

    assert as_recorded() < 200
    monkeypatch.setattr("tractexp.noise.voltage.BESIDE", 2.0)
    assert as_recorded() > 300


def _event(t, U):
    return detect(Record("event", t, U, U, U, source="made").check())


def test_what_smoothing_leaves_of_the_voltages_noise_is_as_large_as_said():
    """In the directions of its errors what is left has unit variance; outside of them there is
    hardly anything.
    """
    clean = events(noise=Noise(0.002), count=1)[0]
    rng = np.random.default_rng(3)
    sizes, outside = [], []
    for _ in range(30):
        U = clean.record.U + 0.002 * rng.standard_normal(clean.record.samples)
        made = smooth_voltage(replace(clean, record=replace(clean.record, U=U)))
        off = made.event.record.U - clean.record.U
        _, values, basis = np.linalg.svd(made.errors, full_matrices=False)
        along = basis @ off
        sizes.append(np.mean((along / values) ** 2))
        outside.append(np.sum((off - along @ basis) ** 2) / 0.002**2)
    assert np.mean(sizes) == pytest.approx(1.0, abs=0.25)
    assert np.median(outside) < 1  # standard deviations, squared, over a thousand samples


def test_the_voltages_noise_is_part_of_the_noise_of_the_power():
    """Draws that hold what errors of the voltage do are white once whitened, and nothing is refused
    or named.
    """
    model, made = base(), events(noise=Noise(0.002, voltage=0.005))
    made = bench(model, made)
    noise = QuietNoise.from_context(made, made.coordinates.null).of_fit(made.coordinates.null)
    drive = made.drive
    drawn = noise.draw(np.random.default_rng(4), 200, np.diff(drive.first).tolist())
    rows = made.whiten(noise, drawn)
    # also where errors of the voltage are most of it
    ratio = drawn.std(axis=0) / noise.deviation(drive)
    assert ratio.mean(axis=1) == pytest.approx([1.0, 1.0], abs=0.02)
    assert noise.loudest_input_mode > BLURRED
    # the edges of the dips
    loud = drawn.var(axis=0) > 4 * np.median(drawn.var(axis=0), axis=1, keepdims=True)
    assert loud.sum() > 20
    assert ratio[loud].mean() == pytest.approx(1.0, abs=0.02)
    assert rows.var() == pytest.approx(1.0, abs=0.02)
    assert rows.reshape(drawn.shape)[:, loud].var() == pytest.approx(1.0, abs=0.1)
