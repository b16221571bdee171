"""Damaged configurations and sidecars: it works, or one sentence (a short run of
`benchmarks/mutated_settings.py`).
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import mutated_settings
import pytest

import tractexp
from tractexp.errors import UserError, check_range


def test_a_damaged_setting_works_or_is_refused_with_a_sentence(monkeypatch):
    """Without the moment's search of the long run, for which other kernels would be compiled."""
    from tractexp.api.setup import Setup

    monkeypatch.setattr(Setup, "problem", None)
    monkeypatch.setattr("tractexp.identification.search.search", lambda *_: None)
    found = mutated_settings.run(160, 11)
    assert found["bad"] == []
    for counts in found["counts"].values():
        assert set(counts) == {"works", "refused"}


def test_the_stored_run_is_long_and_found_nothing():
    stored = json.loads(
        Path(mutated_settings.__file__).with_suffix(".json").read_text(encoding="utf-8")
    )
    assert stored["bad"] == []
    assert (
        sum(sum(counts.values()) for counts in stored["counts"].values())
        == stored["cases"]
        >= 10_000
    )
    assert {kind for counts in stored["counts"].values() for kind in counts} == {"works", "refused"}


def test_the_same_seed_makes_the_same_mutants(tmp_path, monkeypatch):
    monkeypatch.setattr(
        mutated_settings, "keys_of", lambda arguments: ["seed", "data.train", "model.bounds.C"]
    )
    beside = tmp_path / "dip.json"

    def mutants():
        for what, _, given in mutated_settings.made(60, 5, tmp_path):
            yield str(given[0]) if what == "configuration" else beside.read_bytes()

    first = list(mutants())
    assert first == list(mutants())
    assert len(set(map(str, first))) > 50


@pytest.mark.parametrize(
    ("kind", "call"),
    [
        ("traceback", lambda: [][0]),
        ("leak", lambda: refuse("seed: value 'x' of type 'str' could not be converted to Integer")),
        ("leak", lambda: refuse("'NoneType' object is not iterable")),
        ("several lines", lambda: refuse("one\ntwo")),
        ("hang", lambda: endless()),
        ("refused", lambda: refuse("seed=x is not a whole number")),
        ("works", lambda: None),
    ],
)
def test_what_is_not_allowed_is_found(kind, call, monkeypatch):
    monkeypatch.setattr(mutated_settings, "SECONDS", 0.2)
    assert mutated_settings.outcome(lambda _: call(), "given")[0] == kind


def refuse(words):
    raise UserError(words)


def endless():
    while True:
        pass


@pytest.mark.parametrize("value", [float("inf"), float("-inf"), float("nan")])
def test_a_range_without_an_end_holds_finite_numbers_only(value):
    for limits in ((), (0.0,), (float("-inf"), 1.0)):
        with pytest.raises(UserError, match="is out of range"):
            check_range("x", value, *limits)
    check_range("x", 1e300)


REFUSED = [
    (
        ["data=csv", "data.train=[dip.csv]", "data.base_power=inf"],
        "data.base_power=inf is out of range: it must be",
    ),
    (
        ["data=csv", "data.train=[dip.csv]", "data.frequency=1e20"],
        "data.frequency=1e+20 is out of range: it must be",
    ),
    (
        ["data=csv", "data.train=[deep.csv]"],
        "deep.json: its brackets lie deeper within one another than can be read",
    ),
    (["data=csv", "data.train=dip.csv"], "data.train takes a list, such as data.train=[a,b]"),
    (["~seed"], "~seed takes out what every run needs"),
    (["~model"], "~model takes out what every run needs"),
    (["~model.effects"], "~model.effects cannot be applied"),
    (["~optimizer.name"], "~optimizer.name cannot be applied"),
    (["optimizer=-1"], "optimizer=-1: what is chosen there has a name"),
    (["model=null"], "model=null: what is chosen there has a name"),
    (
        ["model.static=" + "x" * 5000],
        "xxx: there is no such choice. Available: branch, compensated_branch",
    ),
    (["task=[profile]"], "task=[profile]: what is chosen there has a name"),
    (["target=???"], "target=???: ??? stands for a value that is missing"),
    (["seed=1e999"], "seed=inf is not a whole number"),
    (["time_limit=inf"], "time_limit=inf is out of range"),
    (["seed=${seed}"], "Recursive interpolation detected"),
    (["data.train.x=a"], "data.train.x=a: no such value can be set there"),
    (["seed='"], "seed=' cannot be read; an argument is KEY=VALUE"),
    (
        ["model.effects=" + "[" * 99 + "]" * 99],
        "model.effects has brackets 99 deep within one another",
    ),
    (["tracking.uri=a\nb"], "tracking.uri=a b has a line break"),
    (["optimizer.population=99999999999"], "optimizer.population=99999999999 is out of range"),
    (
        ["hydra.run.dir=/dev/null/x"],
        "/dev/null/x cannot be created (Not a directory); choose another folder",
    ),
    (
        ["-m", "hydra.sweep.dir=/dev/null/x", "seed=1,2"],
        "/dev/null/x/.tractexp.next.lock cannot be written",
    ),
]
# one process for all: what takes time is to start
SESSION = """if True:
    import io, json, os, sys
    from contextlib import redirect_stderr, redirect_stdout
    from tractexp.__main__ import main
    told = []
    for arguments in json.loads(sys.argv[1]):
        from hydra.core.global_hydra import GlobalHydra
        GlobalHydra.instance().clear()
        os.environ.pop("HYDRA_FULL_ERROR", None)
        sys.argv[1:] = arguments
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()) as said:
            code = main()
        told.append([code, said.getvalue()])
    print(json.dumps(told))
"""


def test_each_fault_gets_one_sentence(tmp_path):
    mutated_settings.table(tmp_path)
    (tmp_path / "deep.csv").write_bytes((tmp_path / "dip.csv").read_bytes())
    (tmp_path / "deep.json").write_text(mutated_settings.DEEP)
    asked = [[*arguments, "tracking.enabled=false"] for arguments, _ in REFUSED]
    ran = subprocess.run(
        [sys.executable, "-c", SESSION, json.dumps(asked)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    for (arguments, sentence), (code, said) in zip(REFUSED, json.loads(ran.stdout), strict=True):
        assert code == 2, (arguments, said)
        assert said.startswith("tractexp: "), (arguments, said)
        assert said.count("\n") == 1, (arguments, said)
        assert sentence in said, arguments


@pytest.mark.parametrize(
    ("told", "sentence"),
    [
        ({"base": {"power": float("inf")}}, "base.power = Infinity must be a number from"),
        ({"base": {"frequency": 1e20}}, "base.frequency = 1e\\+20 must be a number from"),
        ({"base": {"voltage": True}}, "base.voltage = true must be a number from"),
        (
            {"window": {"name": "w", "at": [0, 1e308], "weights": [1, 0]}},
            "window is not as task=convert writes it",
        ),
        (
            {"window": {"name": "w", "at": [[0], [1]], "weights": [1, 0]}},
            "window is not as task=convert writes it",
        ),
        (
            {"window": {"name": "w", "at": [0.0], "weights": [1]}},
            "window is not as task=convert writes it",
        ),
        (
            {"window": {"name": "w", "at": [10**400, 1], "weights": [1, 0]}},
            "window is not as task=convert writes it",
        ),
    ],
)
def test_a_sidecar_that_is_not_finite_is_refused(tmp_path, told, sentence):
    path = mutated_settings.table(tmp_path)
    path.with_suffix(".json").write_text(json.dumps(told))
    with pytest.raises(UserError, match=sentence):
        tractexp.read(str(path))


def test_lists_of_a_sidecar_that_are_none_are_not_read(tmp_path):
    path = mutated_settings.table(tmp_path)
    path.with_suffix(".json").write_text(json.dumps({"notes": 3, "more": True, "name": None}))
    (event,) = tractexp.read(str(path))
    assert event.record.samples == 300
    assert os.fspath(path) in event.record.source
