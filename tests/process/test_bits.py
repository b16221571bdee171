"""The same seed gives the same bits, wherever and however Python is started; on how many workers:
test_sweep.py.
"""

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
PAGE = Path(__file__).parents[2] / "docs" / "sweeps.md"
DERIVED = """if True:
    from tractexp.model.model import compose
    from tractexp.configuration.plugin import get
    effects = [get("effect", name)() for name in ("stator_resistance", "undervoltage_trip")]
    plain, extended = ("double_cage", "zip", ()), ("electromechanical", "exponential", effects)
    for motor, static, some in (plain, extended):
        print(compose(get("model/motor", motor)(), get("model/static", static)(), some).source)
"""


@pytest.mark.parametrize("seeds", [("1", "2")])
def test_a_kernel_is_derived_to_the_same_text_under_any_hash_seed(tmp_path, seeds):
    """Python's sets of texts change their order with the seed; the bits of a result hang on the
    order of its sums.
    """
    told = set()
    for seed in seeds:
        there = os.environ | {"PYTHONHASHSEED": seed, "TRACTEXP_CACHE_DIR": str(tmp_path / seed)}
        made = subprocess.run(
            [sys.executable, "-c", DERIVED], env=there, capture_output=True, check=True
        ).stdout
        assert b"define void @run(" in made
        told.add(hashlib.sha256(made).hexdigest())
    assert len(told) == 1


def test_a_search_from_another_folder_under_another_hash_seed_is_the_same(tmp_path):
    made = []
    for seed, folder in (("1", "here"), ("2", "else where")):
        (tmp_path / folder).mkdir()
        command = [
            sys.executable,
            "-m",
            "tractexp",
            "budget=500",
            "tracking.enabled=false",
            "hydra.run.dir=run",
        ]
        there = os.environ | {"PYTHONHASHSEED": seed}
        subprocess.run(command, cwd=tmp_path / folder, env=there, check=True, capture_output=True)
        result = json.loads((tmp_path / folder / "run" / "result.json").read_text())
        made.append(
            {key: result[key] for key in ("parameters", "objective", "intervals", "adequacy")}
        )
    assert made[0] == made[1]


def test_the_page_tells_what_the_stored_run_found():
    stored = json.loads((BENCHMARKS / "bits.json").read_text(encoding="utf-8"))
    assert "vectors of" in stored.pop("processor")
    powers = stored.pop("P and Q on a generic processor [pu]")
    page = " ".join(PAGE.read_text(encoding="utf-8").split())
    generic = {
        name: rows.pop("generic processor")
        for name, rows in stored.items()
        if isinstance(rows, dict)
    }
    same = [
        row
        for rows in stored.values()
        for row in (rows.values() if isinstance(rows, dict) else rows)
    ]
    assert len(same) == 12
    assert all(moved == 0.0 for row in same for moved in row.values())
    assert f"P and Q differ by at most {max(powers):.0e} pu" in page
    told = [
        f"{generic[name]['parameters']:.0e} of the width of its bounds"
        for name in ("least squares", "issa")
    ]
    assert f"{told[0]} after least squares and by {told[1]} after `issa`" in page
