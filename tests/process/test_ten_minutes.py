"""docs/ten-minutes.md done as it stands, in an empty folder: the files it shows are written, its
commands are run. What is fitted there is marked `long`: of mutants of the lines that it runs other
tests kill the same.
"""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import COLUMNS

PAGE = Path(__file__).parents[2] / "docs" / "ten-minutes.md"
BLOCK = re.compile(r"```(\w+)\n(.*?)```", re.DOTALL)


def command(line, site):
    """A command of the page as this test runs it: this Python, and what is installed goes into a
    folder of its own.
    """
    words = shlex.split(line)
    if "pip" in words:
        offline = ["--no-deps", "--no-build-isolation", "--no-index", "--target", str(site), "."]
        assert words[-2:] == ["-e", "."]
        return [sys.executable, "-m", "pip", "install", "-q", *offline]
    return [sys.executable, *words[1:]] if words[0] == "python" else [sys.executable, "-m", *words]


def follow(folder, site, *, searches):
    """What each command printed, by its line, after the page was followed from top to bottom.
    Without `searches` none that fits anything is run.
    """
    told = {}
    for language, block in BLOCK.findall(PAGE.read_text(encoding="utf-8")):
        if language in ("toml", "python"):
            path = folder / re.match(r"# (\S+)\n", block)[1]
            path.parent.mkdir(exist_ok=True)
            path.write_text(block)
        if language != "sh":
            continue
        for line in block.splitlines():
            if "data=csv" in line and not searches:
                continue
            there = os.environ | COLUMNS | {"PYTHONPATH": str(site)}
            there["PYTEST_ADDOPTS"] = "-p no:cacheprovider"
            done = subprocess.run(
                command(line, site), cwd=folder, capture_output=True, text=True, env=there
            )
            assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
            told[line] = done.stdout
    return told


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The page followed without a search."""
    return follow(
        tmp_path_factory.mktemp("empty"), tmp_path_factory.mktemp("installed"), searches=False
    )


@pytest.fixture(scope="module")
def followed(tmp_path_factory):
    """The page followed with all searches."""
    return follow(
        tmp_path_factory.mktemp("empty"), tmp_path_factory.mktemp("installed"), searches=True
    )


def said(followed, word):
    (text,) = (text for line, text in followed.items() if word in line)
    return text


def test_the_effect_is_listed_and_its_contract_is_kept(made):
    assert "catch_up" in said(made, "list effect")
    assert re.search(r"\d+ passed", said(made, "pytest"))


@pytest.mark.long
def test_the_base_model_misses_it(followed):
    (base,) = (text for line, text in followed.items() if line.startswith("tractexp data=csv"))
    assert "an effect is missing" in base


@pytest.mark.long
def test_it_is_named_and_its_values_are_found(followed):
    assert "verdict: NAMED catch_up" in PAGE.read_text(encoding="utf-8")
    assert "verdict: NAMED catch_up\n" in said(followed, "task=discrepancy")
    fitted = said(followed, "model.effects")
    assert "of S): noise alone leaves as much" in " ".join(fitted.split())
    found = dict(re.findall(r"^\s*(hunger\w*)\s+([\d.]+)", fitted, re.MULTILINE))
    assert float(found["hunger"]) == pytest.approx(0.6, rel=0.1)
    assert float(found["hunger_time"]) == pytest.approx(0.25, rel=0.1)
