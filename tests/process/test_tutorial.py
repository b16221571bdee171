"""docs/start.md done as it stands, in an empty folder, but for the two commands that take long:
study/test_docs_run.py follows the page with these, and what it quotes is what is printed.
"""

import re
import shlex
from pathlib import Path

import pytest
from command_line import run_command

PAGE = Path(__file__).parents[2] / "docs" / "start.md"
BLOCK = re.compile(r"```(\w*)\n(.*?)```", re.DOTALL)
LONG = {"model=auto", "task=discrepancy"}


def follow(folder, long):
    """Of each command and quotation in order: (whether it is quoted, its words); of the `long`
    commands, what each is given besides, or None where they are left out.
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
            elif long is not None or not LONG & {*arguments}:
                besides = [word for key in LONG & {*arguments} for word in long[key]]
                done = run_command(*arguments, *besides, cwd=folder)
                assert done.returncode == 0, f"{line}\n{done.stderr}"
                told.append((False, done.stdout))
    return told


@pytest.fixture(scope="module")
def followed(tmp_path_factory):
    """The folder at the end, and what was told."""
    folder = tmp_path_factory.mktemp("empty")
    return folder, follow(folder, None)


def test_the_look_prints_the_command_that_the_page_runs_next(followed):
    _, told = followed
    look = next(text for quoted, text in told if not quoted and "to fit it:" in text)
    printed = look.partition("to fit it:")[2].strip().splitlines()[0]
    assert f"\n{printed.strip()}\n" in PAGE.read_text(encoding="utf-8")


def test_the_pages_it_speaks_of_are_written(followed):
    folder, _ = followed
    for name in ("look.html", "survey.html"):
        assert list(folder.glob(f"outputs/**/{name}")), name
    assert len(list((folder / "records").glob("*.cfg"))) == 3


def test_all_events_of_the_archive_are_worth_fitting(followed):
    folder, _ = followed
    (table,) = folder.glob("outputs/surveys/*/survey.csv")
    assert len(table.read_text(encoding="utf-8").splitlines()) == 4
