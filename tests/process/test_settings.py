"""A setting that a task would ignore is refused before anything runs; what it reads, and every
default, is not.
"""

import re

import pytest
from command_line import run_command, start_command

from tractexp.api.task import Task
from tractexp.cli.chosen import collect_chosen_settings, refuse_unread
from tractexp.configuration.choices import CONF
from tractexp.configuration.plugin import build, discover
from tractexp.errors import UserError
from tractexp.sweep.hydra_groups import register

EXPERIMENTS = sorted(path.stem for path in (CONF / "experiment").glob("*.yaml"))


@pytest.fixture(scope="module", autouse=True)
def hydra():
    from hydra import initialize_config_dir

    register()
    with initialize_config_dir(str(CONF), version_base="1.3"):
        yield


def check(*overrides):
    """What `tractexp OVERRIDES` checks between composing and running; returns the composed
    configuration.
    """
    from hydra import compose
    from omegaconf import OmegaConf

    config = compose("config", list(overrides), return_hydra_config=True)
    chosen = collect_chosen_settings(overrides, config.hydra.runtime.choices)
    task = build("task", OmegaConf.to_container(config.task))
    refuse_unread(task, chosen, task.needless())
    return config


@pytest.mark.parametrize(
    ("overrides", "sentence"),
    [
        (
            "task=discrepancy model.per_event=[T_m]",
            "model.per_event=[T_m] is not read by task=discrepancy; its param",
        ),
        (
            "task=discrepancy objective=huber",
            "objective=huber is not read by task=discrepancy; leave it out",
        ),
        (
            "task=discrepancy objective.weight_P=2",
            "objective.weight_P=2 is not read by task=discrepancy; leave it out",
        ),
        (
            "task=discrepancy optimizer.population=9",
            "optimizer.population=9 is not read by task=discrepancy",
        ),
        ("task=discrepancy budget=100", "budget=100 is not read by task=discrepancy; leave it out"),
        (
            "task=discrepancy time_limit=9",
            "time_limit=9 is not read by task=discrepancy; leave it out",
        ),
        (
            "task=discrepancy target=1e-3",
            "target=1e-3 is not read by task=discrepancy; leave it out",
        ),
        # chosen, though default
        ("task=discrepancy optimizer=issa", "optimizer=issa is not read by task=discrepancy"),
        ("task=simulate optimizer=pso", "optimizer=pso is not read by task=simulate; leave it out"),
        (
            "task=simulate ++model.bounds.C=[0.5,1]",
            "model.bounds.C=[0.5,1] is not read by task=simulate",
        ),
        (
            "task=simulate task.depth=0.4 data=tibet_30pct",
            "data=tibet_30pct is not read by task=simulate; with task.d",
        ),
        (
            "task=simulate task.parameters=a.json model/motor=none",
            "model.motor=none is not read by task=simulate; wi",
        ),
        ("task=plan optimizer=ssa", "optimizer=ssa is not read by task=plan; leave it out"),
        ("task=export data=csv", "data=csv is not read by task=export; leave it out"),
        (
            "task=export model=static_zip",
            "model=static_zip is not read by task=export; the model is that of task.par",
        ),
        (
            "task=linear_network model=static_zip",
            "model=static_zip is not read by task=linear_network; a network has no",
        ),
        (
            "task=linear_network model.substeps=2",
            "model.substeps=2 is not read by task=linear_network; a network has no",
        ),
        (
            "task=linear_network optimizer=pso",
            "optimizer=pso is not read by task=linear_network; leave it out",
        ),
        ("task=survey domain=waves", "domain=waves is not read by task=survey; leave it out"),
        (
            "task=compare data=tibet_30pct",
            "data=tibet_30pct is not read by task=compare; choose among the runs by",
        ),
        ("task=compare optimizer=pso", "optimizer=pso is not read by task=compare; leave it out"),
        (
            "task=benchmark budget=100",
            "budget=100 is not read by task=benchmark; set task.multiplier instead",
        ),
        (
            "task=benchmark target=0.1",
            "target=0.1 is not read by task=benchmark; set task.targets instead",
        ),
        (
            "task=benchmark model=static_zip",
            "model=static_zip is not read by task=benchmark; leave it out",
        ),
        (
            "task=paper optimizer=pso",
            "optimizer=pso is not read by task=paper; it compares the paper's three",
        ),
        (
            "experiment=table1 optimizer=pso",
            "optimizer=pso is not read by task=paper; it compares the paper's three",
        ),
        (
            "experiment=to_the_letter task=discrepancy",
            "optimizer=issa_to_the_letter is not read by task=discrepancy",
        ),
    ],
)
def test_a_setting_that_the_task_ignores_is_refused(overrides, sentence):
    with pytest.raises(UserError, match=f"^{re.escape(sentence)}"):
        check(*overrides.split())


@pytest.mark.parametrize(
    "overrides",
    [
        "task=discrepancy model=third_order_zip model.substeps=4 ++model.fixed.C=0.9"
        " data=tibet_30pct seed=4",
        "task=simulate model/motor=none model.effects=[feeder_impedance] data=tibet_30pct",
        "task=simulate task.parameters=a.json data=tibet_30pct",
        "task=plan data=tibet_30pct model.substeps=2",
        "model.priors=true model.shown_effects=false domain=waves",
        # as the advice repeats a fit's
        "task=discrepancy model.priors=true model.shown_effects=false domain=waves",
        "task=linear_network domain=waves data=tibet_30pct",
        "task=simulate domain=waves data=tibet_30pct",
        "task=generalise domain=waves data=tibet_30pct",
        "task=export tracking.enabled=false",
        "task=compare tracking.experiment=mine",
        "task=benchmark optimizer=pso optimizer.population=9",
        "task=paper budget=300 model.substeps=2 objective=squares",
        "task=generalise optimizer=pso budget=300 target=1e-3 model.per_event=[T_m]",
        "task=identify optimizer=pso optimizer.population=9 objective=huber time_limit=3",
        "task=profile optimizer=pso budget=300",
        "task=posterior optimizer=pso budget=300",
        "optimizer=pso hydra/launcher=dask hydra.launcher.n_jobs=1",
    ],
)
def test_what_the_task_reads_is_not(overrides):
    check(*overrides.split())


@pytest.mark.parametrize("name", sorted(discover()["task"]))
def test_defaults_are_nobodys_choice(name):
    check(f"task={name}")


def test_every_part_that_a_task_reads_is_in_the_configuration():
    config = check("task=identify")
    for task in discover()["task"].values():
        for part in (*task.reads, *task.instead):
            at = config
            for key in part.split("."):
                at = at._get_node(key)
                assert at is not None, (task.name, part)


def test_a_task_that_declares_nothing_reads_everything():
    assert {part.partition(".")[0] for part in Task.reads} == {
        "data",
        "model",
        "objective",
        "optimizer",
        "budget",
        "time_limit",
        "target",
    }


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_shipped_experiment_is_read_by_its_task(name):
    config = check(f"experiment={name}")
    swept = dict.fromkeys(config.hydra.sweeper.params or {}, "swept")
    refuse_unread(discover()["task"][config.task.name], swept)


@pytest.mark.parametrize(
    ("lines", "sentence"),
    [
        ("optimizer:\n  population: 9", "optimizer.population=9 is not read by task=discrepancy"),
        ("budget: 200", "budget=200 is not read by task=discrepancy"),
        (
            "defaults:\n  - override /optimizer: pso\n",
            "optimizer=pso is not read by task=discrepancy",
        ),
    ],
)
def test_an_experiment_that_sets_what_its_task_ignores_is_refused(tmp_path, lines, sentence):
    (tmp_path / "conf" / "experiment").mkdir(parents=True)
    name = tmp_path.name  # of its own, as what an experiment sets is kept by its name
    (tmp_path / "conf" / "experiment" / f"{name}.yaml").write_text(
        f"# @package _global_\n{lines}\n"
    )
    told = ("--config-dir", "conf", f"experiment={name}", "task=discrepancy", "hydra.run.dir=run")
    done = run_command(*told, "tracking.enabled=false", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"tractexp: {sentence}")
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "run").exists()


def test_a_sweep_over_what_its_task_ignores_is_refused_before_its_first_job(tmp_path):
    done = run_command("-m", "task=simulate", "task.depth=0.4", "optimizer=pso,ssa", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == "tractexp: optimizer=pso is not read by task=simulate; leave it out\n"
    assert not [
        path for path in tmp_path.rglob("*") if path.is_file() and path.name != "multirun.yaml"
    ]


def test_a_worker_refuses_what_only_the_settings_of_its_task_make_needless(tmp_path):
    """With a depth no record is played: known once the task is built, which is in the job."""
    sweep = (
        "-m",
        "task=simulate",
        "task.depth=0.4",
        "data=tibet_30pct,tibet_50pct",
        "tracking.enabled=false",
    )
    done = start_command(*sweep, "hydra.launcher.n_jobs=1", cwd=tmp_path)
    assert done.returncode == 2
    assert (
        "data=tibet_30pct is not read by task=simulate; with task.depth no record is played"
        in done.stdout
    )
