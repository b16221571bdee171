"""Nothing is lost: by a kill, by a signal, by a store that is away, locked, cut short or of another version."""

import contextlib
import json
import os
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from tractexp import tracking
from tractexp.errors import UserError
from tractexp.tracking import TrackedRun, owner
from tractexp.tracking.runfile import FILE, read, save
from tractexp.tracking.store import open_store
from tractexp.tracking.sync import BROUGHT, DELETED, NOT, THERE, sync

VALUES = "T_prime: 0.05, X_prime: 0.2, C: 0.9, M: 0.01, T_m: 0.5, p_v: 1.5, q_v: 2.5"
SIMULATE = ("task=simulate", f"task.values={{{VALUES}}}", "task.depth=0.4", "task.rate=200", "hydra.run.dir=run")


def tractexp(*arguments, cwd, **more):
    command = [sys.executable, "-m", "tractexp", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, **more)


def run(name="one", **more) -> TrackedRun:
    curve = (np.arange(1, 4), np.array([3.0, 2.0, 1.0]))
    return TrackedRun("e", name, parameters={"a": 1}, metrics={"x": 1.5}, curves={"fitness": curve}, **more)


def runs(uri: str, **more):
    client = open_store(uri)
    return client.search_runs([e.experiment_id for e in client.search_experiments()], **more)


# Runs whose writer is gone

WRITER = """
import os, sys
from tractexp import tracking
from tractexp.tracking import run
def stops(*_, **__):
    print("in the middle", flush=True)
    os.kill(os.getpid(), 9)
run._write = stops
tracking.log(tracking.TrackedRun("e", "killed"), sys.argv[1])"""


def test_a_run_whose_writer_was_killed_is_closed_when_the_store_is_opened_next(uri):
    done = subprocess.run([sys.executable, "-c", WRITER, uri], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (-signal.SIGKILL, "in the middle\n")
    with sqlite3.connect(uri.removeprefix("sqlite:///")) as store:
        assert store.execute("select status from runs").fetchall() == [("RUNNING",)]
    open_store.cache_clear()
    (found,) = runs(uri)
    assert (found.info.status, found.data.tags["mlflow.runName"]) == ("KILLED", "killed")


def test_a_run_whose_writer_lives_or_cannot_be_seen_is_left(uri):
    client = open_store(uri)
    parent = tracking.start_parent(TrackedRun("e", "a sweep that runs"), uri)
    far = tracking.start_parent(TrackedRun("e", "on another computer"), uri)
    client.set_tag(far, owner.TAG, "elsewhere/0123 boot pid:[1] 4711 99")
    assert owner.close_stale(client) == []
    client.set_tag(parent, owner.TAG, owner.signature().rpartition(" ")[0] + " 17")  # this number, an earlier process
    assert owner.close_stale(client) == [parent]
    assert {r.info.run_id: r.info.status for r in runs(uri)} == {parent: "KILLED", far: "RUNNING"}


@pytest.mark.parametrize(
    ("told", "gone"),
    [("", None), ("a b c", None), ("elsewhere/1 boot ns 1 1", None), ("HERE other ns 1 1", True),
     ("HERE BOOT other 1 1", None), ("HERE BOOT NS 99999999 1", True), ("HERE BOOT NS x 1", None)],
)  # fmt: skip
def test_whether_a_process_has_ended_is_told_only_where_it_is_known(told, gone):
    for word, known in zip(("HERE", "BOOT", "NS"), owner._machine(), strict=True):
        told = told.replace(word, known)
    assert owner.gone(told) is gone
    assert owner.gone(owner.signature()) is False


# What is kept beside the results, and brought in


def test_what_is_kept_is_the_run_again_wherever_the_folder_is(tmp_path):
    folder = tmp_path / "before"
    folder.mkdir()
    (folder / "result.json").write_text("{}")
    child = TrackedRun("e", "child", metrics={"y": float("inf")})
    told = run(artifacts=[folder / "result.json", tmp_path], model=folder / "result.json", children=[child])
    kept = save(folder, told, "sqlite:////x.db")
    after = folder.rename(tmp_path / "after")
    back = read(after)
    assert back.run.artifacts == [after / "result.json", tmp_path]
    assert back.run.model == after / "result.json"
    assert back.run.curves["fitness"] == ([1.0, 2.0, 3.0], [3.0, 2.0, 1.0])
    assert (back.run.key, back.run.metrics, back.run_id) == (kept.run.key, {"x": 1.5}, "")
    assert back.run.children[0].metrics == {"y": float("inf")}
    (after / FILE).write_text('{"uri": "sqlite')
    with pytest.raises(UserError, match=r"mlflow\.json is damaged"):
        read(after)


def test_runs_that_wait_are_brought_in_once_under_the_run_of_their_sweep(tmp_path, uri):
    sweep = tmp_path / "sweep"
    ended = time.time() - 86_400
    save(sweep, TrackedRun("e", "the sweep", ended=ended), uri, sweep=True)
    (sweep / "sweep.json").write_text('{"run": null}')
    for k in range(2):
        save(sweep / str(k), run(f"job {k}", ended=ended, seconds=2.0, children=[run("below")]), uri)
    assert sync(tmp_path) == {BROUGHT: 3}
    assert sync(tmp_path) == {THERE: 3}
    found = {r.info.run_name: r for r in runs(uri)}
    parent = found["the sweep"]
    assert json.loads((sweep / "sweep.json").read_text())["run"] == parent.info.run_id
    assert parent.info.status == "FINISHED"
    for k in range(2):
        job = found[f"job {k}"]
        assert job.data.tags["mlflow.parentRunId"] == parent.info.run_id
        assert abs(job.info.end_time / 1000 - ended) < 1.0  # when it ended, not when it was brought in
        assert (job.info.status, job.data.metrics) == ("FINISHED", {"x": 1.5, "fitness": 1.0})
    assert len(runs(uri)) == 5


def test_what_an_attempt_left_half_done_goes_when_the_run_is_brought_in(tmp_path, uri):
    one = save(tmp_path / "job", run(), uri)
    half = tracking.start_parent(TrackedRun("e", "half", key=one.run.key), uri)
    tracking.log(TrackedRun("e", "its child", parent=half), uri)
    assert sync(tmp_path) == {BROUGHT: 1}
    assert [r.info.run_name for r in runs(uri)] == ["one"]
    whole = read(tmp_path / "job")
    save(tmp_path / "job", whole.run, uri)  # as where the process was killed after the store had it
    assert sync(tmp_path) == {BROUGHT: 1}
    assert [r.info.run_id for r in runs(uri)] == [whole.run_id]


def test_a_run_deleted_in_mlflow_stays_so_and_a_damaged_file_hides_no_other(tmp_path, uri):
    for name in ("a", "b"):
        save(tmp_path / name, run(name), uri)
    sync(tmp_path)
    open_store(uri).delete_run(read(tmp_path / "a").run_id)
    (tmp_path / "0").mkdir()
    (tmp_path / "0" / FILE).write_text("{")
    told = []
    assert sync(tmp_path, tell=told.append) == {NOT: 1, DELETED: 1, THERE: 1}
    assert len(told) == 1


def test_a_store_that_is_away_is_asked_once_and_named_once(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"http://127.0.0.1:{taken.getsockname()[1]}"
        for k in range(3):
            save(tmp_path / str(k), run(), address)
        told = []
        assert sync(tmp_path, tell=told.append) == {NOT: 3}
    assert len(told) == 1
    assert "refused" in told[0]


@pytest.mark.parametrize(("harm", "reason"), [("locked", "database is locked"), ("torn", "malformed")])
def test_a_store_that_is_locked_or_torn_is_told_before_mlflow_tries_for_minutes(harm, reason, uri, monkeypatch):
    import mlflow

    from tractexp.tracking import store

    monkeypatch.setattr(store, "PATIENCE", 0.1)
    monkeypatch.setattr(mlflow, "MlflowClient", None)  # not reached
    database = Path(uri.removeprefix("sqlite:///"))
    other = sqlite3.connect(database)
    if harm == "torn":
        content = bytearray(database.read_bytes())
        content[100:3000] = bytes(range(1, 201)) * 14 + bytes(100)
        database.write_bytes(content)
    else:
        other.execute("BEGIN EXCLUSIVE")
    with contextlib.closing(other), pytest.raises(UserError, match=f"cannot be used: .*{reason}"):
        tracking.prepare(uri)


# Commands


@pytest.fixture(scope="module")
def away(tmp_path_factory):
    """A run that was to be logged on a server that is away."""
    folder = tmp_path_factory.mktemp("away")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"http://127.0.0.1:{taken.getsockname()[1]}"
        done = tractexp(*SIMULATE, f"tracking.uri={address}", cwd=folder)
    return folder, done


def test_a_run_whose_store_is_away_ends_well_and_says_where_its_results_are(away):
    folder, done = away
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert "not logged: the MLflow store http://127.0.0.1" in done.stdout
    assert "'tractexp sync' logs them when that is mended" in " ".join(done.stdout.split())
    assert (folder / "run" / "response.csv").is_file()
    assert read(folder / "run").run_id == ""


def test_sync_brings_it_in_elsewhere(away, tmp_path, uri, capsys):
    from tractexp.cli.sync import sync as command

    shutil.copytree(away[0] / "run", tmp_path / "run")
    assert command([str(tmp_path), "--uri", uri]) == 0
    assert capsys.readouterr().out.strip() == f"runs in {tmp_path}: 1 brought in"
    (found,) = runs(uri)
    assert found.info.run_name == "simulation"
    assert [a.path for a in open_store(uri).list_artifacts(found.info.run_id)] == [
        ".hydra",
        "response.csv",
        "response.svg",
    ]
    with pytest.raises(UserError, match="there is no folder"):
        command([str(tmp_path / "nowhere")])


def doctor(folder, *arguments, capsys):
    from tractexp.cli import doctor as module

    code = module.doctor([str(folder), *arguments])
    return code, " ".join(capsys.readouterr().out.split())


def test_the_doctor_closes_stale_runs_sets_a_damaged_store_aside_and_makes_it_anew(tmp_path, uri, capsys, monkeypatch):
    monkeypatch.setattr(owner, "closed", [])  # of this process, whose other tests close runs, too
    save(tmp_path / "outputs" / "job", run(), uri)
    sync(tmp_path)
    database = Path(uri.removeprefix("sqlite:///"))
    stale = tracking.start_parent(TrackedRun("e", "stale"), uri)
    open_store(uri).set_tag(stale, owner.TAG, owner.signature().rpartition(" ")[0] + " 17")
    code, told = doctor(tmp_path, "--uri", uri, capsys=capsys)
    assert code == 0, told
    assert "healed 1 runs whose process had ended are closed as KILLED" in told
    assert "WRONG" not in told
    assert "1 already there" in told
    database.write_bytes(database.read_bytes()[:100_000])  # cut short, as by a full disk
    done = tractexp("doctor", str(tmp_path), "--uri", uri, cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"healed  the MLflow store {database} is damaged (" in done.stdout
    assert "1 brought in" in done.stdout
    assert len(list(database.parent.glob("mlflow.db.damaged-*"))) == 1
    with sqlite3.connect(database) as store:
        assert store.execute("select name, status from runs").fetchall() == [("one", "FINISHED")]


def test_the_doctor_says_what_it_cannot_heal(tmp_path, uri, capsys, monkeypatch):
    from tractexp.cli import doctor as module

    monkeypatch.setattr(module, "cores", lambda: iter(()))
    monkeypatch.setattr(module, "BUSY", 0.1)
    far = tracking.start_parent(TrackedRun("e", "far"), uri)
    open_store(uri).set_tag(far, owner.TAG, "elsewhere/0123 boot pid:[1] 4711 99")
    code, told = doctor(tmp_path / "none", "--uri", uri, capsys=capsys)
    assert code == 2
    assert "WRONG run 'far'" in told
    assert "running on elsewhere, which cannot be told from here" in told
    database = uri.removeprefix("sqlite:///")
    with contextlib.closing(sqlite3.connect(database)) as other:
        other.execute("BEGIN EXCLUSIVE")
        code, told = doctor(tmp_path / "none", "--uri", uri, capsys=capsys)
    assert code == 2
    assert "is locked by another process" in told
    shutil.copy(database, tmp_path / "newer.db")
    with contextlib.closing(sqlite3.connect(tmp_path / "newer.db")) as newer:
        newer.execute("UPDATE alembic_version SET version_num = 'ffff00000000'")
        newer.commit()
    code, told = doctor(tmp_path / "none", "--uri", f"sqlite:///{tmp_path / 'newer.db'}", capsys=capsys)
    assert code == 2
    assert "comes from another version of MLflow" in told


# Signals


@pytest.mark.skipif(os.name == "nt", reason="ends a run by a signal")
@pytest.mark.parametrize(("way", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_search_that_is_ended_keeps_what_it_found_and_says_so(way, code, tmp_path):
    command = [sys.executable, "-m", "tractexp", "optimizer=pso", "optimizer.iterations=10000000", "hydra.run.dir=run"]
    job = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(way, signal.SIG_DFL),
    )  # fmt: skip
    said = ""
    while "optimizer: pso" not in said:
        line = job.stdout.readline()
        assert line, job.stderr.read()
        said += line
    time.sleep(2.5)
    job.send_signal(way)
    _, err = job.communicate(timeout=60)
    assert job.returncode == code, err
    assert err.count("\n") == 1, err
    assert err.startswith(f"tractexp: {'ended by SIGTERM' if code == 143 else 'interrupted'}; the best of ")
    from tractexp.identification.result import load

    kept = load(tmp_path / "run" / "interrupted.json")
    assert kept.simulations > 0
    assert "was stopped after" in kept.status
    assert not (tmp_path / "run" / "result.json").exists()
    assert len((tmp_path / "run" / "history.csv").read_text().splitlines()) > 1


@pytest.mark.skipif(os.name == "nt", reason="ends a process by a signal")
def test_the_process_that_logs_finishes_its_run_when_the_job_is_ended(uri):
    script = """
import sys, time; from tractexp.tracking import TrackedRun; from tractexp.tracking.process import Logger
logger = Logger(sys.argv[1])
logger._tell(TrackedRun("e", "r", key="k"))
print(logger._process.pid, flush=True)
time.sleep(60)"""
    job = subprocess.Popen([sys.executable, "-c", script, uri], stdout=-1, stderr=-1, text=True)
    logger = int(job.stdout.readline())
    time.sleep(0.5)
    for pid in (logger, job.pid):  # as a batch system does, to all of a job
        os.kill(pid, signal.SIGTERM)
    assert job.communicate(timeout=30)[1] == ""
    deadline = time.monotonic() + 60
    while not (found := runs(uri)) or found[0].info.status == "RUNNING":
        assert time.monotonic() < deadline
        time.sleep(0.2)
    assert found[0].info.status == "FINISHED"


# Work that goes on where it stopped


# A server on PostgreSQL

POSTGRES = next(iter(sorted(Path("/usr/lib/postgresql").glob("*/bin"))), None)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="module")
def postgres():
    """A database server of our own on loopback, ended with the tests."""
    if POSTGRES is None:
        pytest.skip("PostgreSQL is not installed: apt-get install postgresql")
    pytest.importorskip("psycopg2", reason="psycopg2 is not installed: pip install psycopg2-binary")
    folder, port = Path(tempfile.mkdtemp(prefix="tractexp-pg-")), free_port()  # where another user may go, too
    folder.chmod(0o777)
    as_user = ["setpriv", "--reuid=postgres", "--regid=postgres", "--clear-groups"] if os.getuid() == 0 else []
    data = folder / "data"
    made = [POSTGRES / "initdb", "-D", data, "-A", "trust", "-U", "tester", "--no-sync"]
    subprocess.run([*as_user, *map(str, made)], check=True, capture_output=True)
    settings = f"-c fsync=off -c listen_addresses=127.0.0.1 -c port={port} -c unix_socket_directories={folder}"
    server = subprocess.Popen([*as_user, str(POSTGRES / "postgres"), "-D", str(data), *settings.split()], stderr=-3)
    try:
        deadline = time.monotonic() + 30
        ready = [str(POSTGRES / "pg_isready"), "-h", "127.0.0.1", "-p", str(port)]
        while subprocess.run(ready, capture_output=True).returncode:
            assert time.monotonic() < deadline
            time.sleep(0.1)
        yield f"postgresql+psycopg2://tester@127.0.0.1:{port}/postgres"
    finally:
        server.send_signal(signal.SIGINT)
        server.wait(30)
        shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def mlflow_server(store: str, folder: Path, port: int):
    command = [sys.executable, "-m", "mlflow", "server", "--backend-store-uri", store, "--host", "127.0.0.1"]
    command += ["--port", str(port), "--workers", "1", "--artifacts-destination", str(folder / "artifacts")]
    env = os.environ | {"MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false", "MLFLOW_DISABLE_TELEMETRY": "true"}
    with (folder / "server.txt").open("ab") as said:
        server = subprocess.Popen(command, env=env, stdout=said, stderr=said, start_new_session=True, cwd=folder)
    try:
        deadline = time.monotonic() + 120
        while True:
            with contextlib.suppress(OSError), urllib.request.urlopen(f"http://127.0.0.1:{port}/health", timeout=2):
                break
            assert server.poll() is None, (folder / "server.txt").read_text()
            assert time.monotonic() < deadline
            time.sleep(0.2)
        yield f"http://127.0.0.1:{port}"
    finally:
        os.killpg(server.pid, signal.SIGTERM)
        server.wait(30)


def test_a_run_reaches_a_server_on_postgresql_also_one_made_while_that_was_away(postgres, tmp_path):
    port = free_port()
    address = f"http://127.0.0.1:{port}"
    save(tmp_path / "a", run("while away"), address)
    assert sync(tmp_path) == {NOT: 1}
    (tmp_path / "result.json").write_text("{}")
    with mlflow_server(postgres, tmp_path, port) as address:
        run_id = tracking.log(run("there", artifacts=[tmp_path / "result.json"], children=[run("child")]), address)
        assert sync(tmp_path) == {BROUGHT: 1}
        assert sync(tmp_path) == {THERE: 1}
        found = {r.info.run_name: r for r in runs(address)}
        assert {name: r.info.status for name, r in found.items()} == dict.fromkeys(
            ("while away", "there", "child"), "FINISHED"
        )
        assert found["child"].data.tags["mlflow.parentRunId"] == run_id
        client = open_store(address)
        assert [a.path for a in client.list_artifacts(run_id)] == ["result.json"]
        assert len(client.get_metric_history(run_id, "fitness")) == 3
    with pytest.raises(UserError, match=f"{address} cannot be used"):
        tracking.log(run("too late"), address)  # in seconds, not MLflow's minutes
