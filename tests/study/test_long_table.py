"""A table of a million rows: the time and the memory of reading it."""

import time
import tracemalloc

import numpy as np
import pytest

import tractexp
from tractexp.api.setup import Setup
from tractexp.cache.provenance import hash_record
from tractexp.configuration.plugin import build
from tractexp.record import Event, Record, detect
from tractexp.record.dips import view_dip


def test_a_million_rows_take_about_a_second_and_memory_like_the_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    n = 1_000_000
    t = np.arange(n) * 1e-3
    U = np.where((t > 500) & (t < 500.2), 0.6, 1.0)
    np.savetxt(
        "big.csv",
        np.column_stack([t, U, 0.8 * U, 0.6 * U]),
        "%.6g",
        ",",
        header="t,U,P,Q",
        comments="",
    )
    reader = build("data", {"name": "csv", "train": ["big.csv"]})
    begin = time.process_time()
    assert reader.read().train[0].samples == n
    assert time.process_time() - begin < 2.5  # 0.8 s on an idle core
    tracemalloc.start()
    reader.read()
    assert tracemalloc.get_traced_memory()[1] < 400e6
    tracemalloc.stop()


def hour(rows: int) -> Record:
    """A table at 50 Hz with a dip every 100 s from 150 s on."""
    t = np.arange(rows) / 50
    U = np.where((t > 100) & (t % 100 > 50) & (t % 100 < 50.2), 0.6, 1.0)
    return Record("hour", t, U, 0.8 * U, 0.6 * U)


@pytest.mark.parametrize("rows", [45_000, 90_000, 180_000])
def test_an_event_of_a_long_table_is_the_part_about_its_dip(rows):
    whole = detect(hour(rows))
    part = view_dip(whole)
    # whatever the table holds: a minute before, the dip, a minute after
    assert part.record.samples == 6_009
    assert (part.t_start, part.depth, part.P0, part.noise_P) == (
        whole.t_start,
        whole.depth,
        pytest.approx(whole.P0),
        pytest.approx(whole.noise_P, abs=1e-12),
    )
    assert hash_record(part.record) == hash_record(whole.record)
    assert part.record.notes == (
        f"of {rows / 50:.0f} s those from 90 to 210 s are used, about the first dip",
    )


def test_shorter_records_are_as_they_are():
    for event in tractexp.read("tibet_50pct"):
        assert view_dip(event) is event


def test_the_step_of_a_long_record_is_that_of_its_dip():
    """A motor that stalled runs away ever faster: an hour of that would ask for the finest step
    there is.
    """
    short, long = (
        Setup.from_arguments([swung(length)], None).lines()[-1] for length in (20.0, 120.0)
    )
    assert "Runge-Kutta steps: 32" in short
    assert long == short


def swung(length: float) -> Event:
    """A dip in the middle of a record at 50 Hz."""
    t = np.arange(round(length * 50)) / 50
    shape = np.clip(np.minimum(t - length / 2, length / 2 + 0.4 - t) / 0.1, 0, 1)
    U = 1 - 0.4 * (0.5 - 0.5 * np.cos(np.pi * shape))
    return detect(Record("swung", t, U, 0.8 * U, 0.6 * U))
