"""Loads of other simulators as judges: what their machines draw, and what a verdict is worth."""

import itertools

import behind_flux
import marked
import numpy as np
import pytest
import strangers
import strangers_dpsim as dpsim
import strangers_hermess as hermess
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
    assert [*itertools.islice(strangers.make_strangers(), 6)] == [
        (0, "motulator"),
        (1, "ANDES"),
        (0, "DPsim"),
        (1, "HERMESS"),
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


@pytest.mark.parametrize(
    ("module", "package", "kind"),
    [(dpsim, "dpsimpy", "saturable core"), (hermess, "hermess", "compensator")],
)
def test_a_load_beside_a_machine_rests_before_the_dip_and_returns(module, package, kind):
    pytest.importorskip("motulator")
    pytest.importorskip(package)
    record = module.record_dip(
        module.draw_load(kind, np.random.default_rng(3)), motulator.Dip(0.3, 0.113, 0.0)
    )
    before = record["t"] < -0.02
    for name in ("U", "P", "Q"):
        assert np.ptp(record[name][before]) < 1e-4, name
    assert record["U"].min() == pytest.approx(0.7, abs=0.02)
    assert record["P"][-1] == pytest.approx(record["P"][0], rel=0.01)
    after = record["Q"][record["t"] > 0.14]
    assert np.ptp(after) > 0.2  # inrush, or what the compensator gives too much


def test_tables_tell_shares_with_intervals():
    rows = [
        {"simulator": "DPsim", "kind": "core", "outcome": outcome, "verdict": "candidate"}
        for outcome in ("right", "right", "doubted", "wrong")
    ] + [{"simulator": "DPsim", "refused": "UserError: no"}]
    told = strangers.make_tables(rows)
    assert "right, class or silent: 50.0% (7%-93%)" in told
    assert "wrong: 25.0% (1%-81%)" in told
    assert "wrong, and named instead of a candidate or tied: 0.0% (0%-60%)" in told


def test_the_page_holds_what_the_stored_rows_hold():
    rows = strangers.read_rows()
    _, made, _ = marked.parted(strangers.PAGE.read_text(encoding="utf-8"), strangers.MARK)
    assert made.strip() == strangers.make_tables(rows)
    of_each = [(row["number"], row["simulator"]) for row in rows]
    assert len({*of_each}) == len(of_each)


@pytest.mark.parametrize(
    ("sets", "nearest", "told"),
    [
        ([["stator_transients"]], ["stator_transients"], ["strongest alone"]),
        ([["stator_transients"]], ["a", "stator_transients"], ["strongest alone"]),
        (
            [["stator_transients", "speed_dependent_torque"]],
            ["stator_transients", "speed_dependent_torque"],
            ["in the nearest set", "hidden one told"],
        ),
        ([["stator_transients"], ["a"]], ["a"], ["strongest alone", "false"]),
        ([], ["speed_dependent_torque"], ["in the nearest set"]),
    ],
)
def test_what_is_told_of_an_effect_behind_stator_flux(sets, nearest, told):
    truth = ["speed_dependent_torque", "stator_transients", "stator_resistance"]
    row = {"sets": sets, "truth": truth, "nearest": [[nearest, 0.01], [[], 0.1]]}
    assert [what for what, is_so in behind_flux.find_told(row).items() if is_so] == told


def test_the_page_holds_what_the_rows_behind_stator_flux_hold():
    page = strangers.PAGE.read_text(encoding="utf-8")
    _, made, _ = marked.parted(page, behind_flux.MARK)
    assert made.strip() == behind_flux.make_table(strangers.read_rows(behind_flux.STORED))
