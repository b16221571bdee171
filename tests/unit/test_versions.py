"""What was seen to run with other versions: every row that is stored ran whole."""

import json
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROWS = json.loads((ROOT / "benchmarks" / "versions.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("row", ROWS, ids=[f"{row['python']} {row['set']}" for row in ROWS])
def test_every_command_runs_with_these_versions(row):
    assert {*row["commands"].values()} == {"runs"}
    assert {"main job", "sweep", "investigation"} <= {*row["commands"]}


def test_candidates_of_hydra_and_omegaconf_were_tried():
    (row, *_) = (row for row in ROWS if row["set"] == "candidates")
    assert row["versions"]["hydra-core"].startswith("1.4")
    assert row["versions"]["omegaconf"].startswith("2.4")


def test_ci_runs_the_candidates_that_were_tried():
    if not (ROOT / ".ci").is_dir():
        pytest.skip("no checkout: .ci is not in the package")
    lines = (ROOT / ".ci" / "candidates.txt").read_text(encoding="utf-8").splitlines()
    pins = dict(line.split("==") for line in lines if not line.startswith("#"))
    (row, *_) = (row for row in ROWS if row["set"] == "candidates")
    assert pins == {name: row["versions"][name] for name in ("hydra-core", "omegaconf")}
