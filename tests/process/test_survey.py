"""An archive as a table: every file a row at least, whatever it holds; resumed; the events that
tell most.
"""

import csv
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas
import pytest
from browser import BROWSER, Worked, drawn
from command_line import run_command
from made_recordings import constant, motor_dip, recording

import tractexp
from tractexp.api import surveying
from tractexp.api.survey import Surveyed
from tractexp.configuration.plugin import build
from tractexp.errors import UserError
from tractexp.filetypes.comtrade_writer import write
from tractexp.recording import archive
from tractexp.report.survey import UNREAD

DEPTHS = {"shallow 1": 0.06, "deep 1": 0.5, "shallow 2": 0.08, "deep 2": 0.6, "shallow 3": 0.07}


def fill(folder, count=6):
    """So many files with a dip each, one in ASCII, in two folders below."""
    for k in range(count):
        path = folder / f"day {k % 2}" / f"e{k}.cfg"
        path.parent.mkdir(parents=True, exist_ok=True)
        write(
            recording(constant(depth=0.1 + 0.05 * k)), path, "ASCII" if k == 1 else "BINARY", 1999
        )
    return folder


@pytest.fixture(scope="module")
def field(tmp_path_factory):
    """Six files that can be read; a broken one, a quiet one, what is no record, and
    what is hidden.
    """
    folder = fill(tmp_path_factory.mktemp("field"))
    (folder / "broken.cfg").write_text("a,b,1999\n3,x\n")
    write(recording(constant(depth=0.0)), folder / "quiet.cfg", "BINARY", 1999)
    (folder / "recorder.rec").write_bytes(b"\0\1")
    for name in ("readme.txt", ".hidden.cfg", "e.hdr", "e.inf", "photo.jpg"):
        (folder / name).write_text("of the 3rd of May\n")
    run = folder / "outputs" / "run"
    (run / ".hydra").mkdir(parents=True)
    (run / "history.csv").write_text("t,U,P,Q\n0,1,1,1\n")
    return folder


@pytest.fixture(scope="module")
def surveyed(field):
    return tractexp.survey(field, cores=1)


def make_row(file, **changes):
    """A row of a survey: a dip of a table, worth fitting."""
    row = {"file": file, "event": f"{file}#1.1", "station": "", "load": file.partition(".")[0]}
    row |= {"kind": "dip", "worth": True, "depth": 0.4, "noise": 0.01}
    return row | {"command": f"tractexp data.train=[{file}]"} | changes


@pytest.mark.parametrize(
    ("rows", "command", "step"),
    [
        ([make_row("a.csv")], "", "fit a.csv#1.1: tractexp data.train=[a.csv]"),
        (
            [make_row("a.csv"), make_row("b.csv")],
            "",
            "fit each load to all its dips: tractexp task=station data.path=recs",
        ),
        ([make_row("a.csv")], "tractexp data=x", "fit them together: tractexp data=x"),
        (
            [make_row("a b.csv", worth=False)],
            "",
            "see why nothing is worth fitting: tractexp look 'recs/a b.csv'",
        ),
        (
            [make_row("a.csv", worth=False, kind=UNREAD)],
            "",
            "see what can be read: tractexp list data",
        ),
    ],
)
def test_a_survey_ends_with_the_command_that_leads_on(rows, command, step):
    assert Surveyed({"folder": "recs", "rows": rows, "command": command}).next_step == step


def test_no_name_of_a_file_is_a_formula_of_the_table_or_a_program_of_the_page(tmp_path):
    harm = [
        "=1+1.cfg",
        "@SUM(A1).cfg",
        "</script><script>owned()<.cfg",
        "$(touch owned).cfg",
        "${oc.env:HOME}.cfg",
    ]
    harm = [name.replace("/", "\N{FRACTION SLASH}") for name in harm]
    for name in harm:
        write(recording(constant(depth=0.2)), tmp_path / "in" / name, "BINARY", 1999)
    made = tractexp.survey(tmp_path / "in", cores=1)
    made.write(tmp_path / "out")
    with (tmp_path / "out" / "survey.csv").open(encoding="utf-8", newline="") as table:
        cells = [row["file"] for row in csv.DictReader(table)]
    assert sorted(cells) == sorted(f"'{name}" if name[0] in "=@" else name for name in harm)
    assert sorted(made.to_frame()["file"]) == sorted(harm)
    page = (tmp_path / "out" / "survey.html").read_text(encoding="utf-8")
    assert page.count("<script") == 2


def test_every_record_is_a_row_and_nothing_else_is(surveyed, field):
    files = [row["file"] for row in surveyed.rows]
    assert files == [
        "broken.cfg",
        "quiet.cfg",
        "recorder.rec",
        *(f"day {k % 2}/e{k}.cfg" for k in (0, 2, 4, 1, 3, 5)),
    ]
    kinds = {row["file"]: row["kind"] for row in surveyed.rows}
    assert [
        kinds[name] for name in ("broken.cfg", "quiet.cfg", "recorder.rec", "day 0/e0.cfg")
    ] == ["not read", "nothing", "not read", "dip"]
    why = {row["file"]: row["why"] for row in surveyed.unread}
    assert "export it as COMTRADE" in why["recorder.rec"]
    assert "broken" in why["broken.cfg"]


def test_the_folder_of_a_run_is_looked_at_where_it_is_the_one_asked_for(tmp_path):
    (fill(tmp_path / "converted", 2) / ".hydra").mkdir()
    assert len(tractexp.survey(tmp_path / "converted", cores=1).rows) == 2
    with pytest.raises(UserError, match="holds no file that can be read"):
        tractexp.survey(tmp_path, cores=1)


def test_a_row_tells_what_a_look_tells(surveyed, field):
    row = next(row for row in surveyed.rows if row["file"] == "day 0/e2.cfg")
    look = tractexp.look(field / "day 0" / "e2.cfg")
    (event,) = look.events
    for key in ("kind", "start", "depth", "duration", "U2", "P_before", "Q_after", "worth", "why"):
        assert row[key] == event[key], key
    assert row["command"] == look.commands[0]
    assert (row["event"], row["station"], row["rate"]) == ("day 0/e2.cfg#1.1", "North", 3200.0)
    assert row["when"].startswith("2026-03-01T10:00:00.49")
    assert row["depth"] == pytest.approx(0.2, abs=2e-3)


def test_processes_give_the_rows_of_one(surveyed, field):
    assert (
        tractexp.survey(field, cores=2, progress=False).content["rows"] == surveyed.content["rows"]
    )


def test_the_table_is_written_for_people_and_machines(surveyed, tmp_path):
    whole, *tables, page = surveyed.write(tmp_path)
    assert [p.name for p in (whole, *tables)] == ["survey.json", "survey.csv", "survey.parquet"]
    for frame in (pandas.read_csv(tables[0]), pandas.read_parquet(tables[1])):
        assert list(frame["file"]) == [row["file"] for row in surveyed.rows]
        assert frame["worth"].sum() == 6
    assert json.loads(whole.read_text())["rows"][0]["kind"] == "not read"
    text = page.read_text(encoding="utf-8")
    data = json.loads(text.partition('id="rows">')[2].partition("</script>")[0])
    assert len(data["rows"]) == len(surveyed.rows)
    assert 10 < len(data["rows"][-1]["U_picture"]) <= 48
    assert min(data["rows"][-1]["U_picture"]) < 0.7
    assert "http" not in text.replace("http://www.w3.org", "")
    again = tractexp.load(surveyed.save(tmp_path / "saved.json"))
    assert again.content == surveyed.content


@pytest.mark.skipif(BROWSER is None, reason="no browser")
def test_the_page_is_sorted_and_filtered_where_it_is_read(surveyed, tmp_path):
    from tractexp.report import survey

    class Whole:
        def save(self, path):
            return survey.report(surveyed.content).save(path)

    script = """
    const names = () => [...document.querySelectorAll("#body tr td:first-child")]\
.map(cell => cell.textContent);
    const told = [names().length];
    const click = key => document.querySelector(`th[data-key=${key}]`).click();
    click("depth"); told.push(names()[0]); click("depth"); told.push(names()[0]);
    const write = (id, value) => { const field = document.getElementById(id); field.value = value;
      field.dispatchEvent(new Event("input")); };
    write("text", "day e4"); told.push(names()); write("text", ""); write("depth", "29"); \
told.push(names().length);
    write("depth", ""); document.getElementById("worth").click(); told.push(names().length);
    document.getElementById("told").textContent = JSON.stringify(told);
    """
    dom, complaints = drawn(Worked(Whole(), script), tmp_path)
    assert complaints == []
    told = json.loads(re.search(r'id="told">(.*?)</p>', dom)[1])
    assert told == [9, "day 0/e0.cfg#1.1", "day 1/e5.cfg#1.1", ["day 0/e4.cfg#1.1"], 2, 6]


def test_only_what_is_new_or_changed_is_looked_at_again(tmp_path, monkeypatch):
    folder, keep = fill(tmp_path / "a", 4), tmp_path / "kept"
    first = tractexp.survey(folder, keep=keep, cores=1)
    assert first.content["looked_at"] == 4
    again = tractexp.survey(folder, keep=keep, cores=1)
    assert again.content["looked_at"] == 0
    assert again.content["rows"] == first.content["rows"]
    data = folder / "day 0" / "e2.dat"
    os.utime(data, ns=(1, 1))  # the part of a record that is not its name
    (folder / "day 0" / "e0.cfg").unlink()
    third = tractexp.survey(folder, keep=keep, cores=1)
    # the one changed, and the data whose configuration is gone
    assert third.content["looked_at"] == 1 + 1
    assert len(third.rows) == 4
    assert "configuration" in third.unread.rows[0]["why"]


def test_a_survey_that_was_killed_goes_on_where_it_was(tmp_path):
    """Killed between two files, with the entry of one cut short."""
    folder, keep = fill(tmp_path / "a", 6), tmp_path / "kept"
    script = (
        "import sys, time, tractexp\nfrom tractexp.api import surveying\n"
        "made = surveying.build_rows\n"
        "def slow(*given):\n    time.sleep(0.3)\n    return made(*given)\nsurveying.build_rows ="
        " slow\n"
        f"tractexp.survey({str(folder)!r}, keep={str(keep)!r}, cores=1)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", script])
    while len(entries := [*keep.glob("rows/*.entry")]) < 2:
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    whole = len([*keep.glob("rows/*.entry")]) - 1
    entries[0].write_bytes(entries[0].read_bytes()[:-1])
    made = tractexp.survey(folder, keep=keep, cores=1)
    assert made.content["looked_at"] == 6 - whole < 6
    assert len(made.rows) == 6
    assert tractexp.survey(folder, keep=keep, cores=1).content["looked_at"] == 0


def test_what_others_kept_beside_a_survey_is_computed_again(field, tmp_path, monkeypatch):
    keep = tmp_path / "kept"
    looked_at = tractexp.survey(field, keep=keep, cores=1).content["looked_at"]
    assert looked_at > 0
    monkeypatch.setenv("TRACTEXP_CACHE_DIR", str(tmp_path / "mine"))
    made = tractexp.survey(field, keep=keep, cores=1)
    assert made.content["looked_at"] == looked_at


def test_a_mistake_of_ours_is_a_row_and_no_end(field, monkeypatch):
    def fails(path):
        raise ZeroDivisionError("of nothing")

    monkeypatch.setattr(archive, "look_at_file", fails)
    (row,) = surveying.build_rows(str(field), "quiet.cfg")
    assert row["kind"] == "not read"
    assert "ZeroDivisionError: of nothing" in row["why"]


def test_a_file_that_kills_its_process_is_a_row_and_the_others_are_read(field):
    """In a process of its own: one that dies takes the others' work with it, which
    is done again.
    """
    script = (
        "import os, sys\nfrom pathlib import Path\nfrom tractexp.api import surveying\n"
        "made = surveying.build_rows\n"
        "def deadly(folder, file):\n    if file.endswith('e3.cfg'): os.kill(os.getpid(), 9)\n"
        "    return made(folder, file)\n"
        "surveying.build_rows = deadly\n"
        "if __name__ == '__main__':\n"
        "    names = [f'day {k % 2}/e{k}.cfg' for k in range(6)]\n"
        "    found = dict(surveying.look_at_files(Path(sys.argv[1]), names, 2))\n"
        "    print(len(found), sorted(n for n, rows in found.items() if rows[0]['kind'] == 'not"
        " read'))\n"
        "    print(found['day 1/e3.cfg'][0]['why'])\n"
    )
    path = field.parent / "deadly.py"
    path.write_text(script)
    done = subprocess.run(
        [sys.executable, str(path), str(field)], capture_output=True, text=True, timeout=120
    )
    assert done.stdout.startswith("6 ['day 1/e3.cfg']\n"), done.stderr
    assert "was killed at this file" in done.stdout


@pytest.fixture(scope="module")
def planted(tmp_path_factory):
    """Dips of one motor: two deep ones tell its parameters, three shallow ones little."""
    folder = tmp_path_factory.mktemp("planted")
    for k, (name, depth) in enumerate(DEPTHS.items()):
        write(recording(motor_dip(depth, seed=k)), folder / f"{name}.cfg", "BINARY", 1999)
    return folder


def test_the_events_that_tell_most_are_the_deep_ones_and_one_command_fits_them(planted, tmp_path):
    asked = ("task=survey", f"data.path={planted}", "task.informative=2", "tracking.enabled=false")
    done = run_command(*asked, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (folder,) = (tmp_path / "outputs" / "surveys").iterdir()
    content = json.loads((folder / "survey.json").read_text())
    assert {each["event"] for each in content["informative"]} == {
        "deep 1.cfg#1.1",
        "deep 2.cfg#1.1",
    }
    assert content["command"] in done.stdout
    words = shlex.split(content["command"])
    assert words[1] == "model=auto"  # as each event's own command has it
    fit = run_command(
        *words[2:],
        "optimizer=multistart_least_squares",
        "optimizer.starts=2",
        "tracking.enabled=false",
        "hydra.run.dir=run",
        cwd=tmp_path,
    )
    assert fit.returncode == 0, fit.stderr
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    assert [e["name"] for e in result["events"]] == [
        each["event"] for each in content["informative"]
    ]
    assert max(e["epsilon_p"] for e in result["events"]) < 0.01
    again = run_command(*(word for word in asked if "informative" not in word), cwd=tmp_path)
    assert "5 files" in again.stdout
    assert "0 new or changed" in again.stdout


def test_events_are_ranked_by_noise_as_well_as_by_depth(tmp_path):
    for name, depth, noise in (("deep", 0.5, 0.05), ("clean", 0.4, 1e-4)):
        write(recording(motor_dip(depth, noise=noise)), tmp_path / f"{name}.cfg", "BINARY", 1999)
    made = tractexp.survey(tmp_path, informative=1, values="default", cores=1, progress=False)
    assert made.informative == ["clean.cfg#1.1"]


def test_an_event_is_read_by_its_name(field):
    events = build(
        "data",
        {"name": "archive", "path": str(field), "train": ["day 0/e2.cfg#1.1", "day 1/e3.cfg"]},
    ).read()
    assert [r.name for r in events.train] == ["day 0/e2.cfg#1.1", "day 1/e3.cfg#1.1"]
    direct = tractexp.read(field / "day 0" / "e2.cfg")[0].record
    np.testing.assert_array_equal(events.train[0].P, direct.P)
    assert events.train[0].identity == direct.identity
    shown, own = events.train[0].waves, direct.waves  # for domain=waves
    assert (shown.start, shown.rate) == (own.start, own.rate)
    np.testing.assert_array_equal(shown.samples, own.samples)


@pytest.mark.parametrize(
    ("train", "sentence"),
    [
        ([], "data.train is empty: name events of"),
        (["day 0/e9.cfg"], r"there is no file 'day 0/e9.cfg' in .*; did you mean 'day 0/e\d.cfg'"),
        (["day 0/e2.cfg#2.1"], "shows 1 load, and there is no load 2"),
        (["day 0/e2.cfg#1.7"], "has not a dip 7 that can be fitted"),
        (["quiet.cfg"], "has not an event that is worth fitting .nothing happened to it"),
        (["day 0/e2.cfg", "day 0/e2.cfg"], "names day 0/e2.cfg twice"),
    ],
)
def test_an_event_that_is_not_there_is_refused(field, train, sentence):
    with pytest.raises(UserError, match=sentence):
        build("data", {"name": "archive", "path": str(field), "train": train}).read()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("data.path=absent",), "data.path=absent is no folder that is there"),
        ((), "data.path is missing: give the folder"),
        (
            ("data=csv", "data.train=[a.csv]"),
            "data=csv is no folder; leave it out and give data.path=FOLDER",
        ),
        (("data.path=.",), "data.path=. holds no file that can be read"),
        (
            ("data.path=.", "model=third_order_zip"),
            "model=third_order_zip is not read by task=survey",
        ),
        (("data.path=.", "task.informative=0"), "task.informative=0 is out of range"),
    ],
)
def test_what_cannot_be_surveyed_is_refused_in_a_sentence(tmp_path, arguments, sentence):
    done = run_command("task=survey", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert sentence in done.stderr
    assert "Traceback" not in done.stderr


def test_the_page_tells_the_speed_of_the_stored_run():
    root = Path(__file__).parents[2]
    stored = json.loads((root / "benchmarks" / "survey.json").read_text(encoding="utf-8"))
    page = " ".join((root / "docs" / "archives.md").read_text(encoding="utf-8").split())
    assert f"{stored['files']} COMTRADE files of 1 s" in page
    assert f"two cores): {stored['files_per_second']:.0f} files per second" in page
