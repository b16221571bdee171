"""Injected faults, a short run of `benchmarks/faults.py`, and that the stored long one lost
nothing.
"""

import json
import os
import random
from itertools import islice

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
    """Faults of a search at its result and the first of its logging; others are stored."""
    faults.ready()
    work, chance = tmp_path_factory.mktemp("faults"), random.Random(7)
    of_search = faults.jobs(faults.made(work / "jobs"), chance, (faults.RESULT,))
    of_logging = faults.logging(faults.made(work / "logging"), chance)
    return {"jobs": [*islice(of_search, 2)], "logging": [next(of_logging)]}


@pytest.mark.long  # of kills alone test_kills and unit/test_run_folder tell in less
def test_a_search_loses_no_result_that_it_had_and_a_log_no_run(some):
    assert {part: [f for f in found if f["lost"]] for part, found in some.items()} == {
        "jobs": [],
        "logging": [],
    }
    assert ["kill -9" in fault["fault"] for fault in some["jobs"]] == [True, False]


def test_a_loss_would_be_seen(tmp_path):
    assert faults.told("a fault", "as it should be", "", "") == {
        "fault": "a fault",
        "observed": "as it should be",
        "lost": False,
    }
    assert faults.told("a fault", "x", "", "ANOTHER RESULT")["lost"]
    (tmp_path / "a.json").write_text('{"a"')
    assert faults.halves(tmp_path) == "NOT WHOLE: a.json"
    assert faults.trace("Traceback (most recent call last)")
    code, said = faults.forked(lambda: (print("words"), faults.killed()))
    assert (code, said) == (-9, "words\n")
