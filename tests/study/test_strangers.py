"""Loads of other simulators as judges: what their machines draw, and what a verdict is worth."""

import numpy as np
import pytest
import strangers
import strangers_motulator as motulator


@pytest.mark.parametrize(
    ("verdict", "sets", "truth", "outside", "worth"),
    [
        ("none", [], (), False, "rightly silent"),
        ("unexplained", [], (), False, "doubted"),
        ("none", [], ("a",), False, "silent"),
        ("unexplained", [], (), True, "silent"),
        ("named", [["a"]], ("a", "b"), False, "right"),
        ("candidate", [["a", "b"]], ("a", "b"), False, "right"),
        ("candidate", [["c"]], ("a", "b"), False, "wrong"),
        ("named", [["a", "c"]], ("a",), False, "wrong"),
        ("named", [["a"]], (), True, "wrong"),
        ("tied", [["c"], ["a"]], ("a",), False, "class"),
        ("tied", [["c"], ["d"]], ("a",), False, "wrong"),
    ],
)
def test_what_a_verdict_is_worth(verdict, sets, truth, outside, worth):
    assert strangers.rate({"verdict": verdict, "sets": sets}, truth, outside) == worth


def test_a_load_of_each_simulator_is_drawn_from_its_own_numbers():
    first = list(zip(range(4), strangers.make_strangers(), strict=False))
    assert [one for _, one in first] == [
        (0, "motulator"),
        (1, "ANDES"),
        (2, "motulator"),
        (3, "ANDES"),
    ]


@pytest.mark.parametrize("kind", [*motulator.KINDS])
def test_a_machine_of_motulator_stands_still_before_the_dip_and_recovers(kind):
    pytest.importorskip("motulator")
    load = motulator.draw_load(kind, np.random.default_rng(4))
    dip = motulator.Dip(0.3, 0.1, 0.1)
    record = motulator.record_dip(load, dip)
    before = record["t"] < -0.02
    for name, column in record.items():
        if name != "t":
            assert np.ptp(column[before]) < 1e-6, name
    assert record["U"].min() == pytest.approx(1 - dip.depth, abs=1e-3)
    assert record["P"][-1] == pytest.approx(record["P"][0], rel=0.01)
    assert np.ptp(record["f"]) > 0.1  # of the jump
