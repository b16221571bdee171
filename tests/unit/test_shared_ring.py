"""What benchmarks/shared_ring.py measures: the line that what is left of several loads shares."""

import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def ring(monkeypatch_module):
    place = BENCHMARKS / "shared_ring.py"
    spec = importlib.util.spec_from_file_location("shared_ring", place)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def monkeypatch_module():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(BENCHMARKS))
        yield patch


@pytest.mark.parametrize("growth", [-40.0, 0.0, 20.0])
def test_the_frequency_and_the_growth_of_a_shared_line_are_found(ring, growth):
    rng = np.random.default_rng(0)
    t = np.arange(128) / 3200
    line = np.exp((growth + 2j * np.pi * 149) * t)
    signals = [
        size * line + 0.02 * (rng.standard_normal(128) + 1j * rng.standard_normal(128))
        for size in (0.1, 0.2j)
    ]
    frequency, found = ring.find_growth(signals, t)
    assert frequency == pytest.approx(149, abs=2)
    assert found == pytest.approx(growth, abs=8)


def test_what_the_page_says_of_the_station_is_what_is_stored():
    stored = json.loads((BENCHMARKS / "shared_ring.json").read_text(encoding="utf-8"))
    page = (BENCHMARKS.parent / "docs" / "waves.md").read_text(encoding="utf-8")
    left = [row["left"] for row in stored["faults"]]
    assert {(row["load"], row["dip"]) for row in stored["faults"]} == {
        (load, dip) for load in ("T1", "T2") for dip in (1, 2)
    }
    assert f"leaves {min(left):.3f} to {max(left):.3f} pu at 150 Hz" in page
    assert all(row["growth"] > 0 for row in stored["rings"])
    errors = [row.pop("sum") for row in stored["station"]]
    largest = max(size for row in stored["station"] for key, size in row.items() if key != "dip")
    assert f"adds up to {min(errors):.0f} A of {10 * round(largest / 10)}" in " ".join(page.split())
