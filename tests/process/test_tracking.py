"""What a run leaves in MLflow, read back through MLflow's own public client."""

import base64
import importlib
import json
import logging
import os
import pickle
import re
import signal
import socket
import sqlite3
import subprocess
import sys
import time
import urllib.request
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import free_port, run_command
from traps import lay_traps

from tractexp import tracking
from tractexp.cache import provenance
from tractexp.errors import UserError
from tractexp.tracking import TrackedRun, model, process, runfile
from tractexp.tracking import store as tracking_store
from tractexp.tracking.process import Logger
from tractexp.tracking.run import CURVE_POINTS
from tractexp.tracking.store import raise_sentences
from tractexp.tracking.ui import serve

STEPS = np.arange(300)
FITNESS = np.geomspace(1.0, 1e-5, 300)


def client(uri: str):
    from mlflow import MlflowClient

    return MlflowClient(uri)


def python(script: str, *arguments: str, **more) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", script, *arguments], capture_output=True, text=True, **more
    )


def test_importing_tracking_does_not_import_mlflow():
    script = (
        "import sys, tractexp.tracking.model, tractexp.tracking.ui; print({'mlflow', 'pandas'} &"
        " set(sys.modules))"
    )
    assert python(script, check=True).stdout.strip() == "set()"


def test_a_run_comes_back_as_it_was_logged(tmp_path, uri):
    (tmp_path / "result.json").write_text("{}")
    run = TrackedRun(
        "identify tibet_50pct",
        "issa-s0",
        parameters={"optimizer.population": 50, "T_prime": 0.25, "optimizer.levy": True},
        metrics={"objective": 8.1e-6, "epsilon_p": 0.012},
        curves={"fitness": (STEPS, FITNESS), "fitness_by_simulations": (50 * STEPS, FITNESS)},
        tags={"optimizer": "issa"},
        artifacts=[tmp_path / "result.json"],
        description="A **synthetic** record.",
        seconds=12.5,
    )
    found = client(uri).get_run(tracking.log(run, uri))
    assert found.info.run_name == "issa-s0"
    assert found.info.status == "FINISHED"
    assert found.info.end_time - found.info.start_time == pytest.approx(12_500, abs=1000)
    assert found.data.params == {
        "optimizer.population": "50",
        "T_prime": "0.25",
        "optimizer.levy": "true",
    }
    last = {"fitness": FITNESS[-1], "fitness_by_simulations": FITNESS[-1]}
    assert found.data.metrics == {"objective": 8.1e-6, "epsilon_p": 0.012} | last
    assert found.data.tags["optimizer"] == "issa"
    assert found.data.tags["mlflow.note.content"] == "A **synthetic** record."
    assert "mlflow.parentRunId" not in found.data.tags
    assert client(uri).get_experiment(found.info.experiment_id).name == "identify tibet_50pct"
    assert [a.path for a in client(uri).list_artifacts(found.info.run_id)] == ["result.json"]


def test_what_was_never_reached_is_no_number_of_a_chart(uri):
    metrics = {"search_simulations_to_floor": float("inf"), "objective": 1.0}
    run_id = tracking.log(TrackedRun("e", "r", metrics=metrics), uri)
    assert client(uri).get_run(run_id).data.metrics == {"objective": 1.0}


def test_a_new_experiment_leads_to_the_columns_that_matter_from_any_page_of_mlflows(uri):
    found = client(uri).get_run(tracking.log(TrackedRun("e", "r"), uri))
    experiment = client(uri).get_experiment(found.info.experiment_id)
    address = (
        f"#/experiments/{experiment.experiment_id}/runs"
        "?viewStateShareKey=tractexp&compareRunsMode=TABLE&workflowType=machine_learning"
    )
    assert f"]({address})" in experiment.tags["mlflow.note.content"]
    assert experiment.tags["mlflow.experimentKind"] == "custom_model_development"
    packed = experiment.tags["mlflow.sharedViewState.tractexp"].removeprefix("deflate;")
    columns = json.loads(zlib.decompress(base64.b64decode(packed)))["selectedColumns"]
    assert {"metrics.`search_objective`", "metrics.`model_error`", "metrics.`grade`"} <= set(
        columns
    )


def test_curves_keep_their_steps_and_every_point(uri):
    run_id = tracking.log(
        TrackedRun("e", "r", curves={"fitness_by_simulations": (50 * STEPS, FITNESS)}), uri
    )
    points = client(uri).get_metric_history(run_id, "fitness_by_simulations")
    assert sorted((p.step, p.value) for p in points) == list(
        zip((50 * STEPS).tolist(), FITNESS.tolist(), strict=True)
    )


def test_a_very_long_curve_is_thinned_but_keeps_its_ends(uri):
    n = 15_000
    run_id = tracking.log(
        TrackedRun("e", "r", curves={"fitness": (np.arange(n), np.linspace(1, 0, n))}), uri
    )
    steps = sorted(p.step for p in client(uri).get_metric_history(run_id, "fitness"))
    assert len(steps) == CURVE_POINTS
    assert (steps[0], steps[-1]) == (0, n - 1)


def test_more_than_one_batch_of_everything_arrives(uri):
    parameters = {f"p{i}": i for i in range(250)}
    curves = {f"c{i}": (STEPS, FITNESS) for i in range(7)}
    found = client(uri).get_run(
        tracking.log(TrackedRun("e", "r", parameters=parameters, curves=curves), uri)
    )
    assert found.data.params == {name: str(i) for name, i in parameters.items()}
    for name in curves:
        assert len(client(uri).get_metric_history(found.info.run_id, name)) == 300


def test_children_point_to_their_sweep_which_closes_with_its_status(tmp_path, uri):
    (tmp_path / "table.html").write_text("<p>")
    parent = tracking.start_parent(TrackedRun("e", "issa,pso x 30", parameters={"seeds": 30}), uri)
    assert client(uri).get_run(parent).info.status == "RUNNING"
    child = tracking.log(TrackedRun("e", "issa-s0", parent=parent), uri)
    tracking.finish_parent(parent, uri, "FAILED", {"jobs_failed": 1}, [tmp_path / "table.html"])
    assert client(uri).get_run(child).data.tags["mlflow.parentRunId"] == parent
    closed = client(uri).get_run(parent)
    assert (closed.info.status, closed.data.metrics) == ("FAILED", {"jobs_failed": 1.0})
    assert closed.info.end_time is not None
    assert [a.path for a in client(uri).list_artifacts(parent)] == ["table.html"]


def test_children_are_logged_below_their_run(uri):
    child = tracking.TrackedRun("experiment", "candidate", metrics={"deviance_lowered_by": 12.5})
    run_id = tracking.log(
        tracking.TrackedRun("experiment", "investigation", children=[child, child]), uri
    )
    experiment = client(uri).get_run(run_id).info.experiment_id
    found = client(uri).search_runs([experiment], f"tags.`mlflow.parentRunId` = '{run_id}'")
    assert [r.data.metrics["deviance_lowered_by"] for r in found] == [12.5, 12.5]
    assert all(r.info.status == "FINISHED" for r in found)


def test_a_run_that_cannot_be_written_whole_is_marked_failed(uri):
    with pytest.raises(UserError, match="Names may only contain"):
        tracking.log(TrackedRun("e", "r", metrics={"a*b": 1.0}), uri)
    (found,) = client(uri).search_runs([client(uri).get_experiment_by_name("e").experiment_id])
    assert found.info.status == "FAILED"


def test_experiment_tags_carry_a_shared_view(uri):
    number = tracking.tag_experiment("e", {"mlflow.sharedViewState.tractexp": "deflate;abc"}, uri)
    assert (
        client(uri).get_experiment(number).tags["mlflow.sharedViewState.tractexp"] == "deflate;abc"
    )


def test_artifacts_lie_beside_the_database_wherever_the_process_runs(
    tmp_path, empty_store, monkeypatch
):
    home, elsewhere = tmp_path / "a home", tmp_path / "elsewhere"
    (home / "outputs").mkdir(parents=True)
    (home / "outputs" / "mlflow.db").write_bytes(empty_store.read_bytes())
    elsewhere.mkdir()
    (elsewhere / "note.txt").write_text("hello")
    monkeypatch.chdir(elsewhere)
    run = TrackedRun("identify: tibet/50", "r", artifacts=[Path("note.txt")])
    run_id = tracking.log(run, tracking.find_default_uri(home))
    kept = (
        home / "outputs" / "mlartifacts" / "identify_tibet_50" / run_id / "artifacts" / "note.txt"
    )
    assert kept.read_text() == "hello"
    assert [p.name for p in elsewhere.iterdir()] == ["note.txt"]


def test_processes_that_meet_on_a_fresh_store_all_log_their_run(tmp_path):
    """MLflow's own migrations break when two processes start them together."""
    script = """
import sys; from pathlib import Path; from tractexp import tracking
run = tracking.TrackedRun("sweep", f"job-{sys.argv[2]}", metrics={"x": 1.0})
tracking.log(run, tracking.find_default_uri(Path(sys.argv[1])))"""
    jobs = [
        subprocess.Popen(
            [sys.executable, "-c", script, str(tmp_path), str(i)], stdout=-1, stderr=-1, text=True
        )
        for i in range(2)
    ]
    said = [job.communicate(timeout=120) for job in jobs]
    assert [(job.returncode, *words) for job, words in zip(jobs, said, strict=True)] == [
        (0, "", "")
    ] * 2
    uri = tracking.find_default_uri(tmp_path)
    runs = client(uri).search_runs([client(uri).get_experiment_by_name("sweep").experiment_id])
    assert sorted(run.info.run_name for run in runs) == [f"job-{i}" for i in range(2)]
    assert sorted(p.name for p in (tmp_path / "outputs").iterdir()) == [
        "mlflow.db",
        "mlflow.db.lock",
    ]


def test_the_store_of_a_second_folder_needs_no_migrations_and_is_its_own(tmp_path, monkeypatch):
    monkeypatch.setenv("TRACTEXP_CACHE_DIR", str(tmp_path / "cache"))
    places = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        (default,) = tracking.open_store(tracking.find_default_uri(Path())).search_experiments()
        places.append(default.artifact_location)
        monkeypatch.setattr(tracking_store, "_migrate", None)  # is not called again
    assert [
        str(tmp_path / name) in place for name, place in zip(("one", "two"), places, strict=True)
    ] == [True] * 2


@pytest.mark.skipif(os.name == "nt", reason="forks")
def test_a_creation_that_was_killed_leaves_nothing_that_hinders_the_next(tmp_path, monkeypatch):
    if not (child := os.fork()):
        monkeypatch.setattr(os, "replace", lambda *_: os._exit(9))
        tracking.open_store(tracking.find_default_uri(tmp_path))
        os._exit(1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 9
    assert not (tmp_path / "outputs" / "mlflow.db").exists()
    tracking.open_store(tracking.find_default_uri(tmp_path))
    assert (tmp_path / "outputs" / "mlflow.db").is_file()


def test_flatten_joins_keys_and_spells_values_as_the_configuration_does():
    config = {
        "optimizer": {"name": "issa", "levy": {"beta": 1.5, "on": True}},
        "seed": 0,
        "budget": None,
        "train": ["a.csv", 1],
        "bounds": np.array([0.0, 1.0]),
        "share": np.float64(0.2),
        "folder": Path("a"),
    }
    assert tracking.flatten(config) == {
        "optimizer.name": "issa",
        "optimizer.levy.beta": "1.5",
        "optimizer.levy.on": "true",
        "seed": "0",
        "budget": "null",
        "train": '["a.csv", 1]',
        "bounds": "[0.0, 1.0]",
        "share": "0.2",
        "folder": "a",
    }


def test_a_name_of_a_metric_is_one_that_mlflow_takes(uri):
    names = [
        tracking.name_metric(f"median {name}")
        for name in ("issa levy=false", "a*b (c)", "issa bounds.C=[0.5]")
    ]
    assert names == ["median issa levy:false", "median a_b _c_", "median issa bounds.C:_0.5_"]
    run_id = tracking.log(TrackedRun("e", "r", metrics=dict.fromkeys(names, 1.0)), uri)
    assert set(client(uri).get_run(run_id).data.metrics) == set(names)


def test_curves_of_runs_meet_at_common_steps():
    """MLflow averages step by step; a curve holds what was reached by a step, and its end."""
    ends = []
    for first, every, total in ((50, 103, 30_000), (50, 98, 30_500), (9, 9, 40)):
        steps = np.arange(first, total, every, dtype=float)
        values = 1 / steps
        x, y = tracking.resample_to_common_steps(steps, values)
        assert x[0] >= first
        assert x[-1] >= steps[-1]
        assert y[-1] == values[-1]
        assert all(value == values[steps <= step].min() for step, value in zip(x, y, strict=True))
        ends.append(x)
    assert len(set(ends[0]) & set(ends[1])) >= len(ends[0]) - 1 > 100


def test_the_commit_is_that_of_the_folder_and_says_when_files_were_changed(tmp_path):
    assert provenance.find_commit(tmp_path / "nowhere") == ""
    if provenance.find_commit(tmp_path):
        pytest.skip("the temporary folder lies inside a repository")

    def git(*arguments: str) -> str:
        who = ["-c", "user.name=n", "-c", "user.email=e@x", "-c", "commit.gpgsign=false"]
        done = subprocess.run(
            ["git", *who, *arguments], cwd=tmp_path, capture_output=True, text=True, check=True
        )
        return done.stdout.strip()

    git("init", "-q")
    (tmp_path / "a").write_text("1")
    git("add", "a")
    git("commit", "-q", "-m", "first")
    git("tag", "-a", "v1", "-m", "a tag must not hide the commit")
    commit = git("rev-parse", "HEAD")
    provenance.find_commit.cache_clear()
    assert provenance.find_commit(tmp_path) == commit
    (tmp_path / "a").write_text("2")
    provenance.find_commit.cache_clear()
    assert provenance.find_commit(tmp_path) == f"{commit}-dirty"


def test_what_a_run_has_read_is_listed_by_its_digest(uri):
    record = {"name": "dip1", "role": "train", "sha256": "ab" * 32}
    run_id = tracking.log(tracking.TrackedRun("inputs", "one", records=[record]), uri)
    (given,) = client(uri).get_run(run_id).inputs.dataset_inputs
    assert given.dataset.name == "dip1"
    assert given.dataset.digest == record["sha256"][:36]
    assert json.loads(given.dataset.source) == {"sha256": record["sha256"]}
    assert [tag.value for tag in given.tags] == ["train"]


@pytest.mark.parametrize(
    ("run", "message"),
    [
        (TrackedRun("", "r"), "needs experiment"),
        (TrackedRun("e", " "), "needs name"),
        (TrackedRun("e", "r", status="DONE"), "status=DONE is not one of FINISHED, FAILED, KILLED"),
        (
            TrackedRun("e", "r", artifacts=[Path("gone.json")]),
            "gone.json of run 'r' does not exist",
        ),
        (TrackedRun("e", "r", curves={"c": ([1, 2], [1.0])}), "'c' has 2 steps and 1 values"),
    ],
)
def test_a_run_that_is_not_right_is_refused_before_a_store_is_made(tmp_path, run, message):
    with pytest.raises(UserError, match=message):
        tracking.log(run, tracking.find_default_uri(tmp_path))
    assert not list(tmp_path.iterdir())


def test_a_store_that_cannot_be_used_is_named_with_the_reason(tmp_path, empty_store):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(
        UserError, match=r"file/outputs/mlflow\.db cannot be used: .*File exists|Not a directory"
    ):
        tracking.open_store(tracking.find_default_uri(tmp_path / "file"))
    (tmp_path / "junk.db").write_bytes(b"not a database " * 100)
    with pytest.raises(UserError, match=r"junk\.db cannot be used: .*not a database"):
        tracking.open_store(f"sqlite:///{tmp_path / 'junk.db'}")
    (tmp_path / "folder.db").mkdir()
    with pytest.raises(UserError, match=r"folder\.db cannot be used: .*unable to open"):
        tracking.open_store(f"sqlite:///{tmp_path / 'folder.db'}")
    with pytest.raises(UserError, match="address of the MLflow store is empty"):
        tracking.open_store(" ")
    with pytest.raises(UserError, match="foo://x cannot be used"):
        tracking.open_store("foo://x")


def test_what_mlflow_logs_of_an_error_is_not_shown_but_told_in_the_sentence(monkeypatch):
    """It logs a traceback of each error of the database, and raises it as well."""
    logger, said = logging.getLogger("mlflow.store.db.utils"), []
    # the migration of a store in this process disables all there are
    monkeypatch.setattr(logger, "disabled", False)
    handler = logging.Handler()
    handler.emit = lambda record: said.append(record.getMessage())
    logger.addHandler(handler)

    def fails():
        with raise_sentences("here"):
            logger.error("a traceback")
            raise OSError("disk is full")

    try:
        with pytest.raises(UserError, match="the MLflow store here cannot be used: disk is full"):
            fails()
        assert said == []
        logger.error("heard")
        assert said == ["heard"]
    finally:
        logger.removeHandler(handler)


def test_a_relative_address_counts_from_the_folder_where_the_command_runs(tmp_path, empty_store):
    (tmp_path / "x.db").write_bytes(empty_store.read_bytes())
    values = "T_prime: 0.05, X_prime: 0.2, C: 0.9, M: 0.01, T_m: 0.5, p_v: 1.5, q_v: 2.5"
    asked = (
        "task=simulate",
        f"task.values={{{values}}}",
        "task.depth=0.4",
        "tracking.uri=sqlite:///x.db",
    )
    done = run_command(*asked, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "to see it: tractexp ui --uri sqlite:///x.db" in done.stdout
    reader = client(f"sqlite:///{tmp_path / 'x.db'}")
    (logged,) = reader.search_runs([e.experiment_id for e in reader.search_experiments()])
    assert logged.info.artifact_uri.startswith((tmp_path / "mlartifacts").as_uri())
    assert {path.name for path in (tmp_path / "mlartifacts").rglob("response.*")} == {
        "response.csv",
        "response.svg",
    }


def test_addresses_are_absolute_and_the_default_is_below_outputs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert (
        tracking.resolve_address("sqlite:///runs/x.db")
        == f"sqlite:///{tmp_path.as_posix()}/runs/x.db"
    )
    assert tracking.resolve_address(None) == tracking.find_default_uri(tmp_path)
    for given in (tracking.find_default_uri(tmp_path), "http://host:5000"):
        assert tracking.resolve_address(given) == given


def test_the_store_of_mlflows_own_variable_is_used_unless_another_is_chosen(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "sqlite:///team.db")
    assert tracking.resolve_address(None) == f"sqlite:///{tmp_path.as_posix()}/team.db"
    assert tracking.resolve_address("sqlite:///x.db") == f"sqlite:///{tmp_path.as_posix()}/x.db"
    monkeypatch.setenv("MLFLOW_TRACKING_URI", " ")
    assert tracking.resolve_address(None) == tracking.find_default_uri(tmp_path)


def test_a_server_that_does_not_answer_is_reported_at_once():
    with socket.socket() as taken:  # bound but not listening: connections are refused
        taken.bind(("127.0.0.1", 0))
        address = f"http://127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(UserError, match=rf"{address} cannot be used: .*refused"):
            tracking.open_store(address)


def test_the_store_of_another_version_of_mlflow_is_refused_with_the_remedy(tmp_path, empty_store):
    database = tmp_path / "newer.db"
    database.write_bytes(empty_store.read_bytes())
    connection = sqlite3.connect(database)
    connection.execute("UPDATE alembic_version SET version_num = 'ffff00000000'")
    connection.commit()
    connection.close()
    with pytest.raises(
        UserError, match=r"another version of MLflow: 'mlflow db upgrade sqlite:.*newer\.db'"
    ):
        tracking.open_store(f"sqlite:///{database}")


def test_the_signature_of_the_model_is_what_mlflow_itself_writes(tmp_path, uri):
    from mlflow.models import Model, ModelSignature
    from mlflow.types import ColSpec, DataType, Schema

    (tmp_path / "result.json").write_text("{}")
    run_id = tracking.log(TrackedRun("e", "r", model=tmp_path / "result.json"), uri)
    (logged,) = client(uri).search_logged_models([client(uri).get_run(run_id).info.experiment_id])
    there = Path(logged.artifact_location.removeprefix("file://"))
    columns = [ColSpec(DataType.double, name, required=name != "f") for name in "tUf"]
    signature = ModelSignature(
        Schema(columns), Schema([ColSpec(DataType.double, name) for name in "PQ"])
    )
    assert Model.load(str(there)).signature == signature
    assert signature.to_dict() == model.SIGNATURE


def test_the_page_of_the_model_has_its_metrics_its_structure_and_its_record(tmp_path, uri):
    (tmp_path / "result.json").write_text("{}")
    record = {"name": "dip1", "role": "train", "sha256": "ab" * 32}
    held_out = {"name": "dip2", "role": "validate", "sha256": "cd" * 32}
    run = TrackedRun(
        "e",
        "r",
        parameters={"model.motor.name": "electromechanical", "optimizer.name": "pso"},
        metrics={"grade": 2.0, "T_prime": 0.12, "search_T_prime": 0.4},
        curves={"fitness": (STEPS, FITNESS)},
        records=[record, held_out],
        description="**adequate**",
        model=tmp_path / "result.json",
        model_metrics=["grade", "T_prime"],
    )
    run_id = tracking.log(run, uri)
    found = client(uri).get_run(run_id)
    assert found.data.metrics["search_T_prime"] == 0.4
    (logged,) = client(uri).search_logged_models([found.info.experiment_id])
    assert logged.params == {"model.motor.name": "electromechanical"}
    assert logged.tags["mlflow.note.content"] == "**adequate**"
    assert {metric.key: metric.value for metric in logged.metrics} == {
        "grade": 2.0,
        "T_prime": 0.12,
    }
    assert {metric.dataset_name for metric in logged.metrics} == {"dip1"}
    assert {metric.dataset_digest for metric in logged.metrics} == {record["sha256"][:36]}
    both = tracking.log(replace(run, records=[record, held_out | {"role": "train"}]), uri)
    (logged,) = client(uri).search_logged_models(
        [found.info.experiment_id], f"source_run_id = '{both}'"
    )
    assert {metric.dataset_name for metric in logged.metrics} == {None}, "of both together"


def test_a_file_of_an_earlier_version_names_no_metrics_of_the_model(tmp_path):
    runfile.save(tmp_path, TrackedRun("e", "r", metrics={"grade": 2.0}), "sqlite:///x.db")
    content = json.loads((tmp_path / runfile.FILE).read_text())
    del content["run"]["model_metrics"]
    (tmp_path / runfile.FILE).write_text(json.dumps(content))
    assert runfile.read(tmp_path).run.model_metrics == []
    content["run"]["model_metrics"] = [3]
    (tmp_path / runfile.FILE).write_text(json.dumps(content))
    with pytest.raises(UserError, match=r"is damaged .its model_metrics hold what they cannot"):
        runfile.read(tmp_path)


def test_an_experiment_that_was_deleted_is_reported_with_the_way_back(uri):
    number = client(uri).create_experiment("gone")
    client(uri).delete_experiment(number)
    with pytest.raises(UserError, match=f"'gone' .*restore --experiment-id {number}'"):
        tracking.log(TrackedRun("gone", "r"), uri)


STAND_IN = '''
import json, sys, types
class Model:
    """Stands in for the identified model: P is a share of U, Q follows the frequency where \
it is known."""
    def __init__(self, path): self.share = json.loads(path.read_text())["share"]
    def predict(self, t, U, f=None): return self.share * U, (U if f is None else f / 50.0)
stand_in = types.ModuleType("tractexp.identification.result")
stand_in.load = Model
sys.modules["tractexp.identification.result"] = stand_in
import mlflow, pandas as pd
mlflow.set_tracking_uri(sys.argv[1])
for address in sys.argv[2:]:
    model = mlflow.pyfunc.load_model(address)
    frame = pd.DataFrame({"t": [0.0, 0.1], "U": [1.0, 0.5]}, index=[7, 8])
    plain, driven = model.predict(frame), model.predict(frame.assign(f=[50.0, 49.0]))
    print(json.dumps([list(plain.columns), list(plain.index), plain.values.tolist(), \
driven.Q.tolist()]))
    try:
        model.predict(frame[["t"]])
    except Exception as error:
        print("U" in str(error))
'''


@pytest.mark.long
def test_the_model_predicts_in_another_process_by_either_address(tmp_path, uri):
    (tmp_path / "result.json").write_text('{"share": 0.8}')
    run_id = tracking.log(TrackedRun("e", "r", model=tmp_path / "result.json"), uri)
    (logged,) = client(uri).search_logged_models([client(uri).get_run(run_id).info.experiment_id])
    assert logged.status.value == "READY"
    assert logged.source_run_id == run_id
    (tmp_path / "result.json").unlink()
    done = python(STAND_IN, uri, f"runs:/{run_id}/model", f"models:/{logged.model_id}")
    assert done.returncode == 0, done.stderr
    told = done.stdout.splitlines()
    assert len(told) == 4
    for answer, refused in (told[:2], told[2:]):
        assert json.loads(answer) == [["P", "Q"], [7, 8], [[0.8, 1.0], [0.4, 0.5]], [1.0, 0.98]]
        assert refused == "True"


def answers(address: str) -> bool:
    try:
        with urllib.request.urlopen(address, timeout=5) as answer:
            return answer.status == 200
    except OSError:
        return False


def refused(address: str, headers: dict) -> int:
    """The status of a request that would make an experiment without a name, which is itself refused
    as 400.
    """
    request = urllib.request.Request(
        address, b"{}", {"Content-Type": "application/json", **headers}
    )
    try:
        with urllib.request.urlopen(request, timeout=20) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


def reflected(address: str, headers: dict) -> str | None:
    """The origin that an answer lets read it, whether the page asks for leave first or reads at
    once.
    """
    for method in ("OPTIONS", "GET"):
        more = {"Access-Control-Request-Method": "POST"} if method == "OPTIONS" else {}
        request = urllib.request.Request(address, headers=headers | more, method=method)
        try:
            with urllib.request.urlopen(request, timeout=20) as answer:
                origin = answer.headers.get("Access-Control-Allow-Origin")
        except urllib.error.HTTPError as error:
            origin = error.headers.get("Access-Control-Allow-Origin")
        if origin:
            return origin
    return None


FOREIGN = [
    ({}, 400),
    ({"Host": "evil.example"}, 403),  # a name that was made to lead here
    ({"Host": "192.168.1.7"}, 403),
    ({"Origin": "https://evil.example"}, 403),  # a page from elsewhere, in the same browser
    ({"Origin": "null"}, 403),
    ({"Origin": "http://localhost:1"}, 403),  # a page of another server on this computer
    ({"Origin": "http://127.0.0.1"}, 403),
    ({"Origin": "http://[::1]:PORT"}, 403),
    ({"Origin": "https://localhost:PORT"}, 403),
    ({"Origin": "http://localhost:PORT"}, 400),  # its own
    ({"Origin": "http://127.0.0.1:PORT"}, 400),
]


@pytest.mark.skipif(os.name == "nt", reason="ends the server by a signal")
def test_the_ui_answers_on_loopback_imports_nothing_from_here_and_leaves_nothing_behind(
    tmp_path, uri
):
    (tmp_path / "note.txt").write_text("hello")
    run_id = tracking.log(TrackedRun("e", "r", artifacts=[tmp_path / "note.txt"]), uri)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    lay_traps(elsewhere)
    there = sorted(elsewhere.iterdir())
    port = free_port()
    program = str(Path(sys.executable).with_name("tractexp"))
    ui = subprocess.Popen(
        [program, "ui", "--uri", uri, "--port", str(port)],
        stdout=-1,
        stderr=-1,
        text=True,
        cwd=elsewhere,
        env=os.environ
        | {"MLFLOW_SERVER_ALLOWED_HOSTS": "*", "MLFLOW_SERVER_DISABLE_SECURITY_MIDDLEWARE": "true"},
    )
    try:
        said = ui.stdout.readline()
        assert said.startswith(f"starting the MLflow UI on port {port}, which takes about")
        assert "http" not in said, "MLflow's plain address opens a page on language models"
        assert f"it shows {uri}" in said
        assert re.match(rf"ready after \d+ s: http://127\.0\.0\.1:{port}/", ui.stdout.readline())
        assert answers(f"http://127.0.0.1:{port}/")
        assert answers(f"http://127.0.0.1:{port}/health")
        artifact = f"http://127.0.0.1:{port}/get-artifact?path=note.txt&run_uuid={run_id}"
        with urllib.request.urlopen(artifact, timeout=20) as answer:
            assert answer.read() == b"hello"
        for headers, status in FOREIGN:
            headers = {name: value.replace("PORT", str(port)) for name, value in headers.items()}
            if status == 403:
                assert (
                    reflected(
                        f"http://127.0.0.1:{port}/ajax-api/2.0/mlflow/experiments/search", headers
                    )
                    is None
                )
            assert (
                refused(f"http://127.0.0.1:{port}/api/2.0/mlflow/experiments/create", headers)
                == status
            ), headers
        with pytest.raises(UserError, match=f"port {port} on 127.0.0.1 cannot be used"):
            serve(uri, port=port)
    finally:
        ui.send_signal(signal.SIGTERM)
        said = ui.communicate(timeout=30)
    assert (ui.returncode, *said) == (0, "", "")
    deadline = time.monotonic() + 10
    while answers(f"http://127.0.0.1:{port}/health"):
        assert time.monotonic() < deadline, "the server outlived the command"
        time.sleep(0.1)
    assert sorted(elsewhere.iterdir()) == there


def test_the_ui_says_why_it_cannot_open(tmp_path, uri):
    with pytest.raises(UserError, match=r"no MLflow store .*mlflow\.db yet: the first run"):
        serve(tracking.find_default_uri(tmp_path / "new"))
    with pytest.raises(UserError, match=r"port 70000 on 127\.0\.0\.1 cannot be used"):
        serve(uri, port=70_000)
    with pytest.raises(UserError, match="is a running MLflow server already"):
        serve("http://127.0.0.1:5000")


def test_a_second_process_logs_as_this_one_would(tmp_path, uri):
    (tmp_path / "result.json").write_text("{}")
    run = TrackedRun(
        "e", "r", curves={"fitness": (STEPS, FITNESS)}, artifacts=[tmp_path / "result.json"]
    )
    with Logger(uri) as logger:
        found = client(uri).get_run(logger.log(run))
    assert (found.info.status, found.data.metrics) == ("FINISHED", {"fitness": FITNESS[-1]})
    assert [a.path for a in client(uri).list_artifacts(found.info.run_id)] == ["result.json"]


def test_a_second_process_that_is_given_no_run_ends_without_one(uri):
    with pytest.raises(ZeroDivisionError), Logger(uri) as logger:
        raise ZeroDivisionError
    assert logger._process.returncode == 0
    assert [e.name for e in client(uri).search_experiments()] == ["Default"]


def test_a_process_that_is_told_of_no_store_makes_none_and_is_not_waited_for(tmp_path):
    started = time.monotonic()
    with Logger() as logger:
        pass
    assert logger._process.returncode == -signal.SIGKILL
    assert time.monotonic() - started < 1.0  # MLflow alone takes longer
    assert not list(tmp_path.iterdir())


def test_the_process_that_was_started_ahead_is_the_one_that_logs(uri):
    process.start_ahead()
    (ahead,) = process._ahead
    with process.open_logger(uri) as taken, process.open_logger(uri) as another:
        assert taken is ahead is not another
        assert client(uri).get_run(taken.log(TrackedRun("e", "r"))).info.status == "FINISHED"


@pytest.mark.skipif(os.name == "nt", reason="asks for a process by a signal")
@pytest.mark.parametrize("told", ["", "process.open_logger(sys.argv[1]); "])
def test_a_command_that_logs_nothing_waits_for_nothing_and_leaves_no_word(told, uri, tmp_path):
    program = (
        "import sys, time; from tractexp.tracking import process; process.start_ahead();"
        f"(ahead,) = process._ahead; {told}print(ahead._process.pid, time.time(), flush=True)"
    )
    with (tmp_path / "said.txt").open("w+") as said:
        done = subprocess.Popen(
            [sys.executable, "-c", program, uri], stdout=-1, stderr=said, text=True
        )
        pid, ended = done.stdout.readline().split()
        assert done.wait(30) == 0
        assert time.time() - float(ended) < 1.0  # MLflow alone takes longer
        done.stdout.close()
        deadline = time.monotonic() + 60
        while alive(int(pid)):
            assert time.monotonic() < deadline, "the process outlives the command"
            time.sleep(0.1)
        said.seek(0)
        assert said.read() == ""


def alive(pid):
    """Whether a process that is not our child still runs."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    state = Path(f"/proc/{pid}/stat")
    return not (state.exists() and state.read_text().rpartition(")")[2].split()[0] == "Z")


def test_to_start_the_process_imports_nothing_that_takes_time():
    program = (
        "import sys; import tractexp.tracking.process;"
        "heavy = {'mlflow', 'numpy', 'pandas', 'sqlalchemy', 'hydra'} & sys.modules.keys(); assert"
        " not heavy, heavy"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_the_process_that_logs_imports_nothing_that_mlflow_does_without(uri):
    program = (
        "import sys; from tractexp.tracking import process;"
        "process.log = lambda run, uri: [name for name, module in sys.modules.items() if module];"
        " process.main()"
    )
    told = pickle.dumps(uri) + pickle.dumps(TrackedRun("e", "r"))
    done = subprocess.run([sys.executable, "-c", program], input=told, capture_output=True)
    modules, problem = pickle.loads(done.stdout)
    assert not problem
    assert {"mlflow.models", "mlflow.store.tracking.sqlalchemy_store"} <= {*modules}
    assert not {name.partition(".")[0] for name in modules} & {*process.OPTIONAL}


def test_a_package_is_absent_within_and_there_again_afterwards(monkeypatch):
    monkeypatch.delitem(sys.modules, "colorsys", raising=False)
    with process.hide_packages(["colorsys", "pickle"]):
        with pytest.raises(ImportError):
            importlib.import_module("colorsys")
        assert importlib.import_module("pickle") is pickle  # it was there before
    assert importlib.import_module("colorsys").rgb_to_hsv


def test_a_second_process_passes_its_sentence_on(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with (
        Logger(tracking.find_default_uri(tmp_path / "file")) as logger,
        pytest.raises(UserError, match=r"outputs/mlflow\.db cannot be used"),
    ):
        logger.log(TrackedRun("e", "r"))
