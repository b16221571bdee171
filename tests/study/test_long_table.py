"""A table of a million rows: the time and the memory of reading it."""

import time
import tracemalloc

import numpy as np

from tractexp.plugin import build


def test_a_million_rows_take_about_a_second_and_memory_like_the_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    n = 1_000_000
    t = np.arange(n) * 1e-3
    U = np.where((t > 500) & (t < 500.2), 0.6, 1.0)
    np.savetxt("big.csv", np.column_stack([t, U, 0.8 * U, 0.6 * U]), "%.6g", ",", header="t,U,P,Q", comments="")
    reader = build("data", {"name": "csv", "train": ["big.csv"]})
    begin = time.process_time()
    assert reader.read().train[0].samples == n
    assert time.process_time() - begin < 2.5  # 0.8 s on an idle core
    tracemalloc.start()
    reader.read()
    assert tracemalloc.get_traced_memory()[1] < 400e6
    tracemalloc.stop()
