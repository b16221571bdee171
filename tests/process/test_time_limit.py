"""The time that the files of one record may take, at every door that reads records."""

import os
import signal
import threading
import time
from pathlib import Path

import pytest
from command_line import run_command

import tractexp
import tractexp.data
from tractexp.api.job import read_events
from tractexp.api.surveying import build_rows
from tractexp.errors import UserError
from tractexp.filetypes import comtrade
from tractexp.storage import files, time_limit

if os.name == "nt":
    pytest.skip("there is no clock of a processor", allow_module_level=True)

DATA = Path(tractexp.data.__file__).parent
SAID = "dip.cfg takes more than 0.1 s of a processor to read"
DOORS = {
    "read": lambda path: tractexp.read(str(path)),
    "look": lambda path: tractexp.look(str(path)),
    "convert": lambda path: tractexp.convert(str(path), folder=path.parent / "out"),
    "data=comtrade": lambda path: read_events({"name": "comtrade", "path": str(path)}),
    "data=archive": lambda path: read_events(
        {"name": "archive", "path": str(path.parent), "train": [path.name]}
    ),
}


def spin(*_):
    """Work for ever, as a reader whose loop never ends does; whatever is an error goes on."""
    while True:
        try:
            list(range(1000))
        except Exception:
            continue


@pytest.fixture
def endless(tmp_path, monkeypatch):
    """A record whose reader never ends, and as little time for it as lets nothing else end."""
    for ending in (".cfg", ".dat"):
        (tmp_path / f"dip{ending}").write_bytes((DATA / f"tibet_50pct{ending}").read_bytes())
    path = tmp_path / "dip.cfg"
    tractexp.read(str(path))  # imports are no time of the record's
    monkeypatch.setattr(time_limit, "PATIENCE", 0.1)
    monkeypatch.setattr(time_limit, "BYTES_PER_SECOND", 1e12)
    monkeypatch.setattr(comtrade, "load", spin)
    return path


@pytest.mark.parametrize("door", DOORS)
def test_a_reader_that_never_ends_is_ended_in_a_sentence(endless, door):
    with pytest.raises(UserError, match=SAID):
        DOORS[door](endless)
    assert signal.getitimer(signal.ITIMER_VIRTUAL) == (0.0, 0.0)
    assert signal.getsignal(signal.SIGVTALRM) == signal.SIG_DFL


def test_a_survey_goes_on_behind_such_a_file(endless):
    (row,) = build_rows(str(endless.parent), endless.name)
    assert row["kind"] == "not read"
    assert SAID in row["why"]


def test_a_command_ends_with_that_sentence(endless):
    ran = run_command("look", endless.name, cwd=endless.parent)
    assert ran.returncode == 2
    assert SAID in ran.stderr


def test_each_byte_that_is_opened_gives_more_time(tmp_path, monkeypatch):
    monkeypatch.setattr(time_limit, "PATIENCE", 50.0)
    monkeypatch.setattr(time_limit, "BYTES_PER_SECOND", 100)
    path = files.write(tmp_path / "a", bytes(1000))
    with time_limit.limit_time(path):
        files.read(path)
        assert 58.0 < signal.getitimer(signal.ITIMER_VIRTUAL)[0] < 61.0
        with time_limit.limit_time(path):  # of the same record
            files.read(path, 1)
        assert 68.0 < signal.getitimer(signal.ITIMER_VIRTUAL)[0] < 71.0


def test_waiting_takes_no_time_of_the_record(tmp_path, monkeypatch):
    monkeypatch.setattr(time_limit, "PATIENCE", 0.05)
    with time_limit.limit_time(tmp_path):
        time.sleep(0.1)


def test_another_thread_reads_without_a_clock(tmp_path):
    read = []
    path = files.write(tmp_path / "a", b"x")

    def read_in_thread():
        with time_limit.limit_time(path):
            read.append((files.read(path), signal.getitimer(signal.ITIMER_VIRTUAL)))

    thread = threading.Thread(target=read_in_thread)
    thread.start()
    thread.join()
    assert read == [(b"x", (0.0, 0.0))]


def test_a_name_with_hundreds_of_marks_of_a_phase_is_read_at_once(monkeypatch):
    """Marks of one phase are combined: of 40 there were ten thousand readings of each name."""
    from tractexp.recording.label import _list_marks

    assert len(_list_marks("u a" * 200)) < 2000
