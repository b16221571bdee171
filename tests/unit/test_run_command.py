"""The command that goes on with what a run was told: a line to be pasted."""

from pathlib import Path

import pytest

from tractexp.configuration import plugin, run_command


@pytest.mark.parametrize(
    ("arguments", "settings", "expected"),
    [
        ([], ["task=discrepancy"], "tractexp task=discrepancy"),
        (["data=tibet", "seed=3"], ["task=plan"], "tractexp task=plan data=tibet"),
        (
            ["data=a", "data.train=[b c]"],
            ["task=plan", "data=d"],
            "tractexp task=plan data=d 'data.train=[b c]'",
        ),
        (
            ["model/static=zip", "domain=waves", "optimizer=pso"],
            ["task=plan"],
            "tractexp task=plan model/static=zip domain=waves",
        ),
        (
            ["--config-dir", "conf", "model=own"],
            ["task=plan"],
            "tractexp task=plan --config-dir conf model=own",
        ),
        (["-m", "data=a,b"], ["task=plan"], "tractexp task=plan"),  # several in one line
    ],
)
def test_records_and_load_of_a_run_are_repeated(monkeypatch, arguments, settings, expected):
    monkeypatch.setattr(run_command, "_started", ["tractexp", *arguments])
    assert run_command.build_again_command(*settings) == expected


def test_an_extended_model_is_fitted_to_the_records_of_its_run(monkeypatch):
    arguments = [
        "--config-dir",
        "old",
        "data=archive",
        "data.path=my records",
        "model=old",
        "model.fixed.C=0.8",
    ]
    monkeypatch.setattr(run_command, "_started", ["tractexp", *arguments])
    command = run_command.build_again_command(
        "--config-dir", "conf", "model=extended", of=("data",)
    )
    assert (
        command == "tractexp --config-dir conf model=extended data=archive 'data.path=my records'"
    )


def test_a_long_command_is_told_by_the_folder_of_its_run(monkeypatch, tmp_path):
    arguments = [
        "data=comtrade",
        "data.path=station.cfg",
        "data.train=[1]",
        "data.validate=[2]",
        "domain=waves",
    ]
    monkeypatch.setattr(run_command, "_started", ["tractexp", *arguments])
    monkeypatch.setattr(run_command, "_placed", [])
    monkeypatch.chdir(tmp_path)
    run_command.remember_folder(tmp_path / "outputs" / "run")
    assert (
        run_command.build_again_command("task=discrepancy")
        == "tractexp again outputs/run task=discrepancy"
    )
    assert run_command.build_again_command("model=extended", of=("data",)).startswith(
        "tractexp model=extended data=comtrade"
    )
    monkeypatch.setattr(run_command, "_started", ["tractexp", "data=tibet"])
    assert (
        run_command.build_again_command("task=discrepancy")
        == "tractexp task=discrepancy data=tibet"
    )


@pytest.mark.parametrize(
    ("train", "validate", "settings"),
    [
        ([1], [2], ["data.train=[1,2]", "data.validate=[]"]),
        (
            ["a dip.csv"],
            ["pkg://x/it's.csv"],
            ["data.train=['a dip.csv','pkg://x/it\\'s.csv']", "data.validate=[]"],
        ),
        ([], [2], ["data.validate=[]"]),  # all but those
        ([1, 2], [], []),
        (None, None, []),
    ],
)
def test_the_dips_held_out_are_fitted_too(monkeypatch, train, validate, settings):
    monkeypatch.setattr(run_command, "_roles", {})
    run_command.remember_roles(train, validate)
    assert run_command.list_settings_of_all() == settings
    monkeypatch.setattr(run_command, "_started", ["tractexp", "data.train=[9]", "data.path=a.cfg"])
    command = run_command.build_again_command("model=m", *settings, of=("data",))
    assert ("data.train=[9]" in command) == (not train or not validate)
    assert command.endswith("data.path=a.cfg")


@pytest.mark.parametrize(
    ("package", "line"), [("tractexp_plugins", 2), ("tractexp.api", 0), ("", 0)]
)
def test_a_plugin_that_fails_is_named_by_file_and_line(tmp_path, package, line):
    """Not what fails in a task of our own, nor in what is no plugin."""
    folder = Path(
        next((p.__path__[0] for p in plugin.import_packages() if p.__name__ == package), tmp_path)
    )
    file, scope = folder / "breakaway_load.py", {}
    exec(compile("def edit():\n    return sympy.tanh(1)\n", str(file), "exec"), scope)
    with pytest.raises(NameError) as failed:
        scope["edit"]()
    assert plugin.place_in_plugin(failed.value) == (f"{file}, line {line}" if line else "")
