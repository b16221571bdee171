"""CI's oldest versions are the lower bounds that the project and its extras declare."""

import itertools
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# what users may add; the others are tools of ours
EXTRAS = ("posterior", "slurm", "dask", "cmaes", "benchmark")


def release(version: str) -> list[int]:
    """The numbers of a version, without zeros at its end: 2.0 is 2.0.0."""
    numbers = list(map(int, version.split(".")))
    while numbers and not numbers[-1]:
        numbers.pop()
    return numbers


def test_what_is_installed_is_each_lower_bound():
    if not (ROOT / ".ci").is_dir():
        pytest.skip("no checkout: .ci is not in the package")
    files = (ROOT / ".ci" / name for name in ("oldest.txt", "oldest-extras.txt"))
    lines = "".join(file.read_text(encoding="utf-8") for file in files).splitlines()
    pins = {
        name.lower(): version
        for name, _, version in (line.partition("==") for line in lines)
        if version
    }
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [project["optional-dependencies"][name] for name in EXTRAS]
    declared = {*project["dependencies"], *itertools.chain(*extras)}
    bounds = dict(re.findall(r"^([\w-]+)>=([\d.]+)", "\n".join(declared), re.MULTILINE))
    assert len(bounds) == len(declared)
    assert {name: release(pins[name]) for name in bounds} == {
        name: release(bound) for name, bound in bounds.items()
    }
