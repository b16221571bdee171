"""What is advised after a call from Python is a call in Python, after a command a command."""

import pytest

from tractexp.configuration import run_command
from tractexp.configuration.run_command import remember_command, suggest_run


@pytest.fixture(autouse=True)
def no_command(monkeypatch):
    for name in ("_started", "_placed"):
        monkeypatch.setattr(run_command, name, [])


@pytest.mark.parametrize(
    ("settings", "call"),
    [
        (("task=discrepancy",), "tractexp.investigate(dips)"),
        (("task=discrepancy", "data=tibet"), "tractexp.investigate('tibet')"),
        (("model.priors=true",), "tractexp.identify(dips, priors=True)"),
        (
            ("task=discrepancy", "domain=waves"),
            "tractexp.investigate(dips, domain='waves')",
        ),
    ],
)
def test_from_python_it_is_a_call_that_compiles(settings, call):
    assert suggest_run(*settings) == call
    compile(call, "advice", "eval")


def test_after_a_command_it_is_one():
    remember_command(["data=csv", "data.train=[a.csv]", "seed=3"])
    assert suggest_run("task=discrepancy") == (
        "tractexp task=discrepancy data=csv 'data.train=[a.csv]'"
    )
