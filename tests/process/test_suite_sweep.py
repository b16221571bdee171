"""`tractexp experiment=benchmark`: the benchmark as a plugin package, swept, logged and shown."""

import json
import os
import sqlite3
import subprocess
import sys
from pathlib import Path

SUITE = Path(__file__).parents[2] / "benchmarks" / "suite"


def test_methods_and_cases_are_jobs_of_a_sweep_and_what_is_wrong_is_a_sentence(tmp_path):
    record = tmp_path / "site" / "tractexp_suite-1.0.dist-info"
    record.mkdir(parents=True)
    (record / "METADATA").write_text("Metadata-Version: 2.1\nName: tractexp-suite\nVersion: 1.0\n")
    (record / "entry_points.txt").write_text("[tractexp.plugins]\nsuite = tractexp_suite\n")
    paths = [str(SUITE), str(record.parent)]
    store = tmp_path / "mlflow.db"
    done = subprocess.run(
        [
            *(sys.executable, "-m", "tractexp", "experiment=benchmark"),
            *("task.method=linear_network,nowhere", "task.case=51"),
            *(f"tracking.uri=sqlite:///{store}", "hydra.sweep.dir=here"),
            "hydra.launcher.n_jobs=1",
        ],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(paths), "COLUMNS": "200"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2, done.stderr
    assert "there is no such Python file; give the path of a method" in done.stdout
    row = json.loads((tmp_path / "here" / "0" / "suite.json").read_text(encoding="utf-8"))
    assert (row["method"], row["case"], row["truth"]) == (
        "linear_network",
        51,
        ["stator_transients"],
    )
    with sqlite3.connect(store) as kept:
        logged = dict(kept.execute("select key, value from latest_metrics"))
    assert logged["error_median"] == row["dips"][0]["error"]
