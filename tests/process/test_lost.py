"""Nothing is lost: by a kill, by a signal, by a store that is away, locked, cut short or of another
version.
"""

import contextlib
import importlib
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
from command_line import free_port, run_command

from tractexp import load, tracking
from tractexp.errors import UserError
from tractexp.tracking import TrackedRun, owner
from tractexp.tracking.runfile import FILE, read, save
from tractexp.tracking.store import open_store
from tractexp.tracking.sync import BROUGHT, DELETED, NOT, THERE, sync

VALUES = "T_prime: 0.05, X_prime: 0.2, C: 0.9, M: 0.01, T_m: 0.5, p_v: 1.5, q_v: 2.5"
SIMULATE = (
    "task=simulate",
    f"task.values={{{VALUES}}}",
    "task.depth=0.4",
    "task.rate=200",
    "hydra.run.dir=run",
)


def tractexp(*arguments, cwd, **more):
    command = [sys.executable, "-m", "tractexp", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, **more)


def run(name="one", **more) -> TrackedRun:
    curve = (np.arange(1, 4), np.array([3.0, 2.0, 1.0]))
    return TrackedRun(
        "e", name, parameters={"a": 1}, metrics={"x": 1.5}, curves={"fitness": curve}, **more
    )


def runs(uri: str, **more):
    client = open_store(uri)
    return client.search_runs([e.experiment_id for e in client.search_experiments()], **more)


# Runs whose writer is gone

WRITER = """
import os, sys
from tractexp import load, tracking
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
    # this number, an earlier process
    client.set_tag(parent, owner.TAG, owner.sign_process().rpartition(" ")[0] + " 17")
    assert owner.close_stale(client) == [parent]
    assert {r.info.run_id: r.info.status for r in runs(uri)} == {parent: "KILLED", far: "RUNNING"}


@pytest.mark.parametrize(
    ("told", "gone"),
    [
        ("", None),
        ("a b c", None),
        ("elsewhere/1 boot ns 1 1", None),
        ("HERE other ns 1 1", True),
        ("HERE BOOT other 1 1", None),
        ("HERE BOOT NS 99999999 1", True),
        ("HERE BOOT NS x 1", None),
    ],
)
def test_whether_a_process_has_ended_is_told_only_where_it_is_known(told, gone):
    for word, known in zip(("HERE", "BOOT", "NS"), owner._identify_machine(), strict=True):
        told = told.replace(word, known)
    assert owner.has_ended(told) is gone
    assert owner.has_ended(owner.sign_process()) is False


# What is kept beside the results, and brought in


def test_what_is_kept_is_the_run_again_wherever_the_folder_is(tmp_path):
    folder = tmp_path / "before"
    folder.mkdir()
    (folder / "result.json").write_text("{}")
    child = TrackedRun("e", "child", metrics={"y": float("inf")})
    told = run(
        artifacts=[folder / "result.json", tmp_path], model=folder / "result.json", children=[child]
    )
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
        save(
            sweep / str(k), run(f"job {k}", ended=ended, seconds=2.0, children=[run("below")]), uri
        )
    assert sync(tmp_path) == {BROUGHT: 3}
    assert sync(tmp_path) == {THERE: 3}
    found = {r.info.run_name: r for r in runs(uri)}
    parent = found["the sweep"]
    assert json.loads((sweep / "sweep.json").read_text())["run"] == parent.info.run_id
    assert parent.info.status == "FINISHED"
    for k in range(2):
        job = found[f"job {k}"]
        assert job.data.tags["mlflow.parentRunId"] == parent.info.run_id
        # when it ended, not when it was brought in
        assert abs(job.info.end_time / 1000 - ended) < 1.0
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


KILLED_BEFORE_IT_IS_LOGGED = """
import os, sys
from tractexp.__main__ import main
from tractexp.api.task import Job
Job.send = lambda *_: os.kill(os.getpid(), 9)
main(sys.argv[1:])"""


@pytest.mark.skipif(os.name == "nt", reason="ends a process by a signal")
def test_a_run_killed_with_its_result_whole_is_brought_in_from_its_folder_once(tmp_path, uri):
    script = [sys.executable, "-c", KILLED_BEFORE_IT_IS_LOGGED]
    settings = (*SIMULATE, "seed=3", f"tracking.uri={uri}")
    done = subprocess.run([*script, *settings], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert sync(tmp_path) == {BROUGHT: 1}
    assert sync(tmp_path) == {THERE: 1}
    (found,) = runs(uri)
    assert (found.info.status, found.data.params["seed"]) == ("FINISHED", "3")
    listed = {one.path for one in open_store(uri).list_artifacts(found.info.run_id)}
    assert listed == {"response.csv", ".hydra"}


def test_what_is_not_whole_or_has_not_its_places_yet_is_no_run_of_its_own(tmp_path, uri):
    from tractexp.storage.run_folder import NEXT, WHOLE

    for place in (f"{NEXT}.17.abc", WHOLE):
        save(tmp_path / "run", run(place), uri, place=tmp_path / "run" / place)
    assert sync(tmp_path) == {BROUGHT: 1}
    assert [one.info.run_name for one in runs(uri)] == [WHOLE]
    assert (tmp_path / "run" / FILE).exists()


def test_a_run_that_is_at_work_logs_itself(tmp_path, uri):
    from tractexp.storage.run_folder import LOCK
    from tractexp.tracking.sync import WORKS

    script = """
import sys, time; from pathlib import Path; from tractexp.storage.run_folder import hold
with hold(Path(sys.argv[1])):
    print("held", flush=True); time.sleep(60)"""
    save(tmp_path / "sweep", TrackedRun("e", "a sweep"), uri, sweep=True)
    (tmp_path / "sweep" / "multirun.yaml").touch()
    save(tmp_path / "sweep" / "0", run("its job"), uri)
    holder = subprocess.Popen(
        [sys.executable, "-c", script, str(tmp_path / "sweep")], stdout=-1, text=True
    )
    try:
        assert holder.stdout.readline() == "held\n"
        assert sync(tmp_path) == {WORKS: 2}
    finally:
        holder.kill()
        holder.communicate()
    assert (tmp_path / "sweep" / LOCK).exists()  # a killed one leaves it, and holds nothing
    assert sync(tmp_path) == {BROUGHT: 2}


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


@pytest.mark.parametrize(
    ("harm", "reason"), [("locked", "database is locked"), ("torn", "malformed")]
)
def test_a_store_that_is_locked_or_torn_is_told_before_mlflow_tries_for_minutes(
    harm, reason, uri, monkeypatch
):
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
        tracking.open_store(uri)


# Folders of others


def hostile(folder: Path, run: TrackedRun, uri: str) -> Path:
    """A folder that somebody else gave us: its file was written by hand."""
    save(folder, run, uri)
    return folder / FILE


def names(uri: str, name: str) -> list[str]:
    """The artifacts of a run, those within folders, too."""
    client, (found,) = open_store(uri), [r for r in runs(uri) if r.info.run_name == name]
    listed = client.list_artifacts(found.info.run_id)
    listed += [
        one
        for folder in listed
        if folder.is_dir
        for one in client.list_artifacts(found.info.run_id, folder.path)
    ]
    return [one.path for one in listed if not one.is_dir]


@pytest.mark.parametrize("command", ["sync", "doctor"])
def test_of_a_received_folder_only_its_own_files_are_sent(
    command, tmp_path, uri, capsys, monkeypatch
):
    from tractexp.cli import doctor

    monkeypatch.setattr(doctor, "check_cores", lambda: iter(()))
    key, folder = tmp_path / "home" / "id_rsa", tmp_path / "given" / "run"
    (folder / "figures").mkdir(parents=True)
    key.parent.mkdir()
    for path in (key, folder / "own.txt", folder / "figures" / "own.svg"):
        path.write_text(path.name)
    (folder / "link.txt").symlink_to(key)
    (folder / "home").symlink_to(key.parent)
    (folder / "figures" / "deep").symlink_to(key)
    (folder / "again.txt").symlink_to(folder / "own.txt")
    os.mkfifo(folder / "pipe")
    ways = [
        str(key),
        "../../home/id_rsa",
        "link.txt",
        "home",
        "home/id_rsa",
        "figures",
        "pipe",
        "../run/../../home",
    ]
    given = json.loads(hostile(folder, run(children=[run("below")]), uri).read_text())
    given["run"] |= {
        "artifacts": [*ways, "own.txt", "again.txt", "figures/own.svg"],
        "model": str(key),
    }
    given["run"]["children"][0] |= {"artifacts": [*ways, "own.txt"], "model": "link.txt"}
    (folder / FILE).write_text(json.dumps(given))
    getattr(importlib.import_module(f"tractexp.cli.{command}"), command)(
        [str(tmp_path / "given"), "--uri", uri]
    )
    assert sorted(names(uri, "one")) == ["again.txt", "own.svg", "own.txt"]
    assert names(uri, "below") == ["own.txt"]
    said = capsys.readouterr().out
    assert f"{key} is not sent: it does not lie in the folder {folder} of its run" in " ".join(
        said.split()
    )
    store = Path(uri.removeprefix("sqlite:///")).parent
    assert [p for p in store.rglob("*") if p.is_file() and p.name == key.name] == []


def test_the_page_of_a_received_sweep_may_be_a_link_to_anything(tmp_path, uri):
    (tmp_path / "key").write_text("secret")
    hostile(tmp_path / "sweep", TrackedRun("e", "a sweep"), uri)
    save(tmp_path / "sweep", TrackedRun("e", "a sweep"), uri, sweep=True)
    (tmp_path / "sweep" / "comparison.html").symlink_to(tmp_path / "key")
    assert sync(tmp_path) == {BROUGHT: 1}
    assert names(uri, "a sweep") == []


@pytest.mark.parametrize("command", ["sync", "doctor"])
def test_no_store_is_used_that_only_a_folder_names(command, tmp_path, capsys, monkeypatch):
    from tractexp.cli import doctor

    monkeypatch.setattr(doctor, "check_cores", lambda: iter(()))
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    foreign = f"sqlite:///{tmp_path / 'foreign' / 'mlflow.db'}"
    hostile(tmp_path / "given" / "run", run(), foreign)
    assert (
        getattr(importlib.import_module(f"tractexp.cli.{command}"), command)(
            [str(tmp_path / "given")]
        )
        == 2
    )
    said = " ".join(capsys.readouterr().out.split())
    assert f"where it is yours, tractexp sync --uri {foreign} sends it there" in said
    assert "1 not logged" in said
    assert not (tmp_path / "foreign").exists()


def test_a_received_file_changes_no_run_that_is_not_its_own(tmp_path, uri):
    mine = save(tmp_path / "mine", run("mine"), uri)
    sweep = save(
        tmp_path / "sweep", TrackedRun("e", "my sweep", tags={"sweep": "seed=1,2"}), uri, sweep=True
    )
    assert sync(tmp_path) == {BROUGHT: 2}
    ids = {name: read(tmp_path / name).run_id for name in ("mine", "sweep")}
    before = {r.info.run_id: r.to_dictionary() for r in runs(uri)}
    given = tmp_path / "given"
    for k, (name, run_id) in enumerate(ids.items()):
        hostile(given / str(k), run("other", status="KILLED"), uri)
        content = json.loads((given / str(k) / FILE).read_text()) | {
            "run_id": run_id,
            "sweep": name == "sweep",
        }
        (given / str(k) / FILE).write_text(json.dumps(content))
    hostile(given / "2", run("other", status="KILLED", key=mine.run.key), uri)
    (given / "sweep.json").write_text(json.dumps({"run": ids["sweep"]}))
    sync(given)
    assert {
        r.info.run_id: r.to_dictionary() for r in runs(uri) if r.info.run_id in before
    } == before
    assert sweep.run.name == "my sweep"


@pytest.mark.parametrize(
    ("place", "value"),
    [
        ("uri", 5),
        ("run_id", ["x"]),
        ("key", "x' or 1=1"),
        ("key", None),
        ("name", 3),
        ("artifacts", 7),
        ("model", 7),
        ("status", {}),
        ("children", [1]),
        ("curves", [1]),
    ],
)
def test_a_file_that_no_run_wrote_is_a_sentence(place, value, tmp_path, uri):
    given = json.loads(hostile(tmp_path / "run", run(), uri).read_text())
    (given if place in given else given["run"])[place] = value
    (tmp_path / "run" / FILE).write_text(json.dumps(given))
    told = []
    assert sync(tmp_path, uri, tell=told.append) == {NOT: 1}
    assert "is damaged" in told[0]


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


def test_the_doctor_closes_stale_runs_sets_a_damaged_store_aside_and_makes_it_anew(
    tmp_path, uri, capsys, monkeypatch
):
    monkeypatch.setattr(owner, "closed", [])  # of this process, whose other tests close runs, too
    save(tmp_path / "outputs" / "job", run(), uri)
    sync(tmp_path)
    database = Path(uri.removeprefix("sqlite:///"))
    stale = tracking.start_parent(TrackedRun("e", "stale"), uri)
    open_store(uri).set_tag(stale, owner.TAG, owner.sign_process().rpartition(" ")[0] + " 17")
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


@pytest.mark.parametrize("content", [b"notes of mine\n", "another program's database"])
def test_the_doctor_touches_nothing_that_is_not_ours(content, tmp_path, capsys, monkeypatch):
    from tractexp.cli import doctor as module

    monkeypatch.setattr(module, "check_cores", lambda: iter(()))
    mine, database = tmp_path / "runs" / "film.part", tmp_path / "runs" / "mine.db"
    mine.parent.mkdir()
    mine.write_text("half a download")
    os.utime(mine, (0, 0))
    if isinstance(content, bytes):
        database.write_bytes(content)
    else:
        with contextlib.closing(sqlite3.connect(database)) as other:
            other.execute("CREATE TABLE mine (a)")
    before = {path: path.read_bytes() for path in (mine, database)}
    code, told = doctor(tmp_path / "runs", "--uri", f"sqlite:///{database}", capsys=capsys)
    assert code == 2
    assert f"WRONG {database} is no MLflow store" in told
    assert {path: path.read_bytes() for path in (tmp_path / "runs").iterdir()} == before


def test_the_doctor_says_what_it_cannot_heal(tmp_path, uri, capsys, monkeypatch):
    from tractexp.cli import doctor as module

    monkeypatch.setattr(module, "check_cores", lambda: iter(()))
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
    code, told = doctor(
        tmp_path / "none", "--uri", f"sqlite:///{tmp_path / 'newer.db'}", capsys=capsys
    )
    assert code == 2
    assert "comes from another version of MLflow" in told


# Signals


@pytest.mark.skipif(os.name == "nt", reason="ends a run by a signal")
def test_a_search_that_is_ended_keeps_what_it_found_and_says_so(tmp_path, uri):
    """Of an interrupt test_signals tells it."""
    command = [
        sys.executable,
        "-m",
        "tractexp",
        "--all",
        "optimizer=pso",
        "optimizer.iterations=10000000",
        "hydra.run.dir=run",
    ]
    job = subprocess.Popen(
        command,
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    said = ""
    while "optimizer: pso" not in said:
        line = job.stdout.readline()
        assert line, job.stderr.read()
        said += line
    time.sleep(2.5)
    job.terminate()
    _, err = job.communicate(timeout=60)
    assert job.returncode == 143, err
    *progress, last = err.splitlines()
    assert all(line.startswith("  iteration ") for line in progress), err
    assert last.startswith("tractexp: ended by SIGTERM; the best of ")
    kept = json.loads((tmp_path / "run" / "interrupted.json").read_text())
    assert kept["simulations"] > 0
    assert "was stopped after" in kept["status"]
    assert load(tmp_path / "run" / "interrupted.json").parameters["T_prime"].value > 0
    assert not (tmp_path / "run" / "result.json").exists()
    assert len((tmp_path / "run" / "history.csv").read_text().splitlines()) > 1


@pytest.mark.skipif(os.name == "nt", reason="ends a process by a signal")
def test_the_process_that_logs_finishes_its_run_when_the_job_is_ended(uri):
    script = """
import sys, time; from tractexp.tracking import TrackedRun; \
from tractexp.tracking.process import Logger
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


@pytest.fixture(scope="module")
def postgres():
    """A database server of our own on loopback, ended with the tests."""
    if POSTGRES is None:
        pytest.skip("PostgreSQL is not installed: apt-get install postgresql")
    pytest.importorskip("psycopg2", reason="psycopg2 is not installed: pip install psycopg2-binary")
    # where another user may go, too
    folder, port = Path(tempfile.mkdtemp(prefix="tractexp-pg-")), free_port()
    folder.chmod(0o777)
    as_user = (
        ["setpriv", "--reuid=postgres", "--regid=postgres", "--clear-groups"]
        if os.getuid() == 0
        else []
    )
    data = folder / "data"
    made = [POSTGRES / "initdb", "-D", data, "-A", "trust", "-U", "tester", "--no-sync"]
    subprocess.run([*as_user, *map(str, made)], check=True, capture_output=True)
    settings = (
        f"-c fsync=off -c listen_addresses=127.0.0.1 -c port={port} -c"
        f" unix_socket_directories={folder}"
    )
    server = subprocess.Popen(
        [*as_user, str(POSTGRES / "postgres"), "-D", str(data), *settings.split()], stderr=-3
    )
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
    command = [
        sys.executable,
        "-m",
        "mlflow",
        "server",
        "--backend-store-uri",
        store,
        "--host",
        "127.0.0.1",
    ]
    command += [
        "--port",
        str(port),
        "--workers",
        "1",
        "--artifacts-destination",
        str(folder / "artifacts"),
    ]
    env = os.environ | {
        "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false",
        "MLFLOW_DISABLE_TELEMETRY": "true",
    }
    with (folder / "server.txt").open("ab") as said:
        server = subprocess.Popen(
            command, env=env, stdout=said, stderr=said, start_new_session=True, cwd=folder
        )
    try:
        deadline = time.monotonic() + 120
        while True:
            with (
                contextlib.suppress(OSError),
                urllib.request.urlopen(f"http://127.0.0.1:{port}/health", timeout=2),
            ):
                break
            assert server.poll() is None, (folder / "server.txt").read_text()
            assert time.monotonic() < deadline
            time.sleep(0.2)
        yield f"http://127.0.0.1:{port}"
    finally:
        os.killpg(server.pid, signal.SIGTERM)
        server.wait(30)


@pytest.mark.long  # a database and a server of MLflow
def test_a_run_reaches_a_server_on_postgresql_also_one_made_while_that_was_away(postgres, tmp_path):
    port = free_port()
    address = f"http://127.0.0.1:{port}"
    save(tmp_path / "a", run("while away"), address)
    assert sync(tmp_path) == {NOT: 1}
    (tmp_path / "result.json").write_text("{}")
    with mlflow_server(postgres, tmp_path, port) as address:
        run_id = tracking.log(
            run("there", artifacts=[tmp_path / "result.json"], children=[run("child")]), address
        )
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


# A folder that holds an earlier run

SEARCH = (
    "optimizer=multistart_least_squares",
    "budget=200",
    "tracking.enabled=false",
    "hydra.run.dir=run",
)


def state(folder: Path) -> dict[str, bytes]:
    return {
        str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()
    }


@pytest.fixture(scope="module")
def earlier(tmp_path_factory):
    """A folder with a finished run, and what an engineer put beside it."""
    folder = tmp_path_factory.mktemp("earlier")
    done = run_command(*SEARCH, "seed=1", cwd=folder)
    assert done.returncode == 0, done.stderr
    (folder / "run" / "notes.txt").write_text("mine")
    return folder


def seed_of(folder: Path) -> str:
    return next(
        line
        for line in (folder / ".hydra" / "overrides.yaml").read_text().split()
        if "seed" in line
    )


@pytest.mark.skipif(os.name == "nt", reason="ends a run by a signal")
@pytest.mark.parametrize("way", [signal.SIGKILL, signal.SIGTERM])
def test_a_run_killed_in_an_old_folder_leaves_no_result_under_its_own_configuration(
    earlier, way, tmp_path
):
    shutil.copytree(earlier / "run", tmp_path / "run")
    command = [
        sys.executable,
        "-m",
        "tractexp",
        *SEARCH,
        "seed=2",
        "optimizer=pso",
        "optimizer.iterations=10000000",
        "--all",
    ]
    command = [
        word for word in command if word not in ("budget=200", "optimizer=multistart_least_squares")
    ]
    job = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    while "optimizer: pso" not in (line := job.stdout.readline()):
        assert line, job.stderr.read()
    time.sleep(1.0)
    job.send_signal(way)
    job.communicate(timeout=60)
    left = state(tmp_path / "run")
    if way == signal.SIGKILL:
        assert {k: v for k, v in left.items() if ".next" not in k} == state(earlier / "run")
    else:  # what was found so far is the result then
        assert seed_of(tmp_path / "run") == "seed=2"
        assert "result.json" not in left
        assert {"interrupted.json", "notes.txt"} <= left.keys()
    assert (run_command(*SEARCH, "seed=3", cwd=tmp_path)).returncode == 0
    assert seed_of(tmp_path / "run") == "seed=3"
    assert {p.name for p in (tmp_path / "run").iterdir()} == {
        p.name for p in (earlier / "run").iterdir()
    }


def test_a_run_that_is_refused_in_an_old_folder_leaves_it_as_it_was(earlier):
    before = state(earlier / "run")
    for wrong in (
        ("data=csv", "data.train=[absent.csv]"),
        ("budget=0",),
        ("model.bounds.C=[2,1]",),
    ):
        assert run_command(*SEARCH, "seed=2", *wrong, cwd=earlier).returncode == 2
        assert state(earlier / "run") == before


def test_the_results_of_another_task_go_and_those_that_a_task_reads_stay(earlier, tmp_path):
    shutil.copytree(earlier / "run", tmp_path / "run")
    result = (tmp_path / "run" / "result.json").read_bytes()
    export = (
        "task=export",
        "task.parameters=run/result.json",
        "task.format=modelica",
        "hydra.run.dir=run",
    )
    assert run_command(*export, cwd=tmp_path).returncode == 0
    assert state(tmp_path / "run").keys() == {*state(earlier / "run"), "load.mo"}
    assert seed_of(tmp_path / "run") == "seed=1"  # of the result that is there
    simulate = (*SIMULATE, "tracking.enabled=false")
    of_result = [
        "task.parameters=run/result.json" if "values" in word else word for word in simulate
    ]
    assert run_command(*of_result, cwd=tmp_path).returncode == 0
    assert (tmp_path / "run" / "result.json").read_bytes() == result
    assert not (tmp_path / "run" / "history.csv").exists()
    assert run_command(*simulate, cwd=tmp_path).returncode == 0
    names = {p.name for p in (tmp_path / "run").iterdir()}
    assert not {"result.json", "history.csv", "report.html", ".hydra.next"} & names
    assert {"response.csv", "load.mo", "notes.txt", ".hydra"} <= names


# Passwords


@pytest.mark.parametrize(
    "arguments",
    [
        (*SIMULATE, "tracking.uri=http://me:hunter2@127.0.0.1:9"),
        (*SIMULATE, "tracking.url=http://me:hunter2@h"),
        (
            "-m",
            "seed=1,2",
            "hydra.sweep.dir=run",
            "tracking.uri=postgresql://me:hunter2@127.0.0.1:9/db",
        ),
        ("ui", "--uri", "http://me:hunter2@127.0.0.1:9"),
        ("sync", ".", "--uri=http://me:hunter2@127.0.0.1:9"),
        ("doctor", "--uri", "http://hunter2@127.0.0.1:9"),
        ("sync", "http://me:hunter2@127.0.0.1:9"),
        ("--config-dir=own", "+mine=store", *SIMULATE),
        ("--config-dir=own", "+mine=store", *SIMULATE[:-1], "hydra.run.dir=old"),
        ("-m", "--config-dir=own", "+mine=store", "seed=1,2", "hydra.sweep.dir=run"),
        (*SIMULATE, "tracking.uri=${oc.env:STORE}"),
    ],
)
def test_a_password_is_neither_printed_nor_written(arguments, tmp_path):
    own = tmp_path / "own" / "mine" / "store.yaml"
    own.parent.mkdir(parents=True)
    own.write_text("# @package _global_\ntracking:\n  uri: http://me:hunter2@127.0.0.1:9\n")
    (tmp_path / "old" / ".hydra").mkdir(parents=True)
    done = run_command(*arguments, cwd=tmp_path, STORE="http://me:hunter2@127.0.0.1:9")
    assert done.returncode == 2
    assert "MLFLOW_TRACKING_PASSWORD" in done.stderr
    assert "hunter2" not in done.stdout + done.stderr
    assert [
        p for p in tmp_path.rglob("*") if p.is_file() and p != own and b"hunter2" in p.read_bytes()
    ] == []


def test_a_store_that_an_earlier_version_wrote_down_with_its_password_is_not_repeated(
    tmp_path, capsys
):
    from tractexp.cli.sync import sync as command

    save(tmp_path / "run", run(), "http://me:hunter2@127.0.0.1:9")
    assert command([str(tmp_path)]) == 2
    assert "hunter2" not in capsys.readouterr().out


@pytest.mark.skipif(os.name == "nt", reason="looks at permissions")
def test_what_names_the_store_is_for_the_user_alone(tmp_path, uri):
    save(tmp_path / "sweep", TrackedRun("e", "a sweep"), uri, sweep=True)
    sync(tmp_path)
    assert {p.stat().st_mode & 0o777 for p in (tmp_path / "sweep").glob("*.json")} == {0o600}


@pytest.mark.long  # what MLflow does
def test_a_server_is_given_the_password_of_the_environment_or_of_a_netrc(tmp_path):
    """What the refusal recommends: MLflow sends either."""
    script = """
import sys, threading; from http.server import BaseHTTPRequestHandler, HTTPServer
asked = []
class Server(BaseHTTPRequestHandler):
    def do_GET(self):
        asked.append(self.headers.get("Authorization"))
        self.send_response(200); self.send_header("Content-Type", "application/json"); \
self.end_headers()
        self.wfile.write(b"{}")
    do_POST = do_GET
    def log_message(self, *_): pass
server = HTTPServer(("127.0.0.1", 0), Server)
threading.Thread(target=server.serve_forever, daemon=True).start()
from tractexp.tracking.store import open_store
open_store(f"http://127.0.0.1:{server.server_port}").search_experiments()
print(*sorted({str(each) for each in asked[1:]}))"""
    netrc = tmp_path / ".netrc"
    netrc.write_text("machine 127.0.0.1 login me password hunter2\n")
    netrc.chmod(0o600)
    names = {"MLFLOW_TRACKING_USERNAME": "me", "MLFLOW_TRACKING_PASSWORD": "hunter2"}
    for more in (names, {"NETRC": str(netrc)}):
        done = subprocess.run(
            [sys.executable, "-c", script], capture_output=True, text=True, env=os.environ | more
        )
        assert done.stdout.strip() == "Basic bWU6aHVudGVyMg==", done.stderr
