"""The benchmark that others can enter: what a method sees, what is counted, and what fails."""

import argparse
import sqlite3

import numpy as np
import pytest
from suite import page, run
from suite.cases import RECIPES, Event, SuiteCase, make_case, make_cases, read_record

SAMPLES, START = 400, 100
RIGHT = """
def fit(events):
    assert all(event.P.shape == event.t.shape for event in events)
    return 0.9

def predict(model, event):
    import numpy as np
    assert np.isnan(event.P[event.start:]).all() and np.isfinite(event.P[:event.start]).all()
    change = event.U - 1
    return 1 + model * change, 0.5 + 0 * change, {band}

def name(model):
    return {named}
"""


def write(folder, name, text):
    path = folder / f"{name}.py"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def case():
    """A load whose P follows U by 1 and whose Q stays."""
    t = 0.005 * np.arange(SAMPLES)
    dip = (np.arange(SAMPLES) >= START) & (np.arange(SAMPLES) < 200)
    U = 1 - 0.4 * dip
    event = Event("dip", t, U, U.copy(), np.full(SAMPLES, 0.5), START, 50.0)
    return SuiteCase(1, [event], [event], ("a",))


def rows_of(named, truth=("a",)):
    return [{"method": "m", "truth": truth, "named": named, "inexact": False, "dips": []}]


@pytest.mark.parametrize(
    ("band", "named", "held"),
    [
        ((0.05, 0.01), [["a"]], [True, True]),
        ((0.03, 0.01), [], [False, True]),
        (None, [["c", "b"], ["a"]], None),
    ],
)
def test_the_error_is_that_of_the_response_and_a_band_holds_its_worst_sample(
    tmp_path, case, band, named, held
):
    row = run.run_method(write(tmp_path, "mine", RIGHT.format(band=band, named=named)), case)
    (dip,) = row["dips"]
    assert dip["error"] == pytest.approx(0.1)
    assert dip["held"] == held
    assert row["named"] == sorted(sorted(one) for one in named)


@pytest.mark.parametrize(
    ("named", "truth", "counted"),
    [
        ([["a"]], ["a"], "named_right"),
        ([["a"], ["b"]], ["a"], "right_among_several"),
        ([["b"]], ["a"], "named_wrong"),
        ([["a", "b"]], ["a"], "named_wrong"),
        ([["a"]], [], "named_wrong"),
        ([], ["a"], "silent"),
        ([], [], None),
        ([["a"]], None, None),
    ],
)
def test_a_name_is_right_alone_or_among_several_or_wrong(named, truth, counted):
    told = page.measure(rows_of(named, truth))
    counts = ("named_right", "right_among_several", "named_wrong", "silent")
    assert {key: told[key] for key in counts} == {key: int(key == counted) for key in counts}


def test_what_bands_held_is_told_by_what_is_hidden():
    def row(truth, held):
        return {"method": "m", "truth": truth, "inexact": False, "dips": [{"held": held}]}

    rows = [row([], [True, True]), row(["a"], [True, False]), row(["b"], [False, False])]
    assert page.compare_bands(rows) == [["m", "100% of 2", "", "25% of 4", ""]]
    assert page.compare_bands([row([], None)]) == []


def test_what_a_method_raises_is_a_row_and_no_end(tmp_path, case):
    wrong = write(
        tmp_path, "wrong", "def fit(events):\n    return 1 / 0\n\ndef predict(m, e): ...\n"
    )
    row = run.run_method(wrong, case)
    assert row["failed"] == "ZeroDivisionError: division by zero (line 2 of fit)"
    late = write(tmp_path, "late", "def fit(events): ...\n\ndef predict(m, e):\n    return m[0]\n")
    (dip,) = run.run_method(late, case)["dips"]
    assert dip["error"] is None
    assert "TypeError" in dip["failed"]


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("def predict(m, e): ...", "predict() returned NoneType, but must return P, Q[, band]"),
        ("def predict(m, e): return e.U[:5], e.U[:5]", "predict() returned 5 samples, but"),
        ("def predict(m, e): return e.U, e.U\ndef name(m): return 'ab'", "name() returned 'ab'"),
        (
            "def predict(m, e): return e.U, e.U\ndef name(m): return ['ab']",
            "name() returned ['ab']",
        ),
    ],
)
def test_what_is_returned_in_another_form_is_a_sentence(body, sentence, tmp_path, case):
    path = write(tmp_path, "formless", f"def fit(events): ...\n\n{body}\n")
    (why,) = run.list_failures(run.run_method(path, case))
    assert sentence in why


def test_a_file_that_is_no_method_is_told_before_anything_runs(tmp_path):
    with pytest.raises(SystemExit, match="a method needs a function predict"):
        run.read_method(write(tmp_path, "half", "def fit(events): ...\n"))
    with pytest.raises(SystemExit, match="there is no such Python file"):
        run.read_method(tmp_path / "none.py")


def test_numbers_are_those_of_cases():
    assert run.read_numbers("1-3,51") == [1, 2, 3, 51]
    with pytest.raises(argparse.ArgumentTypeError, match="there is no case 61"):
        run.read_numbers("61")
    with pytest.raises(argparse.ArgumentTypeError, match=r"'1\.\.3' is no case"):
        run.read_numbers("1..3")


def test_a_public_case_is_the_same_each_time_and_others_follow_their_seed():
    number = 1 + RECIPES.index("stator_resistance")
    one, again = make_case(number, 0), make_case(number, 0)
    assert one.truth == ("stator_resistance",)
    assert (len(one.fitted), len(one.unused)) == (3, 2)
    assert np.array_equal(one.unused[0].P, again.unused[0].P)
    assert not np.array_equal(one.unused[0].P, make_case(number, 1).unused[0].P)


@pytest.mark.parametrize(
    ("number", "truth"), [(51, "stator_transients"), (52, "undervoltage_trip")]
)
def test_a_shipped_record_judges_by_the_dip_that_is_not_fitted(number, truth):
    case = read_record(number)
    assert (len(case.fitted), len(case.unused)) == (2, 1)
    assert "65pct" in case.unused[0].name
    assert case.truth == (truth,)


def test_cases_of_files_that_are_there_have_dips_to_fit_and_others():
    there = [case for case in make_cases(range(53, 61), 0)]
    if not there:
        pytest.skip("needs ../shared")
    assert all(case.fitted and case.unused and case.truth is None for case in there)
    assert {event.frequency for case in there for event in case.fitted} <= {50.0, 60.0}


def test_the_command_writes_rows_and_a_page(tmp_path, capsys):
    method = write(tmp_path, "mine", RIGHT.format(band=(9.0, 9.0), named=[["stator_transients"]]))
    store = f"sqlite:///{tmp_path / 'mlflow.db'}"
    words = ["--methods", str(method), "--cases", "51", "--cores", "1", "--out", str(tmp_path)]
    run.main([*words, "--track", store])
    (row,) = run.read_rows(tmp_path / "suite.jsonl")
    assert row["dips"][0]["held"] == [True, True]
    printed = capsys.readouterr().out
    assert "mine | 1 | " in printed
    assert "100% of 2 | 1 | 0 | 0 | 0 | " in printed
    assert "mine" in (tmp_path / "suite.html").read_text(encoding="utf-8")
    with sqlite3.connect(tmp_path / "mlflow.db") as kept:
        logged = dict(kept.execute("select key, value from latest_metrics"))
    assert (logged["band_held"], logged["named_right"]) == (1.0, 1.0)


def test_a_run_goes_on_where_it_stopped_and_a_changed_method_is_run_again(tmp_path):
    method = write(tmp_path, "mine", RIGHT.format(band=None, named=[]))
    words = ["--methods", str(method), "--cores", "1", "--out", str(tmp_path)]
    run.main([*words, "--cases", "51", "--minutes", "0"])
    assert run.read_rows(tmp_path / "suite.jsonl") == []
    run.main([*words, "--cases", "51"])
    run.main([*words, "--cases", "51,52"])
    assert [row["case"] for row in run.read_rows(tmp_path / "suite.jsonl")] == [51, 52]
    write(tmp_path, "mine", RIGHT.format(band=(9.0, 9.0), named=[]))
    run.main([*words, "--cases", "52"])
    kept = run.read_rows(tmp_path / "suite.jsonl")
    assert [(row["case"], row["dips"][0]["held"]) for row in kept] == [
        (51, None),
        (52, None),
        (52, [True, True]),
    ]


def test_the_stored_rows_are_whole_and_their_tables_are_shown():
    """Of every method the public cases and the records."""
    rows = run.read_rows(page.STORED)
    methods = {path.stem for path in run.METHODS.glob("*.py")}
    assert {row["method"] for row in rows} == methods
    cases = {name: sorted(r["case"] for r in rows if r["method"] == name) for name in methods}
    least = {*run.MADE, *run.RECORDS} - {*run.DRAWN}
    assert all(least <= {*own} and own == cases["paper_pso"] for own in cases.values())
    shown = (page.HERE / "README.md").read_text(encoding="utf-8")
    assert page.marked.parted(shown, page.MARK)[1].strip() == page.make_tables(rows)


@pytest.mark.parametrize(
    ("share", "told"),
    [(0.0312, "3.1 %"), (7262.0, "over 100%"), (np.inf, "over 100%"), (np.nan, "")],
)
def test_an_error_above_the_response_is_told_as_that(share, told):
    assert page.in_percent(share) == told
