"""`tractexp new`: the package that it writes holds what every plugin must satisfy, and overwrites
nothing.
"""

import os
import subprocess
import sys
import tomllib

import pytest

from tractexp.cli.new import KINDS, new, write_package
from tractexp.errors import UserError


@pytest.mark.parametrize("kind", KINDS)
def test_the_test_that_is_written_passes(kind, tmp_path):
    place = write_package(kind, f"own_{kind}", tmp_path)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    done = subprocess.run(
        command, cwd=place, capture_output=True, text=True, env={**os.environ, "PYTEST_ADDOPTS": ""}
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert " passed" in done.stdout
    assert "skipped" not in done.stdout


def test_it_says_how_to_test_install_and_choose(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert new(["effect", "motor_heating"]) == 0
    told = capsys.readouterr().out
    for words in (
        "cd tractexp_motor_heating && python -m pytest",
        "pip install -e tractexp_motor_heating",
        "model.effects=[motor_heating]",
    ):
        assert words in told
    project = tomllib.loads((tmp_path / "tractexp_motor_heating" / "pyproject.toml").read_text())[
        "project"
    ]
    assert project["entry-points"]["tractexp.plugins"] == {
        "tractexp_motor_heating": "tractexp_motor_heating"
    }
    code = (
        tmp_path / "tractexp_motor_heating" / "tractexp_motor_heating" / "motor_heating.py"
    ).read_text()
    assert "class MotorHeating(Effect):" in code
    assert "xample" not in code


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("Motor", "cannot be the name of a plugin.*lower-case"),
        ("two words", "cannot be the name of a plugin"),
        ("lambda", "cannot be the name of a plugin"),
        ("shunt_capacitor", "the effect 'shunt_capacitor' is there already .*; take another name"),
    ],
)
def test_a_name_that_cannot_be_is_refused(name, why, tmp_path):
    with pytest.raises(UserError, match=why):
        write_package("effect", name, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten(tmp_path):
    place = write_package("static", "lamps", tmp_path)
    (place / "tractexp_lamps" / "lamps.py").write_text("# mine\n")
    with pytest.raises(UserError, match="tractexp_lamps is there already and is not overwritten"):
        write_package("static", "lamps", tmp_path)
    assert (place / "tractexp_lamps" / "lamps.py").read_text() == "# mine\n"
