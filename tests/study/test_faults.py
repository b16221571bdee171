"""Injected faults, a short run of `benchmarks/faults.py`, and that the stored long one lost nothing."""

import json
import os
import random

import pytest

if os.name == "nt":
    pytest.skip("faults are injected into forked processes", allow_module_level=True)

import faults


def test_the_stored_run_lost_nothing():
    stored = json.loads(faults.STORED.read_text())
    assert set(stored) == set(faults.PARTS)
    every = [fault for part in stored.values() for fault in part]
    assert len(every) >= 100
    assert [fault for fault in every if fault["lost"]] == []


@pytest.fixture(scope="module")
def some(tmp_path_factory):
    """The first faults of a search and of its logging, at other moments than those that are stored."""
    faults.ready()
    made = {}
    for part, count in (("jobs", 10), ("logging", 3)):
        injected = faults.PARTS[part](tmp_path_factory.mktemp(part), random.Random(7))
        made[part] = [fault for fault, _ in zip(injected, range(count), strict=False)]
    return made


def test_a_search_loses_no_result_that_it_had_and_a_log_no_run(some):
    assert {part: [f for f in found if f["lost"]] for part, found in some.items()} == {"jobs": [], "logging": []}
    assert [len(found) for found in some.values()] == [10, 3]


def test_a_loss_would_be_seen(tmp_path):
    assert faults.told("a fault", "as it should be", "", "") == {
        "fault": "a fault", "observed": "as it should be", "lost": False,
    }  # fmt: skip
    assert faults.told("a fault", "x", "", "ANOTHER RESULT")["lost"]
    (tmp_path / "a.json").write_text('{"a"')
    assert faults.halves(tmp_path) == "NOT WHOLE: a.json"
    assert faults.trace("Traceback (most recent call last)")
    code, said = faults.forked(lambda: (print("words"), faults.killed()))
    assert (code, said) == (-9, "words\n")
