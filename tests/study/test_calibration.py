"""Ranks of truths in what is reported: `benchmarks/calibration.py`, its arithmetic and its stored
rows.
"""

import json
from pathlib import Path

import calibration
import numpy as np
import pytest
import wave_records

ROWS = [json.loads(line) for line in calibration.STORED.read_text(encoding="utf-8").splitlines()]


def test_a_rank_is_the_share_of_the_reported_distribution_below_the_truth():
    assert calibration.rank(1.0, 1.0, [0.0, 3.0]) == 0.5
    assert calibration.rank(3.0, 1.0, [0.0, 3.0]) == pytest.approx(0.975)
    assert calibration.rank(0.0, 1.0, [0.0, 3.0]) == pytest.approx(0.025)
    # half of the way up
    assert calibration.rank(2.0, 1.0, [0.0, 3.0]) == pytest.approx(0.8365, abs=1e-4)
    assert calibration.rank(2.0, 1.0, [0.0, 1.0]) == 1.0  # no side at all
    assert calibration.rank(1.0, 1.0, [1.0, 1.0]) == 0.5


def test_intervals_of_the_right_width_pass_and_others_are_seen():
    errors = np.random.default_rng(5).standard_normal(500)
    p = {}
    for width in (0.7, 1.0, 1.5):
        half = calibration.HALF * width
        p[width] = calibration.uniform(
            calibration.rank(0.0, e, [e - half, e + half]) for e in errors
        )
    assert p[0.7] < 1e-6
    assert p[1.0] > 0.01
    assert p[1.5] < 1e-6
    # a bias
    assert (
        calibration.uniform(calibration.rank(0.0, e + 0.5, [e - 1.5, e + 2.5]) for e in errors)
        < 1e-6
    )


def test_a_set_of_the_generator_has_the_ranks_that_are_stored():
    stored = next(row for row in ROWS if row["domain"] == "phasors" and row["number"] == 1)
    row = calibration.phasors(1)
    assert row["noise"] == stored["noise"]
    assert row["ranks"] == pytest.approx(stored["ranks"], abs=0.01)


def test_the_docs_say_what_is_stored():
    docs = (Path(__file__).parents[2] / "docs" / "coverage.md").read_text(encoding="utf-8")
    assert calibration.in_words(ROWS) in " ".join(docs.split())


def test_the_truth_of_a_load_is_told_on_the_base_that_it_was_fitted_on():
    """Twice the base has twice the impedances per unit, and half of the torque and inertia."""
    site = wave_records.site(np.random.default_rng(1))
    one, two = site.truth(), site.truth(2 * wave_records.BASE_POWER)
    assert {name: two[name] / one[name] for name in one} == pytest.approx(
        dict.fromkeys(one, 1.0) | {"X_prime": 2.0, "R_s": 2.0, "M": 0.5, "T_m": 0.5}
    )


@pytest.mark.parametrize(("domain", "least"), [("phasors", 440), ("waves", 60)])
def test_stored_sets_are_each_counted_once(domain, least):
    numbers = [row["number"] for row in ROWS if row["domain"] == domain]
    assert len(numbers) == len({*numbers}) >= least
    assert [row for row in ROWS if "failed" in row] == []
    for found in calibration.summary([row for row in ROWS if row["domain"] == domain]).values():
        assert sum(found["tenths"]) == len(numbers)
