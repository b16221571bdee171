"""What users of Hydra bring along: callbacks, loggers, folders of configurations, plus signs, other
sweepers.
"""

import importlib.util
import json

import pytest
from command_line import run_command

QUICK = ("tracking.enabled=false", "optimizer=pso", "optimizer.population=10", "budget=100")
HERE, ONE = "hydra.sweep.dir=sweep", "hydra.launcher.backend=sequential"
CALLBACK = """
import logging
from hydra.experimental.callback import Callback

class Told(Callback):
    def __init__(self, path):
        self.path = path

    def tell(self, *words):
        with open(self.path, "a") as file:
            print(*words, file=file)

    def on_job_start(self, config, **more):
        logging.getLogger("mine").info("begun")
        self.tell("begun", config.hydra.job.num, config.seed)

    def on_job_end(self, config, job_return, **more):
        self.tell("ended", config.hydra.job.num, job_return.status.name, job_return.return_value)
"""


def ends(folder):
    return {path.parent.name: json.loads(path.read_text()) for path in folder.glob("*/status.json")}


def test_callbacks_and_loggers_of_the_users_are_at_work_in_each_job(tmp_path, monkeypatch):
    (tmp_path / "told_by_tests.py").write_text(CALLBACK)
    monkeypatch.syspath_prepend(tmp_path)
    told = f"+hydra.callbacks.told={{_target_: told_by_tests.Told, path: {tmp_path / 'told.txt'}}}"
    asked = (
        "-m",
        *QUICK,
        ONE,
        HERE,
        told,
        "hydra/job_logging=default",
        "hydra.job.name=fit",
        "seed=3,4",
    )
    done = run_command(*asked, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = ends(tmp_path / "sweep")
    ended = [
        f"ended {k} COMPLETED {found[str(k)]['metrics']['search_objective']}" for k in range(2)
    ]
    assert (tmp_path / "told.txt").read_text().splitlines() == [
        "begun 0 3",
        ended[0],
        "begun 1 4",
        ended[1],
    ]
    for number in "01":
        assert "[mine][INFO] - begun" in (tmp_path / "sweep" / number / "fit.log").read_text()


def test_a_sweep_of_one_job_ends_with_its_page(tmp_path):
    done = run_command("-m", *QUICK, ONE, HERE, "seed=3", "hydra/launcher=joblib", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"sweep: 1 job in {tmp_path / 'sweep'}\n")
    page = tmp_path / "sweep" / "0" / "report.html"
    assert page.is_file()
    assert str(page) in done.stdout


def test_options_may_stand_between_and_behind_settings(tmp_path):
    done = run_command(
        *QUICK, ONE, "--multirun", HERE, "seed=3", "-cd", str(tmp_path), "budget=90", cwd=tmp_path
    )
    assert done.returncode == 0, done.stderr
    config = (tmp_path / "sweep" / "0" / ".hydra" / "config.yaml").read_text()
    assert "budget: 90" in config
    told = run_command("seed=3", "--info", "config", "budget=90", cwd=tmp_path)
    assert (told.returncode, told.stderr) == (0, "")
    shown = run_command("seed=3", "--cfg", "job", "--package", "optimizer", cwd=tmp_path)
    assert (shown.returncode, "name: issa" in shown.stdout) == (0, True)


def test_folders_of_jobs_are_named_as_asked_and_found_again(tmp_path):
    named = ("-m", *QUICK, ONE, HERE, "hydra.sweep.subdir=${optimizer.name}/seed_${seed}")
    variants = "optimizer=pso,ssa"
    assert run_command(*named, variants, "seed=3,4", cwd=tmp_path).returncode == 0
    assert {p.parent.name for p in (tmp_path / "sweep" / "pso").glob("*/status.json")} == {
        "seed_3",
        "seed_4",
    }
    compared = json.loads((tmp_path / "sweep" / "comparison.json").read_text())
    assert sorted((run["variant"], run["seed"]) for run in compared["runs"]) == [
        ("pso", 3),
        ("pso", 4),
        ("ssa", 3),
        ("ssa", 4),
    ]
    again = run_command(*named, "seed=3,4,5", cwd=tmp_path)
    assert "2 of them are finished and kept" in again.stdout
    page = tmp_path / "sweep" / "sweep.html"
    assert again.stdout.splitlines()[-1] == f"  {page}", "one variant: its own page, no comparison"
    assert "http-equiv" not in page.read_text(encoding="utf-8"), "it has ended, and loads no more"
    one = run_command("-m", *QUICK, ONE, HERE, "hydra.sweep.subdir=all", "seed=6,7", cwd=tmp_path)
    assert (one.returncode, one.stderr.count("\n")) == (2, 1)
    assert "hydra.sweep.subdir=all is the folder of two jobs" in one.stderr


def test_a_job_may_be_seeded_by_its_number_and_returns_what_is_named(tmp_path):
    """As Hydra's other sweepers run jobs: here its basic one, which is in every installation."""
    asked = (
        "-m",
        *QUICK,
        HERE,
        ONE,
        "hydra/sweeper=basic",
        "seed=${hydra:job.num}",
        "model.fixed.q_v=3,4",
    )
    done = run_command(*asked, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"to watch it: {(tmp_path / 'sweep' / 'sweep.html').as_uri()}" in done.stdout
    found = ends(tmp_path / "sweep")
    assert [found[number]["seed"] for number in "01"] == [0, 1]
    refused = run_command(*asked, "sweep.returns=[objectiv]", "hydra.sweep.dir=other", cwd=tmp_path)
    assert {end["message"].partition(",")[0] for end in ends(tmp_path / "other").values()} == {
        "sweep.returns names objectiv"
    }
    assert refused.stderr.startswith(
        "tractexp: job 0: sweep.returns names objectiv, which this task does not measure"
    )


@pytest.mark.skipif(importlib.util.find_spec("optuna") is not None, reason="Optuna is installed")
def test_a_sweeper_that_is_not_installed_is_named_with_what_brings_it(tmp_path):
    done = run_command("-m", "hydra/sweeper=optuna", "seed=1,2", cwd=tmp_path)
    assert done.stderr == (
        "tractexp: hydra/sweeper=optuna: there is no such choice before it is installed: pip"
        " install 'tractexp[optuna]'\n"
    )


@pytest.mark.skipif(
    importlib.util.find_spec("optuna") is None, reason="no Optuna: pip install 'tractexp[optuna]'"
)
def test_optuna_is_given_where_the_searches_ended(tmp_path):
    import optuna

    store = f"sqlite:///{tmp_path / 'study.db'}"
    study = (
        f"hydra.sweeper.storage={store}",
        "hydra.sweeper.study_name=issa",
        "hydra.sweeper.n_trials=4",
    )
    space = (
        "optimizer=issa",
        "optimizer.producers=interval(0.1,0.5)",
        "budget=300",
        "tracking.enabled=false",
    )
    done = run_command("-m", "hydra/sweeper=optuna", *study, *space, ONE, HERE, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    values = [trial.value for trial in optuna.load_study(study_name="issa", storage=store).trials]
    searched = [end["metrics"]["search_objective"] for end in ends(tmp_path / "sweep").values()]
    assert sorted(values) == sorted(searched)
    assert len(set(values)) == 4, "the polished objective is one and the same"


def test_a_folder_of_configurations_of_ones_own_adds_to_every_group_and_overrides(tmp_path):
    for name, text in {
        "optimizer/mine.yaml": "# A swarm of ten.\ndefaults: [pso]\npopulation: 10\n",
        "data/tibet_50pct.yaml": "# Ours.\ndefaults: [csv]\ntrain: [mine.csv]\n",
        "experiment/quick.yaml": "# @package _global_\ndefaults:\n  - override /optimizer:"
        " mine\nbudget: 300\n",
        "own.yaml": "defaults: [config, _self_]\nbudget: 400\noptimizer: {population: 12}\n",
        "data/dips.yaml": "# Two dips.\ndefaults: [csv]\ntrain: [a.csv, b.csv]\n",
    }.items():
        path = tmp_path / "mine" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    own = ("-cd", "mine")
    listed = run_command("list", "optimizer", *own, cwd=tmp_path)
    assert "A swarm of ten." in listed.stdout
    shown = run_command(*own, "+experiment=quick", "data=dips", "--cfg", "job", cwd=tmp_path).stdout
    for line in ("population: 10", "budget: 300", "- b.csv"):
        assert line in shown
    assert "- mine.csv" in run_command(*own, "--cfg", "job", cwd=tmp_path).stdout, (
        "the one by default is replaced"
    )
    configured = run_command(*own, "-cn", "own", "optimizer=mine", "--cfg", "job", cwd=tmp_path)
    for line in ("budget: 400", "population: 12", "cognitive: "):
        assert line in configured.stdout
    nowhere = run_command("list", "-cd", "nowhere", cwd=tmp_path)
    assert (
        nowhere.stderr
        == "tractexp: tractexp list: there is no folder nowhere; -cd names one of configurations\n"
    )


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["-cn", "foo"], "-cn foo: there is no such configuration; give the folder of yours, too"),
        (["-cd", "nowhere"], "nowhere: there is no such folder"),
        (["~nothing"], "~nothing: there is no such setting to take out"),
        (
            ["optimizer@foo=pso"],
            "optimizer@foo: no choice of optimizer stands at 'foo'; write optimizer=NAME",
        ),
        (
            ["optimizer=pso,issa"],
            "optimizer=pso,issa has several values; a sweep over them is written tractexp -m"
            " optimizer=pso,issa, one list of them optimizer=[pso,issa]",
        ),
        (["seed=3", "--multrun"], "--multrun: there is no such option; did you mean '--multirun'?"),
        (
            ["-m", "hydra.sweep.subdir=${optimizer.nam}", "seed=1,2"],
            "${optimizer.nam} refers to a setting that there is not",
        ),
        (
            ["+hydra.callbacks.x._target_=nowhere.X"],
            "nowhere.X cannot be imported; _target_ names a class, as package.module.Class",
        ),
        (["-cp", "mine"], "-cp names no folder; -cd FOLDER adds configurations of yours"),
        (
            ["+experiment=nothing"],
            "experiment=nothing: there is no such choice. Available: ablation",
        ),
    ],
)
def test_what_hydra_would_say_in_its_own_words_is_a_sentence(arguments, sentence, tmp_path):
    done = run_command(*arguments, cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert done.stderr.startswith("tractexp: ")
    assert sentence in done.stderr


def test_jobs_are_composed_once_a_choice_and_as_hydra_composes_each(monkeypatch):
    """Hydra takes 0.1 s to compose one; what it makes of each is compared with what the jobs are
    given.
    """
    import unittest.mock

    from hydra import initialize_config_dir
    from hydra.core.global_hydra import GlobalHydra
    from hydra.types import RunMode

    from tractexp.compat.hydra_versions import choose_behavior
    from tractexp.configuration.choices import CONF
    from tractexp.sweep.compose import Composer
    from tractexp.sweep.hydra_groups import register

    register([])
    jobs = [
        ("optimizer=pso", "seed=3", "budget=200"),
        ("optimizer=issa", "optimizer.population=30", "seed=${hydra:job.num}"),
        ("optimizer=pso", "++model.fixed.q_v=3", "seed=4"),
        ("optimizer=pso", "data.train=[a.csv,b.csv]", "seed=5"),
        ("optimizer=issa", "optimizer.producers=0.3", "tracking.uri=null"),
    ]
    with initialize_config_dir(str(CONF), **choose_behavior()):
        loader = GlobalHydra.instance().config_loader()
        master = loader.load_configuration("config", [], run_mode=RunMode.MULTIRUN)
        compose = Composer(loader, master)
        counted = unittest.mock.Mock(side_effect=loader.load_sweep_config)
        monkeypatch.setattr(loader, "load_sweep_config", counted)
        composed = [compose(overrides, number) for number, overrides in enumerate(jobs)]
        assert counted.call_count == 3, "once for each optimizer, and where a key is added"
        for number, (one, overrides) in enumerate(zip(composed, jobs, strict=True)):
            whole = compose._as_hydra_composes(overrides, number)
            assert (one.config, one.choices) == (whole.config, whole.choices)


def test_a_choice_of_ones_own_that_is_no_yaml_is_told_with_its_line(tmp_path):
    path = tmp_path / "conf" / "optimizer" / "mine.yaml"
    path.parent.mkdir(parents=True)
    path.write_text("defaults: [pso]\niterations: [5\n")
    done = run_command("--config-dir", "conf", "optimizer=mine", cwd=tmp_path)
    assert done.returncode == 2
    assert f"{path}: line 3: not valid YAML" in done.stderr
