"""Comparisons of runs that lie in MLflow, and the page that `tractexp ui` opens on."""

import base64
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import free_port, run_command
from test_compare import samples, write_sweep

from tractexp import tracking
from tractexp.errors import UserError
from tractexp.studies.comparison import load
from tractexp.tracking.find import find
from tractexp.tracking.run import attach
from tractexp.tracking.view import TAG, store_comparison_view

EXPERIMENT = "identify tibet_50pct"
SCREENSHOT = Path(__file__).parents[2] / "outputs" / "mlflow_comparison.png"


def log(uri, run, parent=None, variant=None, **tags):
    """Log a run as `task=identify` does: the estimate, half as far off as the search that it is
    polished from.
    """
    ended = {key: getattr(run, key) for key in ("objective", "epsilon_p", "epsilon_q")}
    ended |= {"seconds": run.seconds[-1], "simulations": run.simulations[-1]}
    metrics = {key: 0.5 * value for key, value in ended.items()} | {
        f"search_{k}": v for k, v in ended.items()
    }
    variant = variant or run.optimizer
    logged = tracking.TrackedRun(
        EXPERIMENT,
        f"{run.optimizer} seed {run.seed}",
        parameters=tracking.flatten(run.config),
        metrics=metrics,
        curves={
            "fitness": (np.arange(len(run.history)), run.history),
            "fitness_by_simulations": (run.simulations, run.history),
        },
        tags={
            "task": "identify",
            "optimizer": run.optimizer,
            "data": run.data,
            "seed": str(run.seed),
            "variant": variant,
            **tags,
        },
        parent=parent,
    )
    return tracking.log(logged, uri)


@pytest.fixture(scope="module")
def filled(tmp_path_factory, empty_store):
    """A folder with a store: a sweep of two variants and its own run, which is no
    identification.
    """
    folder = tmp_path_factory.mktemp("filled")
    (folder / "outputs").mkdir()
    shutil.copy(empty_store, folder / "outputs")
    uri = tracking.find_default_uri(folder)
    parent = tracking.start_parent(
        tracking.TrackedRun(EXPERIMENT, "sweep", tags={"task": "identify"}), uri
    )
    runs = samples({"issa": 1.0, "ssa": 3.0}, seeds=range(8))
    for run in runs:
        log(uri, run, parent)
    tracking.finish_parent(parent, uri, "FINISHED")
    return folder, uri, parent, runs


def compare_command(*arguments, cwd):
    return run_command("task=compare", *arguments, cwd=cwd)


def test_runs_come_back_from_mlflow_as_they_went_in(filled):
    _, uri, parent, runs = filled
    found = find(uri, "tags.data = 'tibet_50pct'")
    assert [run.tags["mlflow.parentRunId"] for run in found] == [parent] * len(runs)
    back = load.read_logged(found, "the filter")
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


def test_more_runs_than_a_page_holds_come_all_and_oldest_first(filled, monkeypatch):
    _, uri, _, runs = filled
    whole = [run.run_id for run in find(uri, "tags.data = 'tibet_50pct'", curves=())]
    monkeypatch.setattr("tractexp.tracking.owner.PAGE", 3)
    assert [run.run_id for run in find(uri, "tags.data = 'tibet_50pct'", curves=())] == whole
    assert len(set(whole)) == len(runs) > 2 * 3


def test_the_command_compares_what_a_filter_finds_and_logs_the_page(filled):
    folder, uri, _, _ = filled
    done = compare_command(
        "task.filter=\"tags.data = 'tibet_50pct'\"", "hydra.run.dir=out", cwd=folder
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert (
        "issa has the lowest median objective; it is significantly better than ssa." in done.stdout
    )
    (run,) = find(uri, "tags.task = 'compare'")
    assert (run.experiment, run.tags["data"]) == ("compare tibet_50pct", "tibet_50pct")
    from mlflow import MlflowClient

    assert {f.path for f in MlflowClient(uri).list_artifacts(run.run_id)} == {
        "comparison.html",
        "comparison.json",
    }
    # the comparison is none of them
    assert len(load.read_logged(find(uri, "tags.data = 'tibet_50pct'"), "x")) == 16


def test_the_page_of_a_sweep_is_added_to_the_run_of_the_sweep(filled):
    folder, uri, parent, runs = filled
    write_sweep(folder / "swept", runs)
    (folder / "swept" / "sweep.json").write_text(json.dumps({"run": parent}))
    done = compare_command("task.sweep=swept", "hydra.run.dir=out2", cwd=folder)
    assert (done.returncode, done.stderr) == (0, "")
    assert "logged on the run of the sweep" in done.stdout
    from mlflow import MlflowClient

    assert {f.path for f in MlflowClient(uri).list_artifacts(parent)} == {
        "comparison.html",
        "comparison.json",
    }
    assert MlflowClient(uri).get_run(parent).info.status == "FINISHED"
    assert not attach("0" * 32, uri, [])


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (
            ("task.filter=\"tags.data = 'no'\"",),
            "the filter tags.data = 'no' matches no run of task=identify",
        ),
        (("task.filter=nonsense",), "task.filter=nonsense is not a filter that MLflow understands"),
        (
            ("task.filter=\"tags.seed = '1'\"", "tracking.experiment=identify"),
            "has no experiment 'identify'; did",
        ),
    ],
)
def test_a_filter_that_finds_nothing_is_one_sentence(filled, arguments, sentence):
    done = compare_command(*arguments, cwd=filled[0])
    assert done.returncode == 2
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_run_that_failed_in_mlflow_is_a_failure(filled):
    _, uri, _, _ = filled
    (one,) = find(uri, "tags.seed = '3' and tags.optimizer = 'ssa'")
    (run,) = load.read_logged([replace(one, status="FAILED")], "x")
    assert (run.failure, run.interruption) == ("its status in MLflow is FAILED", "")
    for status in ("KILLED", "RUNNING", "SCHEDULED"):
        (run,) = load.read_logged([replace(one, status=status)], "x")
        assert (run.failure, run.interruption) == ("", f"its status in MLflow is {status}")
    with pytest.raises(UserError, match="matches no run of task=identify"):
        load.read_logged([], "the filter")


def viewed(uri, mode="CHART"):
    """The view that is stored in the newest experiment."""
    page = store_comparison_view(uri)
    experiment = re.fullmatch(
        rf"#/experiments/(\d+)/runs\?viewStateShareKey=tractexp&compareRunsMode={mode}"
        r"&workflowType=machine_learning",
        page,
    )[1]
    from mlflow import MlflowClient

    kind, _, packed = MlflowClient(uri).get_experiment(experiment).tags[TAG].partition(";")
    assert kind == "deflate"
    return json.loads(zlib.decompress(base64.b64decode(packed)))


def test_the_view_groups_by_variant_and_draws_fitness_curves(filled):
    state = viewed(filled[1])
    assert state["groupBy"] == {
        "aggregateFunction": "average",
        "groupByKeys": [{"mode": "tag", "groupByData": "variant"}],
    }
    assert state["groupsExpanded"] == {"tag.variant.issa": False, "tag.variant.ssa": False}
    charts = {chart["metricKey"]: chart for chart in state["compareRunCharts"]}
    assert list(charts)[:2] == ["fitness_by_simulations", "fitness"]
    for metric in (
        "fitness_by_simulations",
        "fitness",
        "search_objective",
        "objective",
        "epsilon_p",
        "epsilon_q",
    ):
        assert charts[metric]["scaleType"] == "log", metric
    columns = [name.strip("`") for name in state["selectedColumns"]]
    for name in ("objective", "epsilon_p", "epsilon_q", "search_objective"):
        assert f"metrics.`{name}" in columns


def test_the_view_of_a_station_is_a_table_of_its_loads_that_sorts_by_model_error(uri):
    """Averages over loads would mean nothing."""
    for run, feeder in zip(
        samples({"issa": 1.0}, seeds=range(2)),
        ("North, T1, dip 1", "North, T2, dip 1"),
        strict=True,
    ):
        log(uri, run, load=feeder)
    assert store_comparison_view(uri).endswith(
        "&compareRunsMode=TABLE&workflowType=machine_learning"
    )
    state = viewed(uri, "TABLE")
    assert state["groupBy"] is None
    assert state["orderByKey"] == "metrics.`model_error`"
    assert [column.split("`")[1] for column in state["selectedColumns"]][:5] == [
        "model_error",
        "model_error_held_out",
        "model_error_over_linear_network",
        "epsilon_p",
        "epsilon_q",
    ]
    assert "tags.`load`" in state["selectedColumns"]


def test_two_settings_of_one_optimizer_are_two_groups_of_the_view(uri):
    for run, variant in zip(
        samples({"issa": 1.0}, seeds=range(2)), ("issa", "issa population=30"), strict=True
    ):
        log(uri, run, variant=variant)
    assert set(viewed(uri)["groupsExpanded"]) == {
        "tag.variant.issa",
        "tag.variant.issa population=30",
    }


def test_runs_logged_before_variants_had_a_tag_are_grouped_by_optimizer_too(uri):
    run_id = log(uri, samples({"issa": 1.0}, seeds=range(1))[0])
    log(uri, samples({"ssa": 1.0}, seeds=range(1))[0])
    from mlflow import MlflowClient

    MlflowClient(uri).delete_tag(run_id, "variant")
    assert [key["groupByData"] for key in viewed(uri)["groupBy"]["groupByKeys"]] == [
        "variant",
        "optimizer",
    ]


def test_files_of_a_run_tell_what_its_metrics_do_not(tmp_path, uri):
    """The parameters that the search ended at, and its seconds; without the files the curve stands
    in.
    """
    (run,) = samples({"issa": 1.0}, seeds=range(1))
    search = {"parameters": {"C": 0.7}, "per_event": {"T_m": [0.3, 0.4]}}
    (tmp_path / "result.json").write_text(json.dumps({"parameters": {"C": 0.9}, "search": search}))
    rows = [
        f"{k},{n:.0f},{0.02 * k:.4f},{f!r}"
        for k, (n, f) in enumerate(zip(run.simulations, run.history.tolist(), strict=True))
    ]
    (tmp_path / "history.csv").write_text(
        "\n".join(["iteration,simulations,seconds,objective", *rows])
    )
    tags = {"task": "identify", "optimizer": "issa", "data": "tibet_50pct", "seed": "0"}
    metrics = {
        "objective": 1.0,
        "search_objective": 2.0,
        "epsilon_p": 0.1,
        "epsilon_q": 0.1,
        "seconds": 9.0,
    }
    curves = {
        "fitness_by_simulations": tracking.resample_to_common_steps(run.simulations, run.history)
    }
    made = tracking.TrackedRun(
        EXPERIMENT,
        "r",
        {},
        metrics,
        curves,
        tags,
        [tmp_path / "result.json", tmp_path / "history.csv"],
    )
    tracking.log(made, uri)
    (logged,) = find(uri, "tags.seed = '0'")
    (back,) = load.read_logged([logged], "x")
    assert back.parameters == {"C": 0.7, "T_m[1]": 0.3, "T_m[2]": 0.4}
    assert back.objective == 2.0
    np.testing.assert_array_equal(back.history, run.history)
    np.testing.assert_allclose(back.seconds, 0.02 * np.arange(len(run.history)))
    (bare,) = load.read_logged([replace(logged, files={})], "x")
    assert bare.parameters == {}
    assert bare.history[-1] == run.history[-1]


def test_a_page_logged_elsewhere_is_told_how_to_be_seen(tmp_path, empty_store):
    """The settings that differ name the variants, also where MLflow takes no sign of equality."""
    shutil.copy(empty_store, tmp_path / "x.db")
    runs = [
        replace(r, config=r.config | {"optimizer.population": n})
        for n in (30, 50)
        for r in samples({"issa": 1.0}, seeds=range(6))
    ]
    write_sweep(tmp_path / "swept", runs)
    done = compare_command(
        "task.sweep=swept", "hydra.run.dir=out", "tracking.uri=sqlite:///x.db", cwd=tmp_path
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "to see it: tractexp ui --uri sqlite:///x.db" in done.stdout
    (run,) = find(tracking.resolve_address(f"sqlite:///{tmp_path}/x.db"), "tags.task = 'compare'")
    assert set(run.metrics) == {"median issa population:30", "median issa population:50"}


def test_a_store_without_identifications_opens_on_what_it_has(uri):
    """Never on MLflow's plain address, which opens a page on language models."""
    assert store_comparison_view(uri) == "#/experiments?workflowType=machine_learning"
    tracking.log(tracking.TrackedRun("discrepancy", "r"), uri)
    assert re.fullmatch(
        r"#/experiments/\d+/runs\?viewStateShareKey=tractexp&compareRunsMode=TABLE"
        "&workflowType=machine_learning",
        store_comparison_view(uri),
    )


def test_a_view_that_cannot_be_stored_opens_on_the_list_of_experiments(monkeypatch, capsys):
    from tractexp.cli import ui
    from tractexp.tracking import view

    def refuse(uri):
        raise UserError("the store is of another version")

    monkeypatch.setattr(view, "store_comparison_view", refuse)
    assert ui._find_start_page("sqlite:///x.db") == view.EXPERIMENTS
    assert (
        "because the comparison view could not be stored: the store is of another version"
        in capsys.readouterr().out
    )


@pytest.mark.long  # a browser and a server of MLflow
@pytest.mark.skipif(os.name == "nt", reason="ends the server by a signal")
def test_the_page_opened_shows_the_comparison(filled, tmp_path):
    """In a real browser: what is promised of `tractexp ui`. The screenshot stays in outputs/."""
    browser = (
        shutil.which("chromium")
        or shutil.which("google-chrome")
        or shutil.which("chromium-browser")
    )
    if browser is None:
        pytest.skip("no Chromium on this machine")
    folder, _, _, _ = filled
    port = free_port()
    with (tmp_path / "log").open("w") as output:
        command = [sys.executable, "-m", "tractexp", "ui", "--port", str(port)]
        server = subprocess.Popen(command, cwd=folder, stdout=output, stderr=output)
    try:
        page = address(server, tmp_path / "log")
        arguments = [
            browser,
            "--headless=new",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-quic",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            f"--user-data-dir={tmp_path / 'profile'}",
            "--virtual-time-budget=300000",
            "--window-size=1900,1100",
        ]
        SCREENSHOT.parent.mkdir(exist_ok=True)
        command = [*arguments, "--dump-dom", f"--screenshot={SCREENSHOT}", page]
        seen = subprocess.run(command, capture_output=True, text=True, timeout=240, check=True)
    finally:
        server.send_signal(signal.SIGTERM)
        server.wait(30)
    words = re.sub(r"<[^>]*>", " ", seen.stdout)
    for part in (
        "Group: issa",
        "Group: ssa",
        "Group by: variant",
        "fitness_by_simulations",
        "16 matching runs",
    ):
        assert part in re.sub(r"\s+", " ", words), part
    assert "issa (fitness)" in words  # a curve by optimizer, in the legend
    assert SCREENSHOT.stat().st_size > 50_000


def address(server, log):
    for _ in range(600):
        found = re.search(r"(?<=ready after ).*?(http://\S+)", log.read_text())
        if found:
            return found[1]
        assert server.poll() is None, log.read_text()
        time.sleep(0.1)
    raise AssertionError(log.read_text())
