"""Sweeps: isolation of failures, killed workers, what is not run again, the parent run, and
bit-identical results.
"""

import contextlib
import importlib.util
import json
import os
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from command_line import run_command

QUICK = ("optimizer.population=20", "budget=200")
TWO = "hydra.launcher.n_jobs=2"
SILENT = ("budget=200", "tracking.enabled=false")
HERE = "hydra.sweep.dir=sweep"
# one job after the other in this process: where workers are not the point
ONE = "hydra.launcher.backend=sequential"
PLAIN = "hydra.sweeper.compare=false"

needs_dask = pytest.mark.skipif(
    importlib.util.find_spec("distributed") is None,
    reason="Dask is not installed: pip install 'tractexp[dask]'",
)
needs_submitit = pytest.mark.skipif(
    importlib.util.find_spec("submitit") is None,
    reason="hydra-submitit-launcher is not installed: pip install 'tractexp[slurm]'",
)

PLUGINS = {
    "stumbles": """
    def search(self, evaluate, box, rng):
        if rng.random() < self.odds:
            raise ZeroDivisionError("the third step divides by the width of nothing")
        evaluate(box.uniform(rng, 20))
        yield
""",
    "kills": """
    def search(self, evaluate, box, rng):
        os._exit(9)
        yield
""",
    "dies": """
    def search(self, evaluate, box, rng):
        marker = pathlib.Path(self.marker)
        if not marker.exists():
            marker.touch()
            os._exit(9)
        evaluate(box.uniform(rng, 20))
        yield
""",
}


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder for PYTHONPATH with an installed package of optimizers that fail in
    their own ways.
    """
    site = tmp_path_factory.mktemp("site")
    package, info = site / "faulty", site / "faulty-1.0.dist-info"
    package.mkdir()
    info.mkdir()
    (package / "__init__.py").write_text("")
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: faulty\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[tractexp.plugins]\nfaulty = faulty\n")
    for name, body in PLUGINS.items():
        head = "import os, pathlib\nfrom tractexp.identification.optimizer import Optimizer\n"
        head += "from tractexp.configuration.plugin import plugin\n"
        settings = "    odds: float = 0.5\n    marker: str = 'marker'\n    population: int = 20\n"
        text = (
            f'{head}\n@plugin\nclass Faulty(Optimizer):\n    """Fails.\n\n    Source: none.\n   '
            f' """\n{settings}{body}'
        )
        (package / f"{name}.py").write_text(text)
    return site


def tractexp(*arguments, cwd, site=None):
    """Run `python -m tractexp` in a folder, with the package in `site` installed too."""
    command = [sys.executable, "-m", "tractexp", *arguments]
    paths = [str(site)] * (site is not None) + [p for p in (os.environ.get("PYTHONPATH"),) if p]
    env = os.environ | {"COLUMNS": "200", "PYTHONPATH": os.pathsep.join(paths)}
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, env=env)


def statuses(folder):
    """{job number: content of status.json}"""
    return {int(p.parent.name): json.loads(p.read_text()) for p in folder.glob("*/status.json")}


def results(folder):
    """{(optimizer, seed): what was found}, without the time it took."""
    found = {}
    for path in folder.glob("*/result.json"):
        content = json.loads(path.read_text())
        del content["seconds"], content["search"]["seconds"]
        history = [
            line.split(",") for line in (path.parent / "history.csv").read_text().splitlines()
        ]
        content["history"] = [(row[0], row[1], row[3]) for row in history]
        found[content["optimizer"], content["seed"]] = content
    return found


def ask(folder, text):
    with sqlite3.connect(folder / "outputs" / "mlflow.db") as store:
        return store.execute(text).fetchall()


@pytest.fixture(scope="module")
def logged(tmp_path_factory, empty_store):
    """A sweep of four jobs on two workers, logged, run once."""
    folder = tmp_path_factory.mktemp("logged")
    (folder / "outputs").mkdir()
    shutil.copy(empty_store, folder / "outputs")
    done = tractexp("-m", *QUICK, TWO, "optimizer=ssa,pso", "seed=range(0,2)", cwd=folder)
    assert done.returncode == 0, done.stderr
    (sweep,) = (folder / "outputs" / "sweeps").iterdir()
    return folder, sweep, done


def test_each_job_leaves_its_status_and_what_it_printed(logged):
    _, sweep, _ = logged
    ends = statuses(sweep)
    assert sorted(ends) == [0, 1, 2, 3]
    for number, end in ends.items():
        assert (end["status"], end["message"]) == ("finished", "")
        assert end["choices"]["optimizer"] == ("ssa", "pso")[number // 2]
        assert end["seed"] == number % 2
        assert end["seconds"] > 0
        names = {path.name for path in (sweep / str(number)).iterdir()}
        assert names == {
            ".hydra",
            "history.csv",
            "mlflow.json",
            "output.txt",
            "result.json",
            "status.json",
        }
        assert f"seed {number % 2}" in (sweep / str(number) / "output.txt").read_text()
    assert len({end["configuration"] for end in ends.values()}) == 4


def test_workers_print_nothing_and_the_end_is_a_table_of_optimizers(logged):
    _, _, done = logged
    assert "Runge-Kutta" not in done.stdout + done.stderr
    lines = [line.split() for line in done.stdout.splitlines()]
    assert sorted(line[:2] for line in lines if line[:1] in (["ssa"], ["pso"])) == [
        ["pso", "0"],
        ["ssa", "0"],
    ]


def test_a_sweep_of_several_variants_and_seeds_ends_with_their_comparison(logged, tmp_path):
    folder, sweep, done = logged
    assert "comparison.html" in done.stdout
    told = json.loads((sweep / "comparison.json").read_text())
    assert {(run["variant"], run["seed"]) for run in told["runs"]} == {
        (v, s) for v in ("ssa", "pso") for s in (0, 1)
    }
    parent = json.loads((sweep / "sweep.json").read_text())["run"]
    (uri,) = ask(folder, f"select artifact_uri from runs where run_uuid = '{parent}'")[0]
    assert "comparison.html" in {path.name for path in Path(uri.removeprefix("file://")).iterdir()}
    for quiet in (("seed=0",), ("seed=0,1", PLAIN)):
        done = run_command(
            "-m",
            *QUICK,
            *quiet,
            ONE,
            "optimizer=ssa,pso",
            "tracking.enabled=false",
            HERE,
            cwd=tmp_path,
        )
        assert "best objective" in done.stdout
        assert not (tmp_path / "sweep" / "comparison.html").exists()


@pytest.mark.parametrize(
    ("setting", "sentence"),
    [("bob=3", "task 'compare' has no setting 'bob'"), ("bbob=-1", "task.bbob=-1 is out of range")],
)
def test_what_the_comparison_would_refuse_is_refused_before_the_jobs(setting, sentence, tmp_path):
    asked = (
        "optimizer=ssa,pso",
        "seed=0,1",
        "tracking.enabled=false",
        f"hydra.sweeper.comparison.{setting}",
    )
    done = run_command("-m", *QUICK, *asked, HERE, cwd=tmp_path)
    assert done.returncode == 2
    assert sentence in done.stderr
    assert not (tmp_path / "sweep").exists()


def test_the_sweep_is_a_finished_parent_run_with_its_jobs_as_children(logged):
    folder, sweep, _ = logged
    parent = json.loads((sweep / "sweep.json").read_text())["run"]
    assert ask(folder, f"select status from runs where run_uuid = '{parent}'") == [("FINISHED",)]
    children = ask(
        folder, f"select run_uuid from tags where key = 'mlflow.parentRunId' and value = '{parent}'"
    )
    assert len(children) == 4
    assert ask(folder, "select distinct status from runs") == [("FINISHED",)]
    metrics = dict(
        ask(folder, f"select key, value from latest_metrics where run_uuid = '{parent}'")
    )
    best = min(content["objective"] for content in results(sweep).values())
    assert (metrics["jobs"], metrics["jobs_finished"], metrics["best_objective"]) == (4, 4, best)


def test_the_same_command_again_runs_nothing_and_more_seeds_run_only_those(logged, tmp_path):
    folder, sweep, _ = logged
    before = {path: path.stat().st_mtime_ns for path in sweep.glob("*/result.json")}
    done = run_command("-m", *QUICK, PLAIN, "optimizer=ssa,pso", "seed=range(0,2)", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "4 of them are finished and kept" in done.stdout
    assert {path: path.stat().st_mtime_ns for path in sweep.glob("*/result.json")} == before
    assert len(ask(folder, "select run_uuid from runs")) == 5

    shutil.copytree(sweep, tmp_path / "sweep")
    more = (
        *QUICK,
        ONE,
        PLAIN,
        "tracking.enabled=false",
        "optimizer=ssa,pso",
        "seed=range(0,3)",
        HERE,
    )
    done = run_command("-m", *more, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "4 of them are finished and kept" in done.stdout
    ends = statuses(tmp_path / "sweep")
    assert [(ends[n]["choices"]["optimizer"], ends[n]["seed"]) for n in (4, 5)] == [
        ("ssa", 2),
        ("pso", 2),
    ]


def test_other_data_of_the_same_name_are_computed_anew_in_the_same_folder(tmp_path):
    import tractexp as package

    shipped = os.path.join(os.path.dirname(package.__file__), "data", "tibet_{}pct.csv")
    sweep = (
        "-m",
        *SILENT,
        ONE,
        "optimizer=ssa",
        "data=csv",
        "data.train=[dip.csv]",
        "seed=0,1",
        HERE,
    )
    found = []
    for depth in (50, 30):
        shutil.copy(shipped.format(depth), tmp_path / "dip.csv")
        done = run_command(*sweep, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert "finished and kept" not in done.stdout
        assert sorted(statuses(tmp_path / "sweep")) == [0, 1]
        found.append(results(tmp_path / "sweep")["ssa", 0]["objective"])
    assert found[0] != found[1]


def test_redo_runs_finished_jobs_again_under_a_new_parent(logged, tmp_path):
    folder, sweep, _ = logged
    old, before = (sweep / "sweep.json").read_text(), results(sweep)
    times = {path: path.stat().st_mtime_ns for path in sweep.glob("*/result.json")}
    again = (*QUICK, ONE, PLAIN, "optimizer=ssa,pso", "seed=range(0,2)", "hydra.sweeper.redo=true")
    done = run_command("-m", *again, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "kept" not in done.stdout
    assert all(path.stat().st_mtime_ns > then for path, then in times.items())
    assert results(sweep) == before
    assert (sweep / "sweep.json").read_text() != old


ENDS_IN_THE_SECOND_JOB = """
import os, sys
from pathlib import Path
from tractexp.__main__ import main
from tractexp.api.task import Job
write = Job.write
def ends(job, results, track):
    if job.config["seed"] == 1:
        print(*sorted(p.name for p in job.folder.iterdir()), file=sys.__stdout__, flush=True)
        os.kill(os.getpid(), 9)
    return write(job, results, track)
Job.write = ends
main(sys.argv[1:])"""


def stay(folder):
    """What must stay of a job whose new time has not ended: all but what it prints."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != "output.txt" and ".tractexp" not in str(path)
    }


@pytest.mark.skipif(os.name == "nt", reason="ends a process by a signal")
def test_who_is_killed_while_a_job_is_done_again_loses_nothing_of_the_earlier_time(
    logged, tmp_path
):
    shutil.copytree(logged[1], tmp_path / "sweep")
    before = {k: stay(tmp_path / "sweep" / str(k)) for k in range(4)}
    sweep = (*QUICK, ONE, PLAIN, "tracking.enabled=false", "optimizer=ssa,pso", "seed=range(0,2)")
    again = (*sweep, HERE, "hydra.sweeper.redo=true")
    script = [sys.executable, "-c", ENDS_IN_THE_SECOND_JOB, "-m", *again]
    done = subprocess.run(script, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert "result.json" in done.stdout.split()  # while the job was at work
    after = {k: stay(tmp_path / "sweep" / str(k)) for k in range(4)}
    assert {k: after[k] for k in (1, 2, 3)} == {k: before[k] for k in (1, 2, 3)}
    assert after[0].keys() == before[0].keys() - {"mlflow.json"}
    found = results(tmp_path / "sweep")
    assert found == results(logged[1])
    assert {end["status"] for end in statuses(tmp_path / "sweep").values()} == {"finished"}
    done = run_command("-m", *again, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert results(tmp_path / "sweep") == found
    assert [p for p in (tmp_path / "sweep").rglob(".tractexp*")] == []


def test_a_job_that_fails_when_it_is_done_again_leaves_the_earlier_result(
    logged, tmp_path, monkeypatch
):
    from tractexp.api.job import Job
    from tractexp.errors import UserError

    shutil.copytree(logged[1] / "0", tmp_path / "sweep" / "0")
    before = stay(tmp_path / "sweep" / "0")

    def fails(*_):
        raise UserError("the disk has gone")

    monkeypatch.setattr(Job, "write", fails)
    again = (*QUICK, ONE, PLAIN, HERE, "optimizer=ssa", "seed=0", "hydra.sweeper.redo=true")
    done = run_command("-m", *again, "tracking.enabled=false", cwd=tmp_path)
    assert "the disk has gone" in done.stdout
    after = stay(tmp_path / "sweep" / "0")
    assert json.loads(after.pop("status.json"))["status"] == "failed"
    before.pop("status.json")
    assert after == before


@pytest.mark.parametrize("launcher", ["cores", "basic"])
def test_another_sweeper_finds_a_folder_held_or_another_sweeps(launcher, tmp_path):
    from tractexp.storage.run_folder import hold

    others = ("hydra/sweeper=basic", f"hydra/launcher={launcher}", "tracking.enabled=false", HERE)
    others += () if launcher == "basic" else (ONE,)
    held = tmp_path / "sweep" / ("0" if launcher == "basic" else "")
    with hold(held):
        done = run_command("-m", *QUICK, *others, "optimizer=pso", "seed=1", cwd=tmp_path)
    assert done.returncode == 2
    assert f"{held} is in use by process {os.getpid()} on " in done.stderr
    shutil.rmtree(tmp_path / "sweep")
    done = run_command("-m", *QUICK, *others, "optimizer=pso", "seed=1", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = results(tmp_path / "sweep")
    done = run_command("-m", *QUICK, *others, "optimizer=pso", "seed=2", cwd=tmp_path)
    if launcher == "basic":  # Hydra names the folder of a job
        assert "sweep/0 holds a job of another sweep; name another folder" in done.stderr
        assert results(tmp_path / "sweep") == found
    else:
        assert results(tmp_path / "sweep").items() > found.items()


# a command, and the same again
TWICE = """
import json, sys
from command_line import run_command
print(json.dumps([vars(run_command(*sys.argv[1:], cwd=".")) for _ in range(2)]))"""


def test_failing_jobs_are_isolated_listed_and_change_the_exit_code(site, tmp_path, uri):
    seeds = (2, 1)
    # one after the other: of workers side by side the test of a killed one tells it
    sweep = ("-m", "budget=200", PLAIN, ONE, "optimizer=stumbles,pso", "seed=2,1", HERE)
    there = os.environ | {"PYTHONPATH": os.pathsep.join([str(site), *sys.path])}
    both = subprocess.run(
        [sys.executable, "-c", TWICE, *sweep], cwd=tmp_path, env=there, capture_output=True
    )
    done, again = (SimpleNamespace(**told) for told in json.loads(both.stdout))
    ends = statuses(tmp_path / "sweep")
    failed = {n for n, end in ends.items() if end["status"] == "failed"}
    from numpy.random import default_rng

    assert failed == {n for n, seed in enumerate(seeds) if default_rng(seed).random() < 0.5}
    assert failed == {0}
    assert len(results(tmp_path / "sweep")) == 3
    assert done.returncode != 0
    assert "1 of 4 jobs failed" in done.stderr
    assert "Traceback" not in done.stderr + done.stdout
    message = "ZeroDivisionError: the third step divides by the width of nothing"
    for number in failed:
        assert ends[number]["message"] == message
        assert f"optimizer=stumbles seed={seeds[number]}" in done.stdout
        assert "in search" in (tmp_path / "sweep" / str(number) / "traceback.txt").read_text()
    assert done.stdout.count(message) == len(failed)
    parent = json.loads((tmp_path / "sweep" / "sweep.json").read_text())["run"]
    assert ask(tmp_path, f"select status from runs where run_uuid = '{parent}'") == [("FAILED",)]

    assert "3 of them are finished and kept" in again.stdout
    assert json.loads((tmp_path / "sweep" / "sweep.json").read_text())["run"] == parent
    assert len(ask(tmp_path, "select run_uuid from runs")) == 1 + 3


def test_a_bad_value_fails_its_job_with_the_same_sentence_as_alone(tmp_path):
    done = run_command(
        "-m",
        *SILENT,
        ONE,
        "optimizer=ssa",
        "optimizer.producers=0.2,3",
        "seed=0",
        HERE,
        cwd=tmp_path,
    )
    assert done.returncode != 0
    sentence = "optimizer.producers=3.0 is out of range: it must be at least 0 and at most 1"
    assert statuses(tmp_path / "sweep")[1]["message"] == sentence
    assert sentence in done.stdout
    assert not (tmp_path / "sweep" / "1" / "traceback.txt").exists()
    assert len(results(tmp_path / "sweep")) == 1


@needs_dask
def test_a_worker_without_a_shared_disk_is_sent_the_records_and_returns_results_and_logs(
    logged, tmp_path
):
    """The worker, reached by TCP, has a folder of its own: no records, and another store.

    It ends with the same bits as processes of this computer.
    """
    from distributed import LocalCluster

    away, here = tmp_path / "away", tmp_path / "here"
    away.mkdir()
    here.mkdir()
    shipped = Path(__file__).parents[2] / "tractexp" / "data"
    for ending in ("csv", "json"):
        shutil.copy(shipped / f"tibet_50pct.{ending}", here / f"dip.{ending}")
    with LocalCluster(n_workers=0, dashboard_address=None, protocol="tcp") as cluster:
        command = [sys.executable, "-m", "distributed.cli.dask_worker", cluster.scheduler_address]
        worker = subprocess.Popen(
            [*command, "--nthreads", "1", "--no-dashboard"], cwd=away, stderr=subprocess.DEVNULL
        )
        try:
            address = f"hydra.launcher.address={cluster.scheduler_address}"
            records = ("data=csv", "data.train=[dip.csv]", "seed=0,1", "optimizer=pso")
            done = tractexp(
                *("-m", *QUICK, *records, "hydra/launcher=dask", address, HERE), cwd=here
            )
        finally:
            worker.terminate()
            worker.wait(60)
    assert done.returncode == 0, done.stderr
    assert not [path for path in away.rglob("*") if path.suffix in (".json", ".db", ".csv")]
    ends, ours = results(here / "sweep"), results(logged[1])
    assert ends.keys() == {("pso", 0), ("pso", 1)}
    for of, content in ends.items():
        assert content["search"]["parameters"] == ours[of]["search"]["parameters"]
        assert content["history"] == ours[of]["history"]
    job = here / "sweep" / "0"
    assert {".hydra", "history.csv", "mlflow.json", "output.txt"} <= {p.name for p in job.iterdir()}
    assert f"  {job / 'result.json'}\n" in (job / "output.txt").read_text()
    parent = json.loads((here / "sweep" / "sweep.json").read_text())["run"]
    below = f"select 1 from tags where key = 'mlflow.parentRunId' and value = '{parent}'"
    assert len(ask(here, below)) == 2


def test_a_job_that_kills_its_worker_every_time_is_listed_and_the_others_finish(site, tmp_path):
    """Next to each there is one in work; one of them kills its worker the first time only. By an
    earlier spelling.
    """
    loky = (TWO, "hydra.launcher.backend=processes", "hydra.launcher.tries=2")
    sweep = (*SILENT, *loky, PLAIN, "seed=0", "optimizer=kills,pso,dies", HERE)
    done = tractexp("-m", *sweep, cwd=tmp_path, site=site)
    ends = statuses(tmp_path / "sweep")
    assert [ends[n]["status"] for n in range(3)] == ["failed", "finished", "finished"]
    assert (tmp_path / "marker").exists()
    assert "its worker was killed each of the 2 times it was run" in ends[0]["message"]
    assert done.stdout.count("its worker was killed each of the 2 times") == 1
    assert "1 of 3 jobs failed" in done.stderr


def test_results_are_the_same_bits_for_any_number_of_workers_and_backend(logged, tmp_path):
    """Of Dask the test of a worker without a shared disk tells it."""
    _, sweep, _ = logged
    threads = ("hydra.launcher.backend=threading", TWO)
    first = {of: content for of, content in results(sweep).items() if of[1] == 0}
    # two processes ran `logged`
    launchers = [("hydra.launcher.n_jobs=1",), threads, ("hydra/launcher=basic",)]
    for k, launcher in enumerate(launchers):
        command = (
            "-m",
            *QUICK,
            "tracking.enabled=false",
            *launcher,
            PLAIN,
            "optimizer=ssa,pso",
            "seed=0",
            f"hydra.sweep.dir=sweep{k}",
        )
        done = run_command(*command, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert results(tmp_path / f"sweep{k}") == first


@needs_submitit
def test_submitit_runs_jobs_in_tasks_isolates_a_failure_and_logs_below_the_parent(
    site, tmp_path, uri, monkeypatch
):
    """Three jobs in two tasks; one that fails does not touch the next in its task."""
    import clusters

    commands = tmp_path / "commands"
    commands.mkdir()
    clusters.write_commands(commands)
    monkeypatch.setenv("PATH", os.pathsep.join([str(commands), os.environ["PATH"]]))
    launcher = ("hydra/launcher=slurm", "hydra.launcher.timeout_min=3")
    sweep = ("-m", "budget=200", *launcher, "hydra.launcher.jobs_per_task=2", HERE)
    done = tractexp(*sweep, "optimizer=stumbles", "seed=2,1,4", cwd=tmp_path, site=site)
    from numpy.random import default_rng

    failed = [default_rng(seed).random() < 0.5 for seed in (2, 1, 4)]
    assert failed == [True, False, False]
    assert "1 of 3 jobs failed" in done.stderr, done.stderr
    assert "the third step divides by the width of nothing" in done.stdout
    ends = statuses(tmp_path / "sweep")
    assert [ends[k]["status"] == "failed" for k in range(3)] == failed
    tasks = {path.name for path in (tmp_path / "sweep" / ".submitit").glob("*/*_result.pkl")}
    assert tasks == {"9_0_0_result.pkl", "9_1_0_result.pkl"}
    parent = json.loads((tmp_path / "sweep" / "sweep.json").read_text())["run"]
    children = ask(
        tmp_path, f"select 1 from tags where key = 'mlflow.parentRunId' and value = '{parent}'"
    )
    assert len(children) == 2


def test_a_sweep_that_is_ended_keeps_what_is_finished_and_closes_its_parent(tmp_path, uri):
    """An interrupt raises the same `KeyboardInterrupt` (test_signals), by which it is closed."""
    short_and_endless = "budget=400,1000000000"
    command = [
        sys.executable,
        "-m",
        "tractexp",
        "-m",
        "optimizer=pso",
        "seed=0,1",
        short_and_endless,
        HERE,
    ]
    process = subprocess.Popen(
        [*command, "optimizer.iterations=20000000"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    states = lambda: {status["status"] for status in statuses(tmp_path / "sweep").values()}  # noqa: E731
    while process.poll() is None and states() != {"finished", "running"}:
        time.sleep(0.2)
    process.terminate()
    _, err = process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGTERM
    assert err.startswith("tractexp: the sweep is interrupted; repeat the command")
    assert err.count("\n") == 1, err
    ends = statuses(tmp_path / "sweep").values()
    assert {end["status"] for end in ends} == {"finished", "interrupted"}
    assert {end["message"] for end in ends} == {""}
    parent = json.loads((tmp_path / "sweep" / "sweep.json").read_text())["run"]
    assert ask(tmp_path, f"select status from runs where run_uuid = '{parent}'") == [("KILLED",)]
    assert len(ask(tmp_path, "select 1 from runs where status = 'FINISHED'")) >= 1


def test_workers_end_with_a_parent_that_is_killed():
    script = """
import time
from tractexp.process.workers import Workers
for _ in Workers(1, apart=True).run_items(time.sleep, [0, 600], 2):
    print(flush=True)
"""
    process = subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout.readline()  # the worker is there, and busy for ten minutes
    process.kill()
    process.communicate(timeout=60)  # returns when nobody holds the output any more


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (
            ["seed=range(3,3)"],
            "the sweep has no jobs: seed=range(3,3) is empty; a range ends"
            " before its second number",
        ),
        (
            ["optimizer.producers=interval(0,1)"],
            "optimizer.producers=interval(0,1): a sweep over a grid needs values",
        ),
        (["optimizer=glob(nothing*)"], "the sweep has no jobs: optimizer=glob(nothing*) is empty"),
        (
            ["hydra.launcher.backend=threads"],
            "hydra.launcher.backend=threads is not one of dask, loky, multiprocessing, ray,"
            " sequential, threading",
        ),
        (
            ["hydra.launcher.n_jobs=0"],
            "hydra.launcher.n_jobs=0 is out of range: it must be at least 1",
        ),
        pytest.param(
            ["hydra/launcher=slurm", "hydra.launcher.jobs_per_task=0"],
            "hydra.launcher.jobs_per_task=0 is out of range: it must be at least 1",
            marks=needs_submitit,
        ),
        (["optimizer=issa,isa"], "optimizer=isa: there is no such choice; did you mean 'issa'?"),
        (["seed=1,abc"], "seed=abc is not a whole number"),
        (
            ["optimizer.populatoin=9,10"],
            "'optimizer' has no key 'populatoin'; did you mean 'population'?",
        ),
    ],
)
def test_a_sweep_that_cannot_be_is_refused_in_one_sentence_before_it_starts(
    arguments, sentence, tmp_path
):
    done = run_command("-m", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert sentence in done.stderr
    assert done.stderr.startswith("tractexp: ")
    assert done.stderr.count("\n") == 1, done.stderr
    assert not (tmp_path / "outputs").exists()


def test_an_unreachable_dask_scheduler_is_named(tmp_path, monkeypatch):
    address = ("hydra/launcher=dask", "hydra.launcher.address=tcp://127.0.0.1:9")
    if importlib.util.find_spec("distributed") is None:
        sentence = (
            "hydra.launcher.backend=dask needs Dask, which is not installed: pip install"
            " 'tractexp[dask]'"
        )
    else:
        import distributed

        client = distributed.Client
        monkeypatch.setattr(
            distributed, "Client", lambda address, timeout: client(address, timeout="1s")
        )
        sentence = "hydra.launcher.address=tcp://127.0.0.1:9: no Dask scheduler answers there"
    done = run_command("-m", *SILENT, *address, cwd=tmp_path)
    assert done.returncode == 2
    assert sentence in done.stderr


def test_an_experiment_is_a_sweep_by_itself_of_thirty_seeds(tmp_path):
    """No record is named, so that every job is composed, refused, and takes no time."""
    asked = ("experiment=ablation", "tracking.enabled=false", "data=csv", "budget=1000", ONE, HERE)
    told = run_command(*asked, "--cfg", "hydra", "-p", "hydra.sweeper.params", cwd=tmp_path)
    assert "seed: range(0,30)" in told.stdout.splitlines()
    done = run_command(*asked, "seed=7,29", cwd=tmp_path)
    assert done.returncode != 0
    ends = statuses(tmp_path / "sweep").values()
    seeds = {}
    for end in ends:
        seeds.setdefault(end["choices"]["optimizer"], []).append(end["seed"])
    assert {"issa", "ssa"} <= seeds.keys()
    assert len(seeds) == 16
    assert all(sorted(found) == [7, 29] for found in seeds.values())
    assert all("data.train" in end["message"] for end in ends)


def test_settings_of_one_optimizer_are_not_pooled_under_its_name(tmp_path):
    sweep = (
        "-m",
        "optimizer=pso,random_search",
        "budget=100,200",
        "model.fixed.q_v=3",
        HERE,
    )
    done = run_command(*sweep, ONE, "tracking.enabled=false", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    names = [
        line.strip().split("  ")[0]
        for line in done.stdout.splitlines()
        if re.match(r" *\w+ budget=\d+  ", line)
    ]
    assert sorted(names) == [
        f"{name} budget={n}" for name in ("pso", "random_search") for n in (100, 200)
    ]


@pytest.mark.parametrize(
    ("chosen", "name"),
    [
        (
            {
                "optimizer": "issa",
                "seed": "3",
                "task": "identify",
                "tracking.uri": "sqlite:///x.db",
            },
            "issa",
        ),
        (
            {"optimizer.levy": "false", "optimizer.gaussian": "true", "seed": "0"},
            "issa gaussian=true levy=false",
        ),
        (
            {"model": "third_order_zip", "budget": "500", "data": "csv"},
            "issa budget=500 model=third_order_zip",
        ),
        ({"data.train": "[/home/me/dip1.csv,b/dip2.csv]"}, "issa data.train=[dip1.csv,dip2.csv]"),
    ],
)
def test_a_variant_is_named_after_what_was_chosen_but_the_seed(chosen, name):
    from tractexp.api.job import name_variant

    assert name_variant("issa", chosen) == name


def test_jobs_that_were_interrupted_are_counted_apart_from_those_that_failed(tmp_path):
    from tractexp.sweep.parent import compute_metrics
    from tractexp.sweep.status import Status

    class Placed:
        def __init__(self, folder):
            self.folder = folder

    jobs = [Placed(tmp_path / str(k)) for k in range(4)]
    for job, status in zip(jobs, ("finished", "failed", "interrupted", "interrupted"), strict=True):
        Status(status, "", "", "", 1.0, {}, 0).end(job.folder)
    assert compute_metrics(jobs) == {
        "jobs": 4,
        "jobs_finished": 1,
        "jobs_failed": 1,
        "jobs_interrupted": 2,
    }


def test_what_an_earlier_sweep_came_to_goes_before_its_configuration(tmp_path):
    (tmp_path / "sweep").mkdir()
    for name in ("comparison.html", "comparison.json", "multirun.yaml", "notes.txt"):
        (tmp_path / "sweep" / name).write_text("of an earlier sweep")
    budget = (
        "budget=200",
        "optimizer=multistart_least_squares",
        "tracking.enabled=false",
        "seed=1,2",
    )
    done = run_command("-m", *budget, "hydra.launcher.backend=threading", HERE, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    names = {p.name for p in (tmp_path / "sweep").iterdir()}
    assert names == {"0", "1", "multirun.yaml", "notes.txt", "sweep.html"}
    assert (tmp_path / "sweep" / "multirun.yaml").read_text() != "of an earlier sweep"


def test_a_folder_that_a_full_disk_left_empty_is_the_jobs_again_and_nobody_elses_is_touched(
    tmp_path,
):
    from tractexp.sweep.job import SweepJob
    from tractexp.sweep.placing import place

    jobs = [SweepJob({"seed": k}, {}, (), f"job {k}", "", Path()) for k in range(4)]
    (tmp_path / "0" / ".hydra").mkdir(parents=True)  # a kill before it said what it is
    (tmp_path / "1").mkdir()
    jobs[2].status.begin(tmp_path / "1")  # another job of an earlier sweep
    (tmp_path / "2").mkdir()
    (tmp_path / "2" / "mine.txt").write_text("not a job")
    (tmp_path / "4").write_text("nor is this")
    assert [job.folder.name for job in place(jobs, tmp_path)] == ["0", "3", "1", "5"]
    assert [job.folder.name for job in place(jobs, tmp_path / "new")] == ["0", "1", "2", "3"]


@pytest.mark.parametrize(("error", "sends"), [(None, 1), (RuntimeError, 1), (KeyboardInterrupt, 0)])
def test_who_ends_a_sweep_does_not_wait_while_what_is_left_is_sent(
    error, sends, tmp_path, monkeypatch
):
    """To look for each of 2,000 finished jobs in the store takes a minute."""
    from types import SimpleNamespace

    from tractexp import tracking
    from tractexp.sweep import parent

    run, closed, sent = tracking.TrackedRun("experiment", "sweep", {}), [], []
    monkeypatch.setattr(parent, "_describe_sweep", lambda *_: run)
    monkeypatch.setattr(parent, "_open_parent_run", lambda *_: "id")
    monkeypatch.setattr(
        parent, "_close_parent_run", lambda folder, run, *_: closed.append(run.status)
    )
    monkeypatch.setattr(parent, "_send", lambda *_: sent.append(closed[-1]))
    jobs = [
        SimpleNamespace(
            config={"tracking": {"enabled": True, "uri": "sqlite:///x.db"}}, folder=tmp_path / "0"
        )
    ]
    with (
        contextlib.suppress(RuntimeError, KeyboardInterrupt),
        parent.open_parent_run(tmp_path, jobs, [], afresh=False),
    ):
        if error:
            raise error
    assert closed == ["KILLED" if error is KeyboardInterrupt else "FAILED"]
    assert len(sent) == sends


def test_what_the_jobs_of_a_sweep_share_is_spelled_once_for_each(monkeypatch):
    """Once for every setting of every job took half a minute before a sweep of 2,000 began."""
    from tractexp import tracking
    from tractexp.sweep.parent import list_shared_settings

    flatten, spelled = tracking.flatten, []
    monkeypatch.setattr(
        tracking, "flatten", lambda config: (spelled.append(config), flatten(config))[1]
    )
    configs = [{"seed": k, "optimizer": {"name": "pso", "population": 20}} for k in range(5)]
    assert list_shared_settings(configs) == {"optimizer.name": "pso", "optimizer.population": "20"}
    assert len(spelled) == len(configs)


HOLDERS = """
import pathlib, subprocess, sys
from hydra.experimental.callback import Callback

ASK = (
    "from pathlib import Path; from tractexp.storage.run_folder import find_holder;"
    "print(find_holder(Path('sweep')).partition(' on ')[0])"
)

class Holders(Callback):
    \"\"\"Notes who holds the sweep as each job starts, as another process sees it.\"\"\"

    def on_job_start(self, config, **more):
        seen = subprocess.run([sys.executable, "-c", ASK], capture_output=True, text=True)
        pathlib.Path(f"holder{config.hydra.job.num}").write_text(seen.stdout)
"""


# Hydra 1.4 says of a callback of anybody's that a list of what may be called is to come
@pytest.mark.filterwarnings("ignore:(?s).*execution_whitelist")
@pytest.mark.parametrize(
    ("sweeper", "asked"),
    [
        ("basic", ["hydra.sweeper.max_batch_size=1", "seed=1,2"]),
        ("optuna", ["hydra.sweeper.n_trials=2", "hydra.sweeper.n_jobs=1", "seed=choice(1,2)"]),
    ],
)
def test_each_batch_of_another_sweeper_holds_the_folder(sweeper, asked, tmp_path, monkeypatch):
    if sweeper != "basic":
        pytest.importorskip(f"hydra_plugins.hydra_{sweeper}_sweeper", reason="not installed")
    (tmp_path / "holders_of_a_sweep.py").write_text(HOLDERS)
    monkeypatch.syspath_prepend(tmp_path)
    note = "+hydra.callbacks.h={_target_: holders_of_a_sweep.Holders}"
    done = run_command(
        "-m",
        *QUICK,
        "tracking.enabled=false",
        f"hydra/sweeper={sweeper}",
        "hydra.launcher.backend=sequential",
        HERE,
        note,
        "optimizer=pso",
        *asked,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    holders = [(tmp_path / f"holder{k}").read_text().strip() for k in range(2)]
    assert holders == [f"process {os.getpid()}"] * 2
    assert not list((tmp_path / "sweep").glob(".tractexp.*lock"))
