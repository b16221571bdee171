"""A short run of `benchmarks/scale.py`, and that what is stored of the long one grows no faster
than its sizes.
"""

import json
import os

import marked
import pytest

if os.name == "nt":
    pytest.skip("memory is read from /proc", allow_module_level=True)

import scale

STORED = json.loads(scale.STORED.read_text(encoding="utf-8"))
FASTEST = 1.15  # slope that is still called linear


@pytest.mark.parametrize(
    ("case", "size"),
    [
        ("look", 6000),
        pytest.param("survey", 3, marks=pytest.mark.long),
        pytest.param("sweep", 2, marks=pytest.mark.long),
    ],
)
def test_a_case_runs_and_says_what_it_took(case, size):
    spent = scale.CASES[case].measure(size)
    assert spent.cpu > 0
    assert spent.wall > 0
    assert 30 < spent.peak < 1000


def test_a_command_that_fails_is_no_row(tmp_path):
    with pytest.raises(RuntimeError, match=r"exit 2: .*nothing\.csv"):
        scale.use(tmp_path, ["look", "nothing.csv"])


def test_slopes():
    rows = [{"size": 10, "cpu": 1.5}, {"size": 100, "cpu": 10.5}, {"size": 1000, "cpu": 1000.5}]
    assert scale.slopes(rows, 0.5) == pytest.approx([1, 2])
    assert scale.slopes(rows, 2.0) == [None, pytest.approx(2.06993, abs=1e-5)]


@pytest.mark.parametrize("case", [name for name in scale.CASES if name in STORED])
def test_stored_time_grows_no_faster_than_the_size(case):
    rows = STORED[case]
    assert {row["size"] for row in rows} <= {*scale.CASES[case].sizes}
    assert [
        slope
        for slope in scale.slopes(rows, STORED["idle"])
        if slope is not None and slope > FASTEST
    ] == []


def test_the_page_has_what_is_stored():
    _, text, _ = marked.parted(scale.PAGE.read_text(encoding="utf-8"), "benchmarks/scale.py")
    assert text.strip() == scale.text(STORED)
