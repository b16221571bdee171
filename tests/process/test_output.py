"""What a command prints: readers that end, disks that are full, terminals of few letters, and
escapes of others.
"""

import os
import subprocess
import sys

import hostile
import numpy as np
import pytest
from command_line import run_command

import tractexp
from tractexp.text.wording import escape_text, format_epsilon, write_on_one_line

if os.name == "nt":
    pytest.skip("pipes and locales of a Unix", allow_module_level=True)

TRACTEXP = (sys.executable, "-m", "tractexp")
SEARCH = ("optimizer=random_search", "budget=20", "tracking.enabled=false", "hydra.run.dir=run")


def shell(line: str, cwd, **environment) -> subprocess.CompletedProcess:
    command = line.replace("tractexp", " ".join(TRACTEXP))
    there = os.environ | environment
    return subprocess.run(
        ["bash", "-o", "pipefail", "-c", command],
        cwd=cwd,
        capture_output=True,
        text=True,
        env=there,
    )


def test_a_reader_that_ends_ends_nothing(tmp_path):
    done = shell(
        f"tractexp list | head -1; tractexp {' '.join(SEARCH)} | head -1; tractexp list | true",
        tmp_path,
    )
    assert done.returncode == 0
    assert done.stderr == ""
    assert done.stdout.startswith("task: what to do")
    # what was printed was of no interest, what is found is kept
    assert (tmp_path / "run" / "report.html").exists()


def test_a_full_disk_for_what_is_printed_is_a_sentence(tmp_path):
    if not os.path.exists("/dev/full"):
        pytest.skip("there is no /dev/full here")
    done = shell(f"tractexp {' '.join(SEARCH)} > /dev/full", tmp_path)
    assert done.returncode == 2
    assert done.stderr == (
        "tractexp: what was to be printed could not be written (No space left on device); files are"
        " whole\n"
    )
    assert (tmp_path / "run" / "report.html").exists()


def test_no_output_at_all_is_none(tmp_path):
    done = shell("tractexp list >&-; tractexp list 2>&- | head -1", tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    "more", [{}, {"PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}, {"PYTHONIOENCODING": "ascii"}]
)
def test_a_terminal_of_few_letters_gets_escapes(more, tmp_path):
    (tmp_path / "станция.csv").write_text(hostile.text(hostile.VALUES))
    done = shell("tractexp look station.csv *.csv --folder run", tmp_path, LC_ALL="C", **more)
    assert done.returncode == 2  # there is no station.csv
    done = shell("tractexp look *.csv --folder run", tmp_path, LC_ALL="C", **more)
    # a machine that takes its time has a line of the stage there
    errors = [line for line in done.stderr.splitlines() if not line.startswith("  ")]
    assert (done.returncode, errors) == (0, [])
    assert any(name in done.stdout for name in ("станция", r"\u0441\u0442", r"\udcd1\udc81"))


def test_escapes_of_others_are_shown_as_text(tmp_path):
    path = hostile.INPUTS["escapes.cfg"](tmp_path / "escapes.cfg")
    done = run_command("look", path.name, cwd=tmp_path)
    assert done.returncode == 0
    assert r"\x1b]0;owned\x07\x1b[31m\x9b2J" in done.stdout
    assert "\x1b" not in done.stdout
    path = hostile.INPUTS["escaped_cell.csv"](tmp_path / "escaped_cell.csv")
    done = run_command("look", path.name, cwd=tmp_path)
    assert done.stderr == (
        r"tractexp: escaped_cell.csv: line 302, column t: '\x1b]0;owned\x07\x1b[31m\x9b2J' is not a"
        r" number" + "\n"
    )


def test_what_is_no_escape_stays():
    text = "Ständer 电压 é\u0301 \u00a0\u3000 👩\u200d🚒 ملف\u200c 'a\tb'\nnext"
    assert escape_text(text) == text
    assert write_on_one_line(text) == text.replace("\n", r"\n")
    assert escape_text("a\r\u202eb\udcff") == r"a\r\u202eb\udcff"


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (0.0123456, "1.235%"),
        (float("nan"), "undefined"),
        (float("inf"), "undefined"),
        (None, "undefined"),
    ],
)
def test_an_error_of_nothing_is_undefined(error, words):
    assert format_epsilon(error) == words


def test_a_load_without_one_power_is_identified_and_has_no_error_of_it(tmp_path):
    path = hostile.INPUTS["no_reactive_power.csv"](tmp_path / "dip.csv")
    done = run_command("--all", "data=csv", f"data.train=[{path.name}]", *SEARCH, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "epsilon_q undefined" in done.stdout
    assert "NaN" not in (tmp_path / "run" / "result.json").read_text()
    fit = tractexp.load(tmp_path / "run" / "result.json")
    assert np.isnan(fit.result.epsilon_q)
    assert np.isfinite(fit.predict(t=hostile.VALUES[:, 0], U=hostile.VALUES[:, 1]).P).all()


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("no_power.csv", "P and Q reach 0 pu at most: there is no load in this record"),
        ("picoseconds.csv", "the record lasts 8e-10 s, less than one cycle of 50 Hz"),
        ("subnormal_times.csv", "the record lasts 4e-308 s, less than one cycle of 50 Hz"),
        ("no_voltage.csv", "voltage must be above zero everywhere"),
    ],
)
def test_what_no_load_can_be_found_in_is_a_sentence(name, sentence, tmp_path):
    path = hostile.INPUTS[name](tmp_path / name)
    done = run_command("--all", "data=csv", f"data.train=[{path.name}]", *SEARCH, cwd=tmp_path)
    assert done.returncode == 2
    assert sentence in done.stderr


@pytest.mark.parametrize("data", ["csv", "waveforms", "comtrade", "sel", "pqdif"])
@pytest.mark.parametrize("folder", [".", "/"])
def test_a_folder_in_the_place_of_a_file_is_a_sentence(data, folder, tmp_path):
    done = run_command(f"data={data}", f"data.path={folder}", *SEARCH, cwd=tmp_path)
    assert done.returncode == 2
    assert "is a folder" in done.stderr
    assert done.stderr.count("\n") == 1


def test_folders_to_train_on_are_a_sentence(tmp_path):
    for value in ("[.]", "[/]", "['']", "[..]"):
        done = run_command("data=csv", f"data.train={value}", *SEARCH, cwd=tmp_path)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert "is a folder" in done.stderr
