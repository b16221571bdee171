"""Registration, refusals at registration, and a stranger's package installed for real."""

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tractexp.errors import UserError
from tractexp.identification.optimizer import Optimizer
from tractexp.model.parts import Static
from tractexp.parameter import Parameter, Space
from tractexp.plugin import CONF, Plugin, build, discover, get, plugin, schema

TESTS = Path(__file__).parent
FRAMEWORK = TESTS.parent / "tractexp"


def tractexp(*arguments, cwd, **environment):
    """Run the command line in a folder."""
    command = [sys.executable, "-m", "tractexp", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, env=os.environ | environment)


@pytest.fixture(scope="module")
def acme(tmp_path_factory):
    """Where the second package is installed."""
    site = tmp_path_factory.mktemp("site")
    package = tmp_path_factory.mktemp("source") / "acme"
    subprocess.run(["cp", "-r", str(TESTS / "acme"), str(package)], check=True)  # the build leaves files behind
    pip = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation", "--no-index"]
    done = subprocess.run([*pip, "--target", str(site), str(package)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return site


def test_a_second_package_adds_a_load_an_optimizer_and_an_experiment(acme, tmp_path):
    done = tractexp(
        "experiment=acme_trial", "tracking.enabled=false", "hydra.run.dir=run", cwd=tmp_path, PYTHONPATH=str(acme)
    )
    assert done.returncode == 0, done.stderr
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    assert {"slope_p", "slope_q"} < result["parameters"].keys()
    assert result["optimizer"] == "acme_descent"
    assert result["simulations"] == 61 * 16
    assert result["epsilon_p"] < 0.05


def test_a_second_package_is_in_the_help_and_checked_like_ours(acme, tmp_path):
    done = tractexp("--help", cwd=tmp_path, PYTHONPATH=str(acme))
    assert "acme_descent" in done.stdout
    done = tractexp("optimizer=acme_descent", "optimizer.tries=0", cwd=tmp_path, PYTHONPATH=str(acme))
    assert done.returncode == 2
    assert done.stderr == "tractexp: optimizer.tries=0 is out of range: it must be at least 1\n"


def test_without_the_package_its_names_are_unknown(tmp_path):
    done = tractexp("optimizer=acme_descent", cwd=tmp_path)
    assert done.returncode == 2
    assert "there is no such choice" in done.stderr


def test_every_plugin_has_a_schema_that_says_its_name():
    groups = discover()
    assert {"model/motor", "model/static", "optimizer", "data", "task"} <= groups.keys()
    for classes in groups.values():
        for name, cls in classes.items():
            assert schema(cls)().name == name == cls.__module__.rpartition(".")[2]


def test_every_parameter_has_a_unit_a_meaning_and_a_source():
    for classes in discover().values():
        for cls in classes.values():
            for p in cls.parameters:
                assert p.unit, p.name
                assert p.about, p.name
                assert p.source, p.name


def test_an_unknown_name_gets_the_nearest_one():
    with pytest.raises(UserError, match=r"there is no optimizer 'isa'; did you mean 'issa'\? Available: .*pso"):
        get("optimizer", "isa")


def test_an_unknown_setting_is_named():
    with pytest.raises(UserError, match="'pso' has no setting 'inertai'; did you mean 'inertia'"):
        build("optimizer", {"name": "pso", "inertai": 1})


def test_a_plugin_without_a_source_is_refused():
    with pytest.raises(UserError, match="needs a docstring with a line 'Source:"):

        @plugin
        class Nameless(Static):
            """No origin."""


def test_a_plugin_without_the_method_that_its_base_leaves_to_it_is_refused():
    with pytest.raises(UserError, match="lacks what every plugin of group 'optimizer' must do: define search"):

        @plugin
        class Idle(Optimizer):
            """Does nothing.

            Source: nobody.
            """


def test_a_plugin_without_a_base_is_refused():
    with pytest.raises(UserError, match="must subclass one of the framework's bases"):

        @plugin
        class Homeless(Plugin):
            """Source: none."""


def test_a_taken_name_is_refused_and_both_are_named():
    with pytest.raises(
        UserError, match=r"the name 'ssa' in group 'optimizer' is taken by tractexp_plugins\.optimizers"
    ):
        plugin(
            type(
                "Ssa", (Optimizer,), {"__doc__": "Source: here.", "__module__": "elsewhere.ssa", "__annotations__": {}}
            )
        )


@pytest.mark.parametrize(
    ("default", "bounds", "sentence"),
    [
        (2.0, (0.0, 1.0), r"the default 2 is outside the bounds \[0, 1\]"),
        (0.5, (1.0, 0.0), r"bounds \[1, 0\] must be two finite numbers, the lower one first"),
        (0.5, (0.0, float("inf")), "must be two finite numbers"),
    ],
)
def test_a_parameter_checks_its_bounds(default, bounds, sentence):
    with pytest.raises(UserError, match=sentence):
        Parameter(default, bounds, "1", "about", "source").check("here")


def test_the_space_maps_names_to_the_unit_cube_and_back():
    space = Space(("a", "b"), np.array([0.0, -2.0]), np.array([1.0, 2.0]))
    assert space.from_unit(space.to_unit([[0.25, 1.0]])).tolist() == [[0.25, 1.0]]
    assert space.index("b") == 1
    with pytest.raises(UserError, match="this model has no parameter 'c'"):
        space.index("c")


def test_a_second_package_replaces_a_shipped_default(acme, tmp_path):
    shown = ("task=export", "--cfg", "job", "--package", "task.format")
    assert "andes" in tractexp(*shown, cwd=tmp_path).stdout
    done = tractexp(*shown, cwd=tmp_path, PYTHONPATH=str(acme))
    assert "modelica" in done.stdout, done.stderr


ENGLISH = {"none", "voltage"}  # words first, and names of plugins besides
THE_PAPER = ("replication/", "report/paper")  # what the paper compares is named there: it is the subject


def test_the_framework_names_no_plugin():
    names = {name for group, classes in discover().items() if group != "task" for name in classes}
    names |= {path.stem for group in ("data", "model", "optimizer") for path in (CONF / group).glob("*.yaml")}
    found = []
    for path in sorted(FRAMEWORK.rglob("*.py")):
        where = path.relative_to(FRAMEWORK).as_posix()
        if not where.startswith(THE_PAPER):
            strings = (node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Constant))
            found += [f"{where}:{s.lineno} '{s.value}'" for s in strings if s.value in names - ENGLISH]
    assert not found
