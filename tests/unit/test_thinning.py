"""Fewer samples of a record: nothing aliases, and the window is told."""

import numpy as np
import pytest

from tractexp.record import Record
from tractexp.record.thinning import thin_record
from tractexp.record.window import Window, average

RATE, EVERY = 1000.0, 3  # Hz


def make_record(P, **changed):
    t = np.arange(len(P)) / RATE
    U = changed.pop("U", np.ones(len(P)))
    return Record("dip", t, U, P, np.full(len(P), 0.4), **changed)


def amplitude(y, rate, low, high):
    """The largest line of a signal (N,) in a band [Hz]."""
    spectrum = 2 * np.abs(np.fft.rfft((y - y.mean()) * np.hanning(len(y)))) / len(y)
    f = np.fft.rfftfreq(len(y), 1 / rate)
    return spectrum[(f >= low) & (f <= high)].max()


def test_what_is_above_half_the_kept_rate_does_not_fold_into_the_band():
    """Of 1000 Hz one in three is kept: 350 Hz lie 16.7 Hz above the kept rate, where plain samples
    show all of it.
    """
    t = np.arange(3000) / RATE
    record = make_record(1.0 + 0.1 * np.sin(2 * np.pi * 350 * t))
    thin = thin_record(record, EVERY)
    plain = record.part(slice(None, None, EVERY))
    assert thin.rate == pytest.approx(RATE / EVERY)
    assert amplitude(plain.P, plain.rate, 10, 25) > 0.04
    assert amplitude(thin.P, thin.rate, 1, 160) < 3e-4


def test_what_is_slow_passes():
    t = np.arange(3000) / RATE
    slow = 1.0 + 0.1 * np.sin(2 * np.pi * 5 * t)
    thin = thin_record(make_record(slow, U2=0.01 * slow, f=49 + slow), EVERY)
    for name, scale in (("P", 1.0), ("U2", 0.01)):
        kept = getattr(thin, name)[10:-10] / scale
        np.testing.assert_allclose(kept, slow[::EVERY][10:-10], atol=1e-4)


@pytest.mark.parametrize("own", [None, Window("mean", np.arange(-10, 11) / RATE, np.ones(21) / 21)])
def test_its_window_is_the_one_it_had_and_the_one_it_was_thinned_by(own):
    """A constant current at a voltage that steps: the power is that of both windows."""
    step = np.where(np.arange(600) < 300, 1.0, 0.6)
    once = step if own is None else average(step, own.compute_weights(1 / RATE))
    thin = thin_record(make_record(0.8 * once, U=once, window=own), EVERY)
    assert thin.window.name == ("thinned" if own is None else "mean")
    assert thin.window.weights.sum() == pytest.approx(1)
    shown = average(step, thin.window.compute_weights(1 / RATE))[::EVERY]
    np.testing.assert_allclose(thin.U, shown, atol=1e-12)
    np.testing.assert_allclose(thin.P, 0.8 * shown, atol=1e-12)


def test_an_angle_that_turns_costs_no_power():
    """Voltage and current turn together: P and Q are those of each, however fast."""
    angle = np.cumsum(np.full(600, 0.2))
    record = make_record(np.full(600, 0.8), U_angle=angle, f=np.full(600, 50 + 100 / np.pi))
    thin = thin_record(record, EVERY)
    inner = slice(2, -2)
    np.testing.assert_allclose(np.diff(thin.U_angle[inner]), 0.6, atol=1e-9)
    np.testing.assert_allclose((thin.P / thin.U**2)[inner], 0.8, atol=1e-9)


def test_one_of_one_is_the_record():
    record = make_record(np.ones(50))
    assert thin_record(record, 1).P is record.P
