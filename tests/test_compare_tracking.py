"""Comparisons of runs that lie in MLflow, and the page that `tractexp ui` opens on."""

import base64
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import zlib
from pathlib import Path

import numpy as np
import pytest
from test_compare import samples, write_sweep

from tractexp import tracking
from tractexp.comparison import load
from tractexp.errors import UserError
from tractexp.tracking.attach import attach
from tractexp.tracking.find import find
from tractexp.tracking.view import TAG, comparison_view

EXPERIMENT = "identify tibet_50pct"
SCREENSHOT = Path(__file__).parents[1] / "outputs" / "mlflow_comparison.png"


def log(uri, run, parent=None):
    """Log a run as `task=identify` does."""
    metrics = {key: getattr(run, key) for key in ("objective", "epsilon_p", "epsilon_q")}
    logged = tracking.Run(
        EXPERIMENT,
        f"{run.optimizer} seed {run.seed}",
        parameters=tracking.flatten(run.config),
        metrics=metrics | {"seconds": run.seconds[-1]},
        curves={
            "fitness": (np.arange(len(run.history)), run.history),
            "fitness_by_simulations": (run.simulations, run.history),
        },
        tags={"task": "identify", "optimizer": run.optimizer, "data": run.data, "seed": str(run.seed)},
        parent=parent,
    )
    return tracking.log(logged, uri)


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """A folder with a store: a sweep of two variants and its own run, which is no identification."""
    folder = tmp_path_factory.mktemp("filled")
    uri = tracking.default_uri(folder)
    parent = tracking.start_parent(tracking.Run(EXPERIMENT, "sweep", tags={"task": "identify"}), uri)
    runs = samples({"issa": 1.0, "ssa": 3.0}, seeds=range(8))
    for run in runs:
        log(uri, run, parent)
    tracking.finish_parent(parent, uri, "FINISHED")
    return folder, uri, parent, runs


def tractexp(*arguments, cwd):
    command = [sys.executable, "-m", "tractexp", "task=compare", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, env=os.environ | {"COLUMNS": "140"})


def test_runs_come_back_from_mlflow_as_they_went_in(filled):
    _, uri, parent, runs = filled
    found = find(uri, "tags.data = 'tibet_50pct'")
    assert [run.tags["mlflow.parentRunId"] for run in found] == [parent] * len(runs)
    back = load.from_logged(found, "the filter")
    for one, other in zip(runs, back, strict=True):
        assert (one.optimizer, one.seed, one.data) == (other.optimizer, other.seed, other.data)
        assert one.objective == other.objective
        np.testing.assert_array_equal(one.simulations, other.simulations)
        np.testing.assert_array_equal(one.history, other.history)
        np.testing.assert_allclose(one.seconds, other.seconds)
        assert other.config["optimizer.name"] == one.optimizer
        assert other.config["budget"] is None


def test_a_filter_takes_a_part_of_the_runs(filled):
    _, uri, _, _ = filled
    assert len(find(uri, "tags.optimizer = 'ssa' and metrics.objective < 1")) == 8
    assert len(find(uri, "tags.seed = '3'", EXPERIMENT)) == 2
    assert find(uri, "tags.seed = '99'") == []


def test_the_command_compares_what_a_filter_finds_and_logs_the_page(filled):
    folder, uri, _, _ = filled
    done = tractexp("task.filter=\"tags.data = 'tibet_50pct'\"", "hydra.run.dir=out", cwd=folder)
    assert (done.returncode, done.stderr) == (0, "")
    assert "issa has the lowest median objective; it is significantly better than ssa." in done.stdout
    (run,) = find(uri, "tags.task = 'compare'")
    assert (run.experiment, run.tags["data"]) == ("compare tibet_50pct", "tibet_50pct")
    from mlflow import MlflowClient

    assert {f.path for f in MlflowClient(uri).list_artifacts(run.run_id)} == {"comparison.html", "comparison.json"}
    assert len(load.from_logged(find(uri, "tags.data = 'tibet_50pct'"), "x")) == 16  # the comparison is none of them


def test_the_page_of_a_sweep_is_added_to_the_run_of_the_sweep(filled):
    folder, uri, parent, runs = filled
    write_sweep(folder / "swept", runs)
    (folder / "swept" / "sweep.json").write_text(json.dumps({"run": parent}))
    done = tractexp("task.sweep=swept", "hydra.run.dir=out2", cwd=folder)
    assert (done.returncode, done.stderr) == (0, "")
    assert "logged on the run of the sweep" in done.stdout
    from mlflow import MlflowClient

    assert {f.path for f in MlflowClient(uri).list_artifacts(parent)} == {"comparison.html", "comparison.json"}
    assert MlflowClient(uri).get_run(parent).info.status == "FINISHED"
    assert not attach("0" * 32, uri, [])


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("task.filter=\"tags.data = 'no'\"",), "the filter tags.data = 'no' matches no run of task=identify"),
        (("task.filter=nonsense",), "task.filter=nonsense is not a filter that MLflow understands"),
        (("task.filter=\"tags.seed = '1'\"", "tracking.experiment=identify"), "has no experiment 'identify'; did"),
    ],
)  # fmt: skip
def test_a_filter_that_finds_nothing_is_one_sentence(filled, arguments, sentence):
    done = tractexp(*arguments, cwd=filled[0])
    assert done.returncode == 2
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_run_that_failed_in_mlflow_is_a_failure(filled):
    _, uri, _, _ = filled
    (one,) = find(uri, "tags.seed = '3' and tags.optimizer = 'ssa'")
    (run,) = load.from_logged([type(one)(**{**vars(one), "status": "KILLED"})], "x")
    assert run.failure == "its status in MLflow is KILLED"
    with pytest.raises(UserError, match="matches no run of task=identify"):
        load.from_logged([], "the filter")


def test_the_view_groups_by_optimizer_and_draws_fitness_curves(filled):
    _, uri, _, _ = filled
    page = comparison_view(uri)
    experiment = re.fullmatch(r"#/experiments/(\d+)/runs\?viewStateShareKey=tractexp&compareRunsMode=CHART", page)[1]
    from mlflow import MlflowClient

    kind, _, packed = MlflowClient(uri).get_experiment(experiment).tags[TAG].partition(";")
    state = json.loads(zlib.decompress(base64.b64decode(packed)))
    assert kind == "deflate"
    assert state["groupBy"] == {
        "aggregateFunction": "average", "groupByKeys": [{"mode": "tag", "groupByData": "optimizer"}],
    }  # fmt: skip
    assert state["groupsExpanded"] == {"tag.optimizer.issa": False, "tag.optimizer.ssa": False}
    assert [chart["metricKey"] for chart in state["compareRunCharts"]][:2] == ["fitness_by_simulations", "fitness"]


def test_a_store_without_runs_opens_on_the_plain_page(tmp_path):
    uri = tracking.default_uri(tmp_path)
    tracking.prepare(uri)
    assert comparison_view(uri) == ""


def test_a_view_that_cannot_be_stored_opens_on_the_plain_page(monkeypatch, capsys):
    from tractexp.tasks import ui
    from tractexp.tracking import view

    def refuse(uri):
        raise UserError("the store is of another version")

    monkeypatch.setattr(view, "comparison_view", refuse)
    assert ui._page("sqlite:///x.db") == ""
    assert "because the comparison view could not be stored: the store is of another version" in capsys.readouterr().out


@pytest.mark.skipif(os.name == "nt", reason="ends the server by a signal")
def test_the_page_opened_shows_the_comparison(filled, tmp_path):
    """In a real browser: what is promised of `tractexp ui`. The screenshot stays in outputs/."""
    browser = shutil.which("chromium") or shutil.which("google-chrome") or shutil.which("chromium-browser")
    if browser is None:
        pytest.skip("no Chromium on this machine")
    folder, _, _, _ = filled
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with (tmp_path / "log").open("w") as output:
        command = [sys.executable, "-m", "tractexp", "ui", "--port", str(port)]
        server = subprocess.Popen(command, cwd=folder, stdout=output, stderr=output)
    try:
        page = address(server, tmp_path / "log")
        arguments = [
            browser, "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
            "--disable-background-networking", "--disable-component-update", "--disable-sync",
            f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=300000", "--window-size=1900,1100",
        ]  # fmt: skip
        SCREENSHOT.parent.mkdir(exist_ok=True)
        command = [*arguments, "--dump-dom", f"--screenshot={SCREENSHOT}", page]
        seen = subprocess.run(command, capture_output=True, text=True, timeout=240, check=True)
    finally:
        server.send_signal(signal.SIGTERM)
        server.wait(30)
    words = re.sub(r"<[^>]*>", " ", seen.stdout)
    for part in ("Group: issa", "Group: ssa", "Group by: optimizer", "fitness_by_simulations", "16 matching runs"):
        assert part in re.sub(r"\s+", " ", words), part
    assert "issa (fitness)" in words  # a curve by optimizer, in the legend
    assert SCREENSHOT.stat().st_size > 50_000


def address(server, log):
    for _ in range(600):
        found = re.search(r"http://\S+", log.read_text())
        if found:
            return found[0]
        assert server.poll() is None, log.read_text()
        time.sleep(0.1)
    raise AssertionError(log.read_text())
