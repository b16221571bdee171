"""docs/start.md done as it stands, in an empty folder, with fewer structures in the race and fewer
effects: .ci/run has an investigation of all of them. What is fitted there is marked `long`: of
mutants of the lines that it runs other tests kill the same.
"""

import json
import re
import shlex
from pathlib import Path

import pytest
from command_line import run_command

PAGE = Path(__file__).parents[2] / "docs" / "start.md"
BLOCK = re.compile(r"```(\w*)\n(.*?)```", re.DOTALL)
FEWER = {
    "model=auto": [
        "model.candidates.phasors=[third_order_exponential,fifth_order_stator_flux]",
        "budget=3000",
    ],
    "task=discrepancy": ["task.effects=[stator_transients,stator_resistance,dc_link_lag]"],
}


def follow(folder, *, searches):
    """Of each command and quotation of the page in order: (whether it is quoted, its words).
    Without `searches` none that fits anything is run.
    """
    told = []
    for language, block in BLOCK.findall(PAGE.read_text(encoding="utf-8")):
        if language != "sh":
            told.append((True, block))
            continue
        for line in block.splitlines():
            program, *arguments = shlex.split(line)
            if program != "tractexp":  # what a new environment takes is tried by .ci/run
                assert "venv" in line
                continue
            fewer = [setting for word in arguments for setting in FEWER.get(word, ())]
            if fewer and not searches:
                continue
            done = run_command(*arguments, *fewer, cwd=folder)
            assert done.returncode == 0, f"{line}\n{done.stderr}"
            told.append((False, done.stdout))
    return told


@pytest.fixture(scope="module")
def looked(tmp_path_factory):
    """The folder at the end, and what was told, without a search."""
    folder = tmp_path_factory.mktemp("empty")
    return folder, follow(folder, searches=False)


@pytest.fixture(scope="module")
def followed(tmp_path_factory):
    """The same with all searches."""
    folder = tmp_path_factory.mktemp("empty")
    return folder, follow(folder, searches=True)


def test_the_look_prints_the_command_that_the_page_runs_next(looked):
    _, told = looked
    look = next(text for quoted, text in told if not quoted and "to fit it:" in text)
    printed = look.partition("to fit it:")[2].strip().splitlines()[0]
    assert f"\n{printed.strip()}\n" in PAGE.read_text(encoding="utf-8")


def test_all_events_of_the_archive_are_worth_fitting(looked):
    folder, _ = looked
    (table,) = folder.glob("outputs/surveys/*/survey.csv")
    assert len(table.read_text(encoding="utf-8").splitlines()) == 4


@pytest.mark.long
def test_the_pages_it_speaks_of_are_written(followed):
    folder, _ = followed
    for name in ("look.html", "survey.html", "report.html", "discrepancy.html", "extended.yaml"):
        assert list(folder.glob(f"outputs/**/{name}")), name
    assert len(list((folder / "records").glob("*.cfg"))) == 3


@pytest.mark.long
def test_what_it_quotes_is_printed(followed):
    _, told = followed
    printed, quotations = "", 0
    for quoted, text in told:
        words = " ".join(text.split())
        if quoted:
            assert words in printed
            quotations += 1
        else:
            printed += " " + words
    assert quotations == 2


@pytest.mark.long
def test_what_is_missing_is_named_and_closes_the_gap(followed):
    """And no skew, which the recorder's window looks like."""
    folder, _ = followed
    (path,) = folder.glob("outputs/runs/*/discrepancy.json")
    made = json.loads(path.read_text())
    assert (made["verdict"], made["effects"]) == ("named", ["stator_transients"])
    gap = made["gap"]["validate"]
    assert gap["closed"] > 0.9
    assert gap["after"]["epsilon_p"] < 0.5 * gap["before"]["epsilon_p"]
