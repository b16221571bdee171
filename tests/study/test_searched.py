"""Searches asked for in Python, and their comparison: by name, with switches, of plugins of one's
own.
"""

import importlib
import json

import numpy as np
import pytest
from command_line import run_command

import tractexp
from tractexp.errors import UserError
from tractexp.storage import files

BRIEF = {"name": "pso", "population": 10}
PLUGINS = {
    "guesses": '''
from tractexp.extend import Optimizer, plugin

@plugin
class Guesses(Optimizer):
    """Points drawn evenly: twenty, and where it is wide a hundred more; `idle` does nothing.

    Source: none.
    """

    wide: bool = False
    idle: bool = False
    also: bool = True

    def search(self, evaluate, box, rng):
        evaluate(box.uniform(rng, 20))
        yield
        if self.wide:
            evaluate(box.uniform(rng, 100))
            yield
''',
    "stumbles": '''
from tractexp.extend import Optimizer, plugin

@plugin
class Stumbles(Optimizer):
    """Points drawn evenly, and an error about every other time.

    Source: none.
    """

    odds: float = 0.5

    def search(self, evaluate, box, rng):
        if rng.random() < self.odds:
            raise ZeroDivisionError("the third step divides by the width of nothing")
        evaluate(box.uniform(rng, 20))
        yield
''',
}


@pytest.fixture(scope="module")
def dip():
    return tractexp.read("tibet_50pct")[0]


@pytest.fixture
def plugins(tmp_path, monkeypatch, registry_as_it_was):
    """Optimizers in files beside the user's own program, which has imported them."""
    monkeypatch.syspath_prepend(tmp_path)
    for name, text in PLUGINS.items():
        (tmp_path / f"{name}.py").write_text(text)
        importlib.import_module(name)
    yield
    for name in PLUGINS:
        importlib.sys.modules.pop(name)


def test_a_search_ends_where_an_identification_by_the_same_seed_does(dip):
    made = tractexp.search(
        dip, optimizers=BRIEF, seeds=2, seed=4, budget=100, cores=1, progress=False
    )
    assert [(run.seed, run.optimizer) for run in made.runs] == [(4, "pso"), (5, "pso")]
    for run in made.runs:
        fit = tractexp.identify(
            dip, optimizer=BRIEF, seed=run.seed, budget=100, check_intervals=False, progress=False
        )
        ended = fit.result.search
        assert run.parameters == ended["parameters"]
        for key in ("objective", "epsilon_p", "epsilon_q"):
            assert getattr(run, key) == ended[key]
        np.testing.assert_array_equal(run.history, fit.search_result.history.objective)
        np.testing.assert_array_equal(run.simulations, fit.search_result.history.simulations)


def test_searches_come_back_from_their_file_and_are_compared_alike(dip, plugins, tmp_path):
    asked = {"seeds": 3, "budget": 20, "cores": 1, "progress": False}
    made = tractexp.search(dip, optimizers=["guesses", "stumbles"], **asked)
    back = tractexp.load(made.save(tmp_path / "searches.json"))
    assert files.make_plain(back.to_dict()) == files.make_plain(made.to_dict())
    assert repr(back) == repr(made)
    one, other = (tractexp.compare(it, floor=1e-9, progress=False) for it in (made, back))
    assert one.content == other.content
    assert made.to_frame()["variant"].tolist() == ["guesses"] * 3 + ["stumbles"] * 3


def test_searches_in_python_and_a_sweep_of_the_same_give_the_same_comparison(dip, tmp_path):
    asked = ("optimizer=pso,random_search", "seed=range(0,2)", "budget=100", "data=tibet_50pct")
    settled = ("hydra.launcher.backend=sequential", "hydra.sweep.dir=sweep")
    done = run_command("-m", *asked, *settled, "tracking.enabled=false", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    swept = json.loads((tmp_path / "sweep" / "comparison.json").read_text())
    made = tractexp.search(
        dip, optimizers=["pso", "random_search"], seeds=2, budget=100, cores=1, progress=False
    )
    found = tractexp.compare(made, progress=False)
    assert found.content["runs"] == swept["runs"]
    assert found.content["floor"] == swept["floor"]
    assert found.content["problem"] == swept["problem"]
    assert found.answer == swept["answer"]


def test_switches_are_varied_together_and_their_effects_are_told(dip, plugins):
    made = tractexp.search(
        dip,
        optimizers=["guesses", "random_search"],
        switches=["wide", "idle"],
        seeds=8,
        budget=120,
        cores=1,
        progress=False,
    )
    found = tractexp.compare(made, floor=1e-9, progress=False)
    names = {variant["name"] for variant in found.content["variants"]}
    varied = {f"guesses idle={i} wide={w}" for i in ("true", "false") for w in ("true", "false")}
    assert names == {*varied, "random_search"}
    effects = {effect["switches"][0]: effect for effect in found.content["ablation"]["effects"]}
    assert effects.keys() == {"wide", "idle"}
    idle, wide = effects["idle"], effects["wide"]
    assert (idle["factor"], idle["low"], idle["high"]) == (1.0, 1.0, 1.0)
    # of one seed the first twenty points are the same: more can only lower the best
    assert wide["high"] < 1.0
    assert len(wide["contrasts"]) == 2
    assert "What each ingredient does" in found.report().html


def test_a_plugin_beside_ones_own_program_is_searched_with_in_other_processes(dip, plugins):
    both = [
        tractexp.search(dip, optimizers="guesses", seeds=6, cores=cores, progress=False)
        for cores in (1, 2)
    ]
    ends = [[run.objective for run in made.runs] for made in both]
    assert ends[0] == ends[1]
    assert len(set(ends[0])) == 6


def test_a_search_that_fails_is_a_row_with_the_reason_and_counts_as_the_worst(dip, plugins):
    asked = {"budget": 20, "cores": 1, "progress": False}
    made = tractexp.search(dip, optimizers=["stumbles", "guesses"], seeds=8, **asked)
    failures = [run.failure for run in made.runs if run.failure]
    assert 0 < len(failures) < 8
    assert set(failures) == {"ZeroDivisionError: the third step divides by the width of nothing"}
    assert failures[0] in repr(made)
    found = tractexp.compare(made, floor=1e-9, progress=False)
    failed = {v["name"]: v["failures"] for v in found.content["variants"]}
    assert failed == {"stumbles": len(failures), "guesses": 0}
    never = {"name": "stumbles", "odds": 1.0}
    with pytest.raises(
        UserError, match=r"none of the 2 runs of tractexp\.search finished.*nothing"
    ):
        tractexp.compare(tractexp.search(dip, optimizers=never, seeds=2, **asked), progress=False)


def test_each_search_is_told_and_one_made_before_is_read_back(dip, tmp_path, monkeypatch):
    from tractexp.cache import store

    monkeypatch.setattr(store.SEARCHES, "folder", tmp_path)
    told = []
    asked = {"optimizers": BRIEF, "budget": 50, "cores": 1, "progress": told.append}
    tractexp.search(dip, seeds=2, **asked)
    assert told[-2:] == ["1 of 2 searches", "2 of 2 searches"]
    assert told[0] == f"fit: {dip!r}"
    told.clear()
    tractexp.search(dip, seeds=3, **asked)
    assert told[-4:] == [
        "2 of them were made before by the same code on the same records, and are read back",
        *(f"{k} of 3 searches" for k in (1, 2, 3)),
    ]


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        ({"optimizers": ["pos"]}, "optimizer=pos: there is no such choice; did you mean 'pso'"),
        ({"seeds": 0}, "seeds=0 is out of range"),
        ({"cores": 0}, "cores=0 is out of range"),
        ({"budget": 0}, "budget=0 is out of range"),
        (
            {"optimizers": "issa", "switches": ["levi"]},
            "switches names levi, which is no switch of issa; did you mean 'levy'? Switches: ",
        ),
        ({"optimizers": "issa", "switches": ["levy", "levy"]}, "switches names levy twice"),
        (
            {"optimizers": "issa", "switches": "levy"},
            "switches='levy' is a text, but it must be a list",
        ),
        ({"validate": []}, "search() has no argument 'validate'"),
    ],
)
def test_wrong_arguments_are_refused_in_a_sentence(asked, sentence, dip):
    with pytest.raises(UserError) as refusal:
        tractexp.search(dip, **asked)
    assert sentence in str(refusal.value)
