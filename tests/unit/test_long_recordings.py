"""Recordings of hundreds of megabytes stay on the disk, and what is measured of them is read a
block at a time.
"""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from field_waves import KA, KV, load, noise, phases, recording, wave

from tractexp.configuration.plugin import build
from tractexp.filetypes import comtrade, comtrade_samples
from tractexp.recording import Feeder
from tractexp.recording.excursion import SLIDING, _count_samples_inside
from tractexp.recording.measure import FeederWaves, measure_phasors
from tractexp.recording.overview import describe_loads
from tractexp.recording.quality import _compute_variances, assess_quality

RATE, SECONDS = 10_000.0, 60
FEEDER = Feeder((0, 1, 2), (3, 4, 5), "three_phase")


@pytest.fixture(scope="module")
def long():
    """A minute of six channels with two dips, 29 MB of float64 values."""
    t = np.arange(round(SECONDS * RATE)) / RATE
    U = KV * np.where(((t > 20) & (t < 20.3)) | ((t > 40) & (t < 40.3)), 0.6, 1.0)
    waves = np.concatenate([wave(t, phases(U)), wave(t, load(U))])
    return recording(waves + noise(waves.shape, 1e-3) * np.repeat([KV, KA], 3)[:, None], RATE)


def mapped(array):
    """Whether an array is a view of a file."""
    while array is not None and not isinstance(array, np.memmap):
        array = getattr(array, "base", None)  # a small file is a view of its bytes
    return array is not None


def peak(call):
    """Bytes that a call allocates at most."""
    tracemalloc.start()
    try:
        call()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("name", ["a.cfg", "a.cff"])
@pytest.mark.parametrize("kind", ["BINARY", "BINARY32", "FLOAT32"])
def test_a_large_file_is_mapped(long, tmp_path, monkeypatch, kind, name):
    whole = np.array([np.round(c.raw * 50) for c in long.channels]).astype(
        "<f4" if kind == "FLOAT32" else "<i4"
    )
    made = replace(
        long,
        channels=[replace(c, raw=x, gain=0.02) for c, x in zip(long.channels, whole, strict=True)],
    )
    made = replace(
        made,
        channels=[replace(c, raw=c.raw.astype("<i2")) for c in made.channels]
        if kind == "BINARY"
        else made.channels,
    )
    paths = comtrade.write(made, tmp_path / name, kind)
    size = sum(path.stat().st_size for path in paths)
    monkeypatch.setattr(comtrade_samples, "LARGE", size // 2)
    # time stamps and numbers of samples are looked at
    assert peak(lambda: comtrade.load(tmp_path / name)) < size
    read = comtrade.load(tmp_path / name)
    assert all(mapped(c.raw) for c in read.channels)
    np.testing.assert_array_equal(read.channels[4].raw, made.channels[4].raw)
    monkeypatch.setattr(comtrade_samples, "LARGE", size)
    assert not any(mapped(c.raw) for c in comtrade.load(tmp_path / name).channels)


def test_loads_are_measured_a_block_at_a_time(long):
    reader = build("data", {"name": "comtrade", "path": "made.cfg"})
    whole = sum(c.raw.nbytes for c in long.channels)
    [shown] = describe_loads(reader, long)  # what is imported at first counts not
    # all the waveforms at once took four times as much
    assert peak(lambda: describe_loads(reader, long)) < 1.1 * whole
    assert [(e.what.kind, round(e.what.start), e.worth) for e in shown.events] == [
        ("dip", 20, True),
        ("dip", 40, True),
    ]


def test_quality_takes_little_more_than_the_channel(long):
    [segment] = long.segments
    assert peak(lambda: assess_quality(long, 0, segment)) < 4 * long.channels[0].raw.nbytes


def test_loads_of_one_bus_share_what_was_tracked(long):
    [segment], tracked = long.segments, {}
    first = measure_phasors(long, FEEDER, segment, tracked=tracked)
    assert sorted(tracked)[0] == 0
    again = measure_phasors(long, FEEDER, segment, tracked=tracked)
    for name in ("V", "I", "f"):
        np.testing.assert_array_equal(getattr(again, name), getattr(first, name))


def test_waves_are_the_sums_that_the_connection_says(long):
    part = replace(long.segments[0], stop=1000)
    lines = FeederWaves.from_recording(
        long, replace(FEEDER, connection="line_voltages", reverse_current=True), part
    )
    assert lines.shape == (6, 1000)
    channels = np.array([c.raw[:1000] for c in long.channels])
    np.testing.assert_allclose(lines[:, :], lines.sums @ channels, atol=1e-12)
    np.testing.assert_array_equal(lines[4:5, 20:30], -channels[4:5, 20:30])


def test_the_reference_slides_as_the_standard_says():
    """IEC 61000-4-30, 5.4.4: a filter of the first order, of a minute, sample by sample."""
    rng, step = np.random.default_rng(3), 0.01
    levels = 1 + 0.01 * rng.standard_normal((2, 3000)).cumsum(axis=1) / 20
    reference, limits = np.array([1.0, 1.0]), np.array([0.03, 0.05])
    count, reached = _count_samples_inside(levels, limits, reference, step)
    share, k = 1 - np.exp(-step / SLIDING), 0
    while k < 3000 and (np.abs(levels[:, k] / reference - 1) <= limits).all():
        reference = reference + share * (levels[:, k] - reference)
        k += 1
    assert 10 < count == k
    np.testing.assert_allclose(reached, reference, rtol=1e-12)


@pytest.mark.parametrize("count", [0, 1, 2, 1023, 1024, 1025, 2500])
def test_variances_of_cycles(count):
    cycles = np.random.default_rng(1).standard_normal((count, 7))
    own, changed = _compute_variances(cycles)
    np.testing.assert_array_equal(own, cycles.var(axis=1))
    np.testing.assert_array_equal(changed, np.diff(cycles, axis=0).var(axis=1))
