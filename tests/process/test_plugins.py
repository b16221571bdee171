"""Registration, refusals at registration, and a stranger's package installed for real."""

import ast
import functools
import importlib
import importlib.metadata
import json
import os
import re
import runpy
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import start_command

from tractexp.configuration import plugin as framework
from tractexp.configuration.plugin import CONF, Plugin, build, discover, get, make_schema, plugin
from tractexp.errors import UserError
from tractexp.extend import Optimizer
from tractexp.model.parts import Effect, Measurement, Motor, Static
from tractexp.parameter import Box, Parameter

pytestmark = pytest.mark.usefixtures("registry_as_it_was")

TESTS = Path(__file__).parent
PAGE = TESTS.parents[1] / "docs" / "plugins.md"
FRAMEWORK = TESTS.parents[1] / "tractexp"


@pytest.fixture(scope="module")
def acme(tmp_path_factory):
    """Where the second package is installed."""
    site = tmp_path_factory.mktemp("site")
    package = tmp_path_factory.mktemp("source") / "acme"
    # the build leaves files behind
    subprocess.run(["cp", "-r", str(TESTS / "acme"), str(package)], check=True)
    pip = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "-q",
        "--no-deps",
        "--no-build-isolation",
        "--no-index",
    ]
    done = subprocess.run(
        [*pip, "--target", str(site), str(package)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    (site / "test_acme.py").write_text((TESTS / "acme" / "test_acme.py").read_text())
    return site


def test_a_second_package_adds_a_load_an_optimizer_and_an_experiment(acme, tmp_path):
    done = start_command(
        "experiment=acme_trial",
        "tracking.enabled=false",
        "hydra.run.dir=run",
        cwd=tmp_path,
        PYTHONPATH=str(acme),
    )
    assert done.returncode == 0, done.stderr
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    assert {"slope_p", "slope_q"} < result["parameters"].keys()
    assert result["optimizer"] == "acme_descent"
    assert result["simulations"] == 61 * 16
    assert result["epsilon_p"] < 0.05


def test_a_second_package_is_in_the_help_and_checked_like_ours(acme, tmp_path):
    done = start_command("--help", cwd=tmp_path, PYTHONPATH=str(acme))
    assert "acme_descent" in done.stdout
    done = start_command(
        "optimizer=acme_descent", "optimizer.tries=0", cwd=tmp_path, PYTHONPATH=str(acme)
    )
    assert done.returncode == 2
    assert done.stderr == "tractexp: optimizer.tries=0 is out of range: it must be at least 1\n"


@pytest.mark.long
def test_a_second_package_keeps_the_contracts_by_one_line(acme, tmp_path):
    passed(acme / "test_acme.py", acme, tmp_path)


def passed(file, package, folder):
    """Run a test file with a package on the path, and the project's own settings."""
    pytest_there = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-W",
        "error",
        "-p",
        "no:cacheprovider",
        str(file),
    ]
    done = subprocess.run(
        pytest_there,
        cwd=folder,
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(package)},
    )
    assert done.returncode == 0, done.stdout[-4000:]


STRANGERS = """
import pytest

import tractexp.testing
from tractexp.inference.injection import PERTURBATIONS, Injection
from tractexp.model.model import compose
from tractexp.configuration.plugin import discover, get

TestDocumented = tractexp.testing.contract(
    "documented", {"tabbed": [{"files": ["dip.tsv"]}], "raw16": [{"path": "dip.raw16"}]}
)


@pytest.mark.parametrize("name", sorted(discover()["effect"]))
def test_every_effect_edits_a_load_that_gives_a_law_only(name):
    effect = get("effect", name)()
    motor = {"rotor_flux": "mechanical", "rotor_speed": "voltage"}.get(name, "electromechanical")
    parts = get("model/motor", motor)(), get("model/static", "linear_load")()
    model = compose(*parts, domain="waves" if effect.waves_only else "phasors")
    # a load linear in the voltage is one of constant current and constant power
    refusals = {"polynomial_static_load": "a share of its static load draws constant power already"}
    assert model.acceptance(effect).refusal == refusals.get(name)


def test_a_motor_takes_what_its_sites_allow_and_says_why_not():
    model = compose(get("model/motor", "acme_motor")(), get("model/static", "exponential")())
    effects = {name: cls() for name, cls in discover()["effect"].items() if not cls.waves_only}
    refusals = {name: model.acceptance(effect).refusal for name, effect in effects.items()}
    assert {name: why for name, why in refusals.items() if why} == {
        "magnetic_saturation": "its equations have no C",
        "negative_sequence_braking": (
            "its equations have no backward_impedance (impedance that meets a field turning"
            " backwards, but for the rotor's resistance)"
        ),
        "rotor_flux": "its rotor flux moves already",
        "saturation_curve": "its equations have no C",
        "rotor_speed": "its speed moves already",
    }


MACHINES = sorted(set(discover()["model/motor"]) - {"none", "line_side_converter"})


@pytest.mark.parametrize("motor", MACHINES)
def test_every_motor_is_pushed_in_each_flux_and_its_speed(motor):
    static = get("model/static", "exponential")()
    eq = compose(get("model/motor", motor)(), static, [Injection()]).equations
    for state in eq.states.values():
        if state.derived:  # of a branch: it starts from the others
            continue
        pushed = {s.name for s in state.derivative.free_symbols} & set(PERTURBATIONS)
        expected = {"flux": {"push_flux_d", "push_flux_q"}, "speed": {"push_speed"}}
        assert pushed == expected[state.role]
"""


def test_the_examples_of_the_documentation_keep_the_contracts(tmp_path):
    """Each block of docs/plugins.md that is Python, as it stands there, is a plugin
    of a package.
    """
    blocks = re.findall(
        r"```python\n# (\w+\.py)\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL
    )
    assert {name for name, _ in blocks} == {
        "linear_load.py",
        "rate_dependence.py",
        "late_load.py",
        "channel_gain.py",
        "acme_motor.py",
        "shrinking_step.py",
        "tabbed.py",
        "raw16.py",
        "tabs.py",
        "open_y.py",
        "hann.py",
    }
    package = tmp_path / "documented"
    package.mkdir()
    for name, text in (("__init__.py", ""), *blocks):
        (package / name).write_text(text, encoding="utf-8")
    t = np.arange(100) * 0.01
    np.savetxt(
        tmp_path / "dip.tsv",
        np.c_[t, np.ones(100), np.ones(100), np.full(100, 0.5)],
        delimiter="\t",
    )
    t = np.arange(8000) / 4000
    u = (
        np.cos(2 * np.pi * (50 * t[:, None] - np.arange(3) / 3))
        * np.where((t > 1) & (t < 1.2), 0.7, 1.0)[:, None]
    )
    np.round(np.hstack([18000 * u, 6000 * u])).astype("<i2").tofile(tmp_path / "dip.raw16")
    (tmp_path / "test_strangers.py").write_text(STRANGERS)
    passed("test_strangers.py", tmp_path, tmp_path)


def test_the_package_of_the_documentation_is_the_one_that_is_installed_here():
    (told,) = re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert tomllib.loads(told) == tomllib.loads(
        (TESTS / "acme" / "pyproject.toml").read_text(encoding="utf-8")
    )


def test_the_documentation_tells_every_word_of_the_equations_and_every_site(tmp_path):
    from site_pages import sites
    from tractexp.model.equations import Equations
    from tractexp.model.sites import SITES

    text = PAGE.read_text(encoding="utf-8")
    told = set(re.findall(r"`eq\.(\w+)", text))
    framework = {
        "apart",  # as version 0.2 called it, and the next
        "before",
        "parameters",
        "definitions",
        "steps",
        "values_before",
        "shown",
        "states",
        "memories",
        "requirements",
        "edits",
        "latex_names",
        "write",
        "declare",
        "close",
        "at_rest",
        "expand",
        "real_states",
        "real_starts",
        "real_balances",
        "list_expressions",
        "parts",
        "real",
        "latex",
        "outputs",
    }
    assert (
        told
        == {w for w in (*dir(Equations), *vars(Equations())) if not w.startswith("_")} - framework
    )
    listed = sites.write(tmp_path).read_text(encoding="utf-8")
    for site in SITES.values():
        assert (
            f"| `{site.name}` | {site.owner} | {site.kind} | {site.unit} | {site.about} |" in listed
        )


def test_without_the_package_its_names_are_unknown(tmp_path):
    done = start_command("optimizer=acme_descent", cwd=tmp_path)
    assert done.returncode == 2
    assert "there is no such choice" in done.stderr


FORGOTTEN = """
from tractexp.extend import Static, plugin

class Shared(Static):
    \"\"\"Source: here.\"\"\"

    def law(self, u):
        return u, u
"""


def test_what_plugins_are_made_from_is_not_taken_for_a_plugin_without_its_decorator(
    tmp_path, monkeypatch
):
    made = tmp_path / "shared_bases"
    made.mkdir()
    (made / "__init__.py").write_text("")
    text = (
        FORGOTTEN
        + '\n@plugin\nclass Child(Shared):\n    """Source: here."""\n\nclass _Own(Static):\n   '
        " pass\n"
    )
    (made / "shared_base_child.py").write_text(text)
    (made / "importer.py").write_text("from tractexp.extend import Static\n")
    monkeypatch.syspath_prepend(tmp_path)
    framework.import_all([importlib.import_module("shared_bases")])
    assert get("model/static", "shared_base_child").__name__ == "Child"


def test_every_plugin_has_a_schema_that_says_its_name():
    groups = discover()
    assert {"model/motor", "model/static", "optimizer", "data", "task"} <= groups.keys()
    for classes in groups.values():
        for name, cls in classes.items():
            assert make_schema(cls)().name == name == cls.__module__.rpartition(".")[2]


def test_an_unknown_name_gets_the_nearest_one():
    with pytest.raises(
        UserError, match=r"there is no optimizer 'isa'; did you mean 'issa'\? Available: .*pso"
    ):
        get("optimizer", "isa")


def test_an_unknown_setting_is_named():
    with pytest.raises(UserError, match="'pso' has no setting 'inertai'; did you mean 'inertia'"):
        build("optimizer", {"name": "pso", "inertai": 1})


def test_a_plugin_without_a_source_is_refused():
    with pytest.raises(UserError, match="needs a docstring with a line 'Source:"):

        @plugin
        class Nameless(Static):
            """No origin."""


def test_python_without_docstrings_is_told_from_a_plugin_without_a_source():
    done = subprocess.run(
        [sys.executable, "-OO", "-m", "tractexp", "--cfg", "job"], capture_output=True, text=True
    )
    assert done.returncode == 2
    assert done.stderr.endswith("run without -OO\n")


def test_a_plugin_without_the_method_that_its_base_leaves_to_it_is_refused():
    with pytest.raises(
        UserError, match="lacks what every plugin of group 'optimizer' must do: define search"
    ):

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
    discover()
    with pytest.raises(
        UserError,
        match=r"the name 'ssa' in group 'optimizer' is taken by tractexp_plugins\.optimizers",
    ):
        plugin(
            type(
                "Ssa",
                (Optimizer,),
                {"__doc__": "Source: here.", "__module__": "elsewhere.ssa", "__annotations__": {}},
            )
        )


SIZE = Parameter(0.0, (0.0, 1.0), "1", "how large", "here", null=0.0)
PLAIN = Parameter(0.5, (0.0, 1.0), "1", "how fast", "here")


def declared(base, methods, **attributes):
    """Register a plugin class of this base; it is refused, so nothing stays registered."""
    made = {"__doc__": "Source: here.", "__module__": "elsewhere.stranger", "__annotations__": {}}
    return plugin(type("Stranger", (base,), made | methods | attributes))


def load(law, **attributes):
    return Static, {"law": law}, attributes


def effect(edit, **attributes):
    return Effect, {"edit": edit, "a": replace(SIZE)}, attributes


@pytest.mark.parametrize(
    ("made", "sentence"),
    [
        (
            load(lambda self, u, p_w: (1, 1), p_v=replace(PLAIN)),
            r"law\(\) asks for 'p_w', which is neither a parameter of it nor offered; did you mean"
            r" 'p_v'\?.* f, p_v",
        ),
        (
            load(lambda self, u: (1, 1), p_v=replace(PLAIN)),
            r"law\(\) does not take the parameter 'p_v'",
        ),
        (load(lambda self, p_v: (1, 1), p_v=replace(PLAIN)), r"law\(\) must take u first"),
        (load(lambda self, u, *p: (1, 1), p_v=replace(PLAIN)), r"by name, so it cannot take \*p"),
        (
            load(lambda self, u, f: (f, 1)),
            r"law\(\) asks for the frequency, f, .* say reads = \('f',\)",
        ),
        (load(lambda self, u: (1, 1), reads=("frequency",)), "reads names the channel 'frequency'"),
        (
            load(lambda self, u, _c: (1, 1), _c=replace(PLAIN)),
            "called '_c': that is no name of Python's",
        ),
        (
            load(lambda self, u, U0: (1, 1), U0=replace(PLAIN)),
            "called 'U0': the equations give that name",
        ),
        (
            load(lambda self, u, a, b: (1, 1), **dict.fromkeys("ab", replace(PLAIN))),
            "'b' is the parameter 'a' again",
        ),
        (
            load(lambda self, u, a: (1, 1), a=replace(PLAIN, unit="")),
            "a: the parameter has no unit",
        ),
        ((Static, {}, {}), "must do: define law"),
        ((Motor, {"declare": lambda self, eq, speed: None}, {}), r"declare\(\) asks for 'speed'"),
        ((Measurement, {"a": replace(SIZE)}, {}), "must do: define observe"),
        (
            (Effect, {"edit": lambda self, eq, a: None}, {"a": replace(PLAIN)}),
            "has no size: give the .* a 'null'",
        ),
        (effect(lambda self, eq: None), r"edit\(\) does not take the parameter 'a'"),
        (
            effect(lambda self, eq, a: None, grid={"b": (1.0,)}),
            "grid names 'b', no parameter of it",
        ),
        (effect(lambda self, eq, a: None, grid={"a": (1.0,)}), "grid names 'a', which is a size"),
        (
            effect(lambda self, eq, a, b: None, b=replace(PLAIN), relevant={"b": 0.1}),
            "relevant names 'b', which",
        ),
        (
            effect(lambda self, eq, a, b: None, b=replace(PLAIN), grid={"b": (3.0,)}),
            "grid has b = 3, outside its",
        ),
    ],
)
def test_what_a_class_forgets_is_refused_when_it_is_registered(made, sentence):
    base, methods, attributes = made
    with pytest.raises(UserError, match=r"^plugin elsewhere\.stranger\.Stranger.*" + sentence):
        declared(base, methods, **attributes)


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"default": 2.0}, r"the default 2 is outside the bounds \[0, 1\]"),
        (
            {"bounds": (1.0, 0.0)},
            r"bounds \[1, 0\] must be two finite numbers, the lower one first",
        ),
        ({"bounds": (0.0, float("inf"))}, "must be two finite numbers"),
        ({"null": -1.0}, r"the null -1 is outside the bounds \[0, 1\]"),
        ({"natural_ends": (0.5,)}, r"the natural ends \[0\.5\] must be bounds, of \[0, 1\]"),
        ({"source": " "}, "the parameter has no source"),
    ],
)
def test_a_parameter_checks_itself(settings, sentence):
    with pytest.raises(UserError, match=sentence):
        replace(PLAIN, **settings).check("here")


def test_a_box_maps_names_to_the_unit_cube_and_back():
    space = Box(np.array([0.0, -2.0]), np.array([1.0, 2.0]), ("a", "b"))
    assert space.from_unit(space.to_unit([[0.25, 1.0]])).tolist() == [[0.25, 1.0]]
    assert space.index("b") == 1
    with pytest.raises(UserError, match="this model has no parameter 'c'"):
        space.index("c")


def test_a_second_package_replaces_a_shipped_default(acme, tmp_path):
    shown = ("task=export", "--cfg", "job", "--package", "task.format")
    assert "andes" in start_command(*shown, cwd=tmp_path).stdout
    done = start_command(*shown, cwd=tmp_path, PYTHONPATH=str(acme))
    assert "modelica" in done.stdout, done.stderr


ENGLISH = {"none", "voltage", "auto"}  # words first, and names of plugins besides
# the paper's subject, and parts that happen to be called as a plugin is
NAMING = ("studies/paper/", "extend/")


def test_the_framework_names_no_plugin():
    # and what tests have added
    ours = {group: classes for group, classes in discover().items() if group != "task"}
    names = {
        n
        for classes in ours.values()
        for n, cls in classes.items()
        if cls.__module__.startswith("tractexp_")
    }
    names |= {
        path.stem
        for group in ("data", "model", "optimizer")
        for path in (CONF / group).glob("*.yaml")
    }
    found = []
    for path in sorted(FRAMEWORK.rglob("*.py")):
        where = path.relative_to(FRAMEWORK).as_posix()
        if not where.startswith(NAMING):
            strings = (
                node
                for node in ast.walk(ast.parse(path.read_text()))
                if isinstance(node, ast.Constant)
            )
            found += [
                f"{where}:{s.lineno} '{s.value}'" for s in strings if s.value in names - ENGLISH
            ]
    assert not found


def test_of_the_plugins_that_are_named_alone_the_files_are_imported():
    script = (
        "import sys; from tractexp.configuration.plugin import get; get('optimizer', 'pso');"
        " print(*(name for name in sys.modules if name.startswith('tractexp_plugins.optimizers.')))"
    )
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["tractexp_plugins.optimizers.pso"]


def test_what_can_be_chosen_is_known_without_importing_plugins_again(tmp_path):
    script = (
        "import sys; from tractexp.sweep.hydra_groups import register; register();"
        " print('tractexp_plugins.motors.electromechanical' in sys.modules)"
    )
    run = functools.partial(
        subprocess.run,
        [sys.executable, "-c", script],
        env={**os.environ, "TRACTEXP_CACHE_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert [run().stdout, run().stdout] == ["True\n", "False\n"]


def test_a_plugin_in_a_program_goes_by_its_class(tmp_path):
    """As in a notebook: there is no file that could name it."""
    program = tmp_path / "a program.py"
    program.write_text(
        "from tractexp.extend import Optimizer, plugin\n"
        "@plugin\n"
        "class EvenSteps(Optimizer):\n"
        '    """Nothing. Source: none. Departures: none."""\n'
        "    def search(self, evaluate, box, rng):\n"
        "        yield\n"
    )
    runpy.run_path(str(program), run_name="__main__")
    assert get("optimizer", "even_steps").__name__ == "EvenSteps"
