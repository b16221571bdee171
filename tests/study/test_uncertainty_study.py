"""The stored rows of `benchmarks/uncertainty.py`: what stands on the page, and that intervals hold
the truth.
"""

import marked
import numpy as np
import pytest
import uncertainty
from model_error import rows_of, six_digits

STORED = rows_of(uncertainty.STORED)


def test_the_page_has_what_is_stored():
    _, text, _ = marked.parted(
        uncertainty.PAGE.read_text(encoding="utf-8"), "benchmarks/uncertainty.py"
    )
    assert text.strip() == uncertainty.text(STORED)


@pytest.mark.parametrize("part", uncertainty.RECORDS)
def test_rows_are_of_seeds_one_after_the_other(part):
    assert sorted(row["seed"] for row in STORED if row["part"] == part) == [
        *range(len(uncertainty.results(STORED, part)))
    ]


@pytest.mark.parametrize("label", uncertainty.CONDITIONS)
def test_intervals_hold_the_truth_as_often_as_they_say(label):
    """Of so few, 95 % less four standard deviations of the records, whose parameters
    go together.
    """
    inside = np.array([row[label]["inside"] for row in uncertainty.results(STORED, "coverage")])
    assert inside.mean() > 0.95 - 4 * np.sqrt(0.95 * 0.05 / len(inside))


def test_a_study_goes_on_where_it_stopped(tmp_path, monkeypatch):
    monkeypatch.setitem(
        uncertainty.RECORDS, "coverage", lambda seed: {"seed": seed, "third": seed / 3}
    )
    path = tmp_path / "rows.jsonl"
    first = [*uncertainty.study("coverage", 2, path)]
    second = [*uncertainty.study("coverage", 4, path)]
    assert [row["seed"] for row in [*first, *second]] == [0, 1, 2, 3]
    assert rows_of(path) == [*first, *second]
    assert first[1]["result"]["third"] == six_digits(1 / 3)
