"""Ranks of truths in what is reported: `benchmarks/calibration.py`, its arithmetic and its stored rows."""

import json

import calibration
import numpy as np
import pytest

ROWS = [json.loads(line) for line in calibration.STORED.read_text(encoding="utf-8").splitlines()]


def test_a_rank_is_the_share_of_the_reported_distribution_below_the_truth():
    assert calibration.rank(1.0, 1.0, [0.0, 3.0]) == 0.5
    assert calibration.rank(3.0, 1.0, [0.0, 3.0]) == pytest.approx(0.975)
    assert calibration.rank(0.0, 1.0, [0.0, 3.0]) == pytest.approx(0.025)
    assert calibration.rank(2.0, 1.0, [0.0, 3.0]) == pytest.approx(0.8365, abs=1e-4)  # half of the way up
    assert calibration.rank(2.0, 1.0, [0.0, 1.0]) == 1.0  # no side at all
    assert calibration.rank(1.0, 1.0, [1.0, 1.0]) == 0.5


def test_intervals_of_the_right_width_pass_and_others_are_seen():
    errors = np.random.default_rng(5).standard_normal(500)
    p = {}
    for width in (0.7, 1.0, 1.5):
        half = calibration.HALF * width
        p[width] = calibration.uniform(calibration.rank(0.0, e, [e - half, e + half]) for e in errors)
    assert p[0.7] < 1e-6
    assert p[1.0] > 0.01
    assert p[1.5] < 1e-6
    assert calibration.uniform(calibration.rank(0.0, e + 0.5, [e - 1.5, e + 2.5]) for e in errors) < 1e-6  # a bias


def test_a_set_of_the_generator_has_the_ranks_that_are_stored():
    stored = next(row for row in ROWS if row["domain"] == "phasors" and row["number"] == 1)
    row = calibration.phasors(1)
    assert row["noise"] == stored["noise"]
    assert row["ranks"] == pytest.approx(stored["ranks"], abs=0.01)


@pytest.mark.parametrize(("domain", "least"), [("phasors", 60), ("waves", 3)])
def test_stored_sets_are_each_counted_once(domain, least):
    numbers = [row["number"] for row in ROWS if row["domain"] == domain]
    assert len(numbers) == len({*numbers}) >= least
    assert [row for row in ROWS if "failed" in row] == []
    for found in calibration.summary([row for row in ROWS if row["domain"] == domain]).values():
        assert sum(found["tenths"]) == len(numbers)
