"""Station, load, time and base go along: console, page, result.json, and MLflow's names."""

import json
import sqlite3
from contextlib import closing

import pytest
from command_line import run_command

from tractexp.data import __file__ as data

LOAD = "synthetic stand-in; not measured, V/v 27.5 kV"
RECORDING = (
    "data=comtrade",
    f"data.path={data.replace('__init__.py', 'tibet_50pct.cfg')}",
    "data.voltages=[UAB,UBC]",
    "data.currents=[IA,IC]",
    "data.connection={name: two_line_voltages, phases: ac}",
)
QUICK = ("optimizer=multistart_least_squares", "optimizer.starts=2", "hydra.run.dir=run")


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    folder = tmp_path_factory.mktemp("identity")
    done = run_command(*RECORDING, *QUICK, "--all", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder, done.stdout


def test_the_console_says_the_load_and_its_base_before_anything_is_searched(job):
    lines = job[1].splitlines()
    assert lines[0].startswith("fit: ")
    for part in (
        "station synthetic stand-in",
        "load V/v 27.5 kV",
        "voltages UAB, UBC",
        "currents IA, IC",
        "time 2024-01-01T00:00:00",
        "per unit of ",
        " kV and ",
        " MVA",
    ):
        assert part in lines[1], part


def test_result_and_page_say_it(job):
    folder = job[0] / "run"
    (record,) = json.loads((folder / "result.json").read_text(encoding="utf-8"))["records"]
    assert (record["source"]["load"], record["source"]["time"]) == (
        "V/v 27.5 kV",
        "2024-01-01T00:00:00",
    )
    page = (folder / "report.html").read_text(encoding="utf-8")
    title = page.partition("<title>")[2].partition("</title>")[0]
    assert title.startswith(f"Identification of {LOAD}: ")
    lead = page.partition('<p class="lead">')[2].partition("</p>")[0]
    assert (
        f"per unit of {record['base']['voltage_kV']:.6g} kV and {record['base']['power_MVA']:.6g}"
        " MVA" in lead
    )


def test_mlflow_has_one_experiment_for_a_station_and_names_load_dip_and_model(job):
    with closing(sqlite3.connect(job[0] / "outputs" / "mlflow.db")) as base:
        assert ("station synthetic stand-in; not measured",) in base.execute(
            "select name from experiments"
        ).fetchall()
        assert base.execute("select name from runs").fetchall() == [
            (f"{LOAD}, dip 1, third_order_exponential",)
        ]
        assert ("load", f"{LOAD}, dip 1") in base.execute("select key, value from tags").fetchall()
