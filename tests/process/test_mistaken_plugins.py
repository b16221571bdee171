"""Mistakes of who writes a plugin or a choice: each is told in a sentence where it is chosen, and
blocks nothing else.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest

PARTS = "from tractexp.extend import Effect, Optimizer, Parameter, Static, plugin, sites\n"
EFFECT = '''
import math
import numpy as np
@plugin
class Extra(Effect):
    """P_s = P_s (1 + a). Source: here. Departures: none."""

    extra = Parameter(0.0, (-0.02, 0.02), "1", "more", "here", "a", null=0.0)
    places, kind = ("PLACE",), "law"
    relevant = {"extra": 0.002}

    def edit(self, eq, extra):
        eq.edit(sites.P_static, lambda P: CHANGE)
'''
LAW = '''
import numpy as np
@plugin
class Curved(Static):
    """P_s = P_s0 tanh(a u). Source: here. Departures: none."""

    slope = Parameter(1.0, (0.0, 3.0), "1", "slope", "here", "a")

    def law(self, u, slope):
        return 1 + np.tanh(slope * (u - 1)), u
'''
SEARCH = '''
@plugin
class Plain(Optimizer):
    """x' = x. Source: here. Departures: none."""

    tries = 10

    def search(self, evaluate, box, rng):
        yield
'''

FORGOTTEN = '''
class Shared(Static):
    """Source: here."""

    def law(self, u):
        return u, u
'''


def write_effect(change, place="static P"):
    return PARTS + EFFECT.replace("PLACE", place).replace("CHANGE", change)


MODULES = {
    "misplaced": write_effect("P * (1 + extra)", "statik P"),
    "forgetful": write_effect("None"),
    "idle": write_effect("P"),
    "numeric": write_effect("P * (1 + np.tanh(extra))"),
    "by_math": write_effect("P * (1 + math.tanh(extra))"),
    "comparing": write_effect("P * (1 + extra) if extra > 0 else P"),
    "curved": PARTS + LAW,
    "plain": PARTS + SEARCH,
    "unfinished": "x = 1\ndef law(:\n",
    "hasty": "import json\n\njson.loads('{')\n",
    "lonely": "import nowhere_to_be_found\n",
    "undecorated": PARTS + FORGOTTEN,
    "misspelt": "from tractexp.extend import sites\n\nsites.P_statc\n",
}
CHOICES = {
    "optimizer/nameless": "population: 10\n",
    "optimizer/lost": "defaults: [psso]\n",
    "optimizer/listed": "- pso\n",
    "data/nameless": "train: [a.csv]\n",
    "experiment/placed": "seed: 3\n",
}
VALUES = "{T_prime: 0.12, X_prime: 0.25, C: 0.9, M: 0.006, T_m: 0.5, p_v: 1.4, q_v: 3}"
POINTS = """[tractexp.plugins]
mistaken = mistaken
absent = absent_acme
single = single_acme
"""
LISTED = [
    "misplaced cannot be used: plugin mistaken.misplaced.Extra",
    "plain cannot be used: plugin mistaken.plain.Plain",
    "'mistaken.unfinished' cannot be imported: /",
    "unfinished.py, line 2: SyntaxError: invalid syntax",
    "hasty.py, line 3: JSONDecodeError: Expecting property name",
    "lonely.py, line 1: ModuleNotFoundError: No module named 'nowhere_to_be_found'",
    "undecorated.py, line 3: the class Shared(Static) is not decorated with @plugin",
    "misspelt.py, line 3: Unknown: there is no 'sites.P_statc'",
    "'absent_acme' (entry point 'absent') cannot be imported: ModuleNotFoundError",
    "'single_acme' (entry point 'single') is a single file; make it a folder",
    "multistart_least_squares A Latin hypercube",
]
WORKS = {
    "list": ["list", "effect", "optimizer"],
    "simulate": ["task=simulate", f"task.values={VALUES}", "tracking.enabled=false"],
}
TOLD = {
    "model.effects=[misplaced]": "misplaced.py): places names 'statik P'; did you mean 'static",
    "task=discrepancy task.effects=[misplaced]": "places names 'statik P'; did you mean 'static P'",
    "model.effects=[forgetful]": "its edit of P_static returns nothing; the function given to eq",
    "model.effects=[idle]": "cannot be added to this model: its size extra is in no equation",
    "task=discrepancy task.effects=[idle]": "nothing that can be tested: idle: its size extra",
    "model.effects=[numeric]": "numeric.py, line 14: NumPy's tanh takes numbers",
    "model.effects=[by_math]": "by_math.py, line 14: a number is asked for where there are symbols",
    "model.effects=[comparing]": "line 14: a comparison of symbols is neither true nor false",
    "model/static=curved": "curved.py, line 11: NumPy's tanh takes numbers",
    "optimizer=plain": "'tries = 10' has no type, so it is no setting; write 'tries: int = 10'",
    "model/static=unfinished": "unfinished.py, line 2: SyntaxError",
    "optimizer=nameless": "optimizer lacks the name of what is chosen; write optimizer=NAME, or"
    " begin its file with 'defaults: [NAME]'. Names: cmaes",
    "optimizer=lost": "optimizer/lost.yaml: its defaults name optimizer=psso, and there is no such"
    " choice; did you mean 'pso'?",
    "optimizer=listed": "a file that is chosen holds a list; it must hold keys and values",
    "data=nameless": "begin its file with 'defaults: [NAME]'. Names: archive, comtrade",
    "experiment=placed": "an experiment begins with the line '# @package _global_'",
}
RUN = f"""
import json, pathlib, sys
sys.path[:0] = [{str(Path(__file__).parents[1])!r}, *{sys.path!r}]
from command_line import run_command

for name, arguments in json.loads(sys.stdin.read()).items():
    done = run_command(*arguments, cwd=pathlib.Path.cwd())
    print(json.dumps([name, done.returncode, done.stdout, done.stderr]))
"""


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """{command: (exit code, what it printed, what it refused)} beside these plugins."""
    site = tmp_path_factory.mktemp("site")
    package, about = site / "mistaken", site / "mistaken-1.0.dist-info"
    package.mkdir()
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: mistaken\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(POINTS)
    (site / "single_acme.py").write_text("")
    (package / "__init__.py").write_text("")
    for name, text in MODULES.items():
        (package / f"{name}.py").write_text(text)
    for name, text in CHOICES.items():
        file = package / "conf" / f"{name}.yaml"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    commands = WORKS | {command: command.split() for command in TOLD}
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(site)!r})\n{RUN}"],
        input=json.dumps(commands),
        capture_output=True,
        text=True,
        cwd=tmp_path_factory.mktemp("run"),
    )
    assert done.returncode == 0, done.stderr
    rows = map(json.loads, done.stdout.splitlines())
    return {name: (code, out, err) for name, code, out, err in rows}


def test_what_does_not_use_a_mistaken_plugin_works(answers):
    assert answers["simulate"][0] == 0, answers["simulate"][2]


@pytest.mark.parametrize("sentence", LISTED)
def test_the_list_tells_what_can_be_used_and_why_the_rest_cannot(sentence, answers):
    code, out, err = answers["list"]
    assert code == 0, err
    assert sentence in " ".join(out.split())


@pytest.mark.parametrize(("command", "sentence"), TOLD.items())
def test_a_mistake_is_told_in_a_sentence_where_it_is_chosen(command, sentence, answers):
    code, _, err = answers[command]
    assert code == 2, err
    assert sentence in err
    assert len(err.splitlines()) == 1
