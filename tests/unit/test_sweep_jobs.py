"""The parts of a sweep one by one: what a job is, how its end is kept, and what is told while
others run.
"""

import io
import json
import re
import sys
import threading
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path

import pytest

from tractexp.errors import UserError
from tractexp.sweep import launcher, progress, recorder
from tractexp.sweep.elsewhere import Delivery, unpack_job
from tractexp.sweep.job import SweepJob, find_shared_overrides, read_shared_events
from tractexp.sweep.output import redirect_prints
from tractexp.sweep.placing import place
from tractexp.sweep.status import (
    FAILED,
    FILE,
    FINISHED,
    RUNNING,
    Status,
    read,
    read_objective,
    select_returned_metrics,
)
from tractexp.text.progress import FIRST_LINE
from tractexp.tracking import TrackedRun, runfile
from tractexp.tracking.sweepfile import find_sweep_folder


def job(folder: Path, *overrides: str, seed: int = 0) -> SweepJob:
    choices = {"optimizer": "pso", "data": "tibet_50pct", "task": "identify"}
    return SweepJob({"seed": seed}, choices, overrides, f"job {seed}", "code", folder)


def ended(job: SweepJob, status: str = FINISHED, value: float | None = None) -> Status:
    """The end of a job, as its worker leaves it."""
    metrics = {} if value is None else {"search_objective": value}
    end = replace(job.status, status=status, seconds=2.0, metrics=metrics)
    end.end(job.folder)
    return end


@pytest.fixture
def jobs(tmp_path):
    return [
        job(tmp_path / str(k), "budget=500", f"optimizer.c1={k // 2}", f"seed={k}", seed=k)
        for k in range(4)
    ]


def test_a_status_comes_back_from_its_folder_and_a_damaged_one_does_not(jobs):
    for one in jobs[:2]:
        end = ended(one)
        assert read(one.folder) == end
        assert json.loads((one.folder / FILE).read_text())["seed"] == one.config["seed"]
    (jobs[0].folder / FILE).write_text("{")
    # of another version: parts are missing
    (jobs[1].folder / FILE).write_text('{"status": "finished"}')
    assert [read(one.folder) for one in jobs[:3]] == [None, None, None]


def test_a_job_starts_as_running_with_nothing_spent(jobs):
    assert jobs[3].status == Status(RUNNING, "", "job 3", "code", 0.0, jobs[3].choices, 3)


def test_a_variant_leaves_out_what_all_jobs_share(jobs):
    assert find_shared_overrides(jobs) == {"budget=500"}
    assert find_shared_overrides(jobs[:1]) == set()
    assert [one.variant(find_shared_overrides(jobs)) for one in jobs] == [
        "pso c1=0",
        "pso c1=0",
        "pso c1=1",
        "pso c1=1",
    ]
    assert jobs[0].variant(()) == "pso budget=500 c1=0"


def test_the_best_of_each_variant_is_kept_and_failures_are_counted(jobs):
    tally = progress.Tally(jobs)
    for one, status, value in zip(
        jobs, (FINISHED, FINISHED, FAILED, FINISHED), (3.0, 2.0, None, 1.0), strict=True
    ):
        tally.add(one, ended(one, status, value))
    assert (tally.total, tally.done, tally.failed) == (4, 4, 1)
    assert tally.rank_variants() == [("pso c1=1", 1.0), ("pso c1=0", 2.0)]
    assert tally.jobs == {"pso c1=0": 2, "pso c1=1": 2}
    assert tally.line().startswith(
        "  4 of 4 jobs, 1 failed, best objectives pso c1=1 1, pso c1=0 2; about 0 s left"
    )


def test_the_time_left_is_that_of_the_pace_since_the_first_end(jobs, monkeypatch):
    at = iter((10.0, 14.0, 17.0))  # begun, the first end, now
    monkeypatch.setattr(progress.time, "perf_counter", lambda: next(at))
    tally = progress.Tally(jobs)
    assert tally.line() == "  0 of 4 jobs; time left not known yet"
    tally.add(jobs[0], ended(jobs[0]))
    assert tally.time_left == "time left not known yet"
    tally.add(jobs[1], ended(jobs[1]))
    assert tally.time_left == "about 6 s left"  # one job in 3 s, two more


def test_a_log_file_gets_a_line_now_and_then(jobs, monkeypatch, capsys):
    clock = [0.0]
    monkeypatch.setattr(progress.time, "perf_counter", lambda: clock[0])
    with progress.show_progress(jobs) as note:
        for one, at in zip(jobs, (FIRST_LINE, FIRST_LINE + 0.1, 1e3, 2e3), strict=True):
            clock[0] = at
            note(one, ended(one, value=1.0))
    told = capsys.readouterr().out.splitlines()
    assert [re.match(r"  (\d) of 4 jobs, best objectives", line)[1] for line in told] == ["1", "3"]


def test_a_terminal_shows_each_variant_under_a_bar(jobs, monkeypatch):
    from io import StringIO

    from rich.console import Console

    shown = Console(file=StringIO(), force_terminal=True, width=100)
    monkeypatch.setattr(progress, "build_console", lambda: shown)
    with progress.show_progress(jobs) as note:
        for one, status in zip(jobs[:3], (FINISHED, FAILED, FINISHED), strict=True):
            note(one, ended(one, status, 2.0 - one.config["seed"]))
    text = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", shown.file.getvalue())
    assert "3/4" in text
    assert re.search(
        r"pso c1=1 +best 0\.0000e\+00 +1 jobs\s+pso c1=0 +best 2\.0000e\+00 +2 jobs", text
    )
    assert "1 failed, about" in text
    assert "0 failed" not in text


def test_the_end_of_a_job_whose_worker_did_not_answer_is_what_it_had_written(jobs):
    jobs[0].status.begin(jobs[0].folder)  # begun, not ended
    ends = [ended(jobs[1], FAILED), ended(jobs[2])]
    assert [launcher._find_end(one) for one in jobs] == [True, *ends, False]


def test_jobs_in_threads_print_into_their_own_files_and_what_is_beside_them_does_not(capsys):
    begun = threading.Barrier(3)

    def talk(output):
        with redirect_prints(output):
            begun.wait()
            print("in", output.name, file=sys.stdout)
            print("err", output.name, file=sys.stderr)
            begun.wait()

    outputs = [io.StringIO(), io.StringIO()]
    for name, output in zip("ab", outputs, strict=True):
        output.name = name
    threads = [threading.Thread(target=talk, args=(output,)) for output in outputs]
    for thread in threads:
        thread.start()
    begun.wait()
    print("beside")
    begun.wait()
    for thread in threads:
        thread.join()
    assert [output.getvalue() for output in outputs] == ["in a\nerr a\n", "in b\nerr b\n"]
    print("after")
    assert capsys.readouterr() == ("beside\nafter\n", "")


def test_a_job_returns_where_its_search_ended_or_what_is_named():
    measured = {"search_objective": 2e-3, "objective": 3e-5, "search_simulations_to_floor": None}
    assert select_returned_metrics(measured, None) == 2e-3
    assert select_returned_metrics(measured, ["objective"]) == 3e-5
    assert select_returned_metrics(measured, ["objective", "search_simulations_to_floor"]) == [
        3e-5,
        float("inf"),
    ]
    assert select_returned_metrics({"probability": 0.5}, None) is None
    with pytest.raises(
        UserError, match=r"sweep\.returns names objectiv, .*did you mean 'objective'\?"
    ):
        select_returned_metrics(measured, ["objectiv"])


def test_what_a_job_measured_comes_back_and_of_one_that_failed_nothing_counts(jobs):
    ended(jobs[0], value=3.0)
    ended(jobs[1], FAILED, 2.0)
    assert [read_objective(one.folder) for one in jobs[:3]] == [3.0, None, None]


def test_what_comes_back_from_afar_takes_the_place_of_the_earlier_unless_it_failed(jobs):
    one = replace(jobs[0], config={"seed": 0})
    for end, content, left in (
        (FINISHED, b"1", b"1"),
        (FAILED, b"2", b"1"),
        (FINISHED, b"3", b"3"),
    ):
        contents = {"output.txt": end.encode(), FILE: b"theirs", "../mine": b"x"}
        if end == FINISHED:
            contents["result.json"] = content
        state = replace(one.status, status=end)
        assert unpack_job(one, Delivery(state, contents)) == state
        assert (one.folder / "result.json").read_bytes() == left
        assert (one.folder / "output.txt").read_text() == end
        assert read(one.folder) == state
    names = {path.name for path in one.folder.iterdir()}
    assert names == {".hydra", "output.txt", "result.json", FILE}
    assert not (one.folder.parent / "mine").exists()


def test_jobs_have_the_folders_that_are_named_and_keep_them(tmp_path):
    jobs = [replace(job(Path(), seed=k), subdir=f"pso/{k}") for k in range(3)]
    placed = place(jobs, tmp_path)
    assert [one.folder for one in placed] == [tmp_path / "pso" / str(k) for k in range(3)]
    assert {one.sweep for one in placed} == {tmp_path}
    ended(placed[1])
    (tmp_path / "sweep.json").write_text('{"run": "7"}')
    assert find_sweep_folder(placed[1].folder) == tmp_path
    again = place([replace(jobs[1], subdir="elsewhere"), *jobs[:1]], tmp_path)  # it was done there
    assert [one.name for one in again] == ["pso/1", "pso/0"]


@pytest.mark.parametrize(
    ("subdirs", "sentence"),
    [
        (("pso", "pso"), "hydra.sweep.subdir=pso is the folder of two jobs; name all that differs"),
        (("pso", "pso/1"), "hydra.sweep.subdir=pso/1 is the folder of two jobs"),
        (("pso/1", "pso"), "hydra.sweep.subdir=pso is the folder of two jobs"),
        (("../pso",), "does not lie below the sweep's folder"),
        ((".",), "does not lie below the sweep's folder"),
        (("mine",), "holds files that are not this job's"),
    ],
)
def test_a_folder_that_is_not_the_jobs_alone_is_refused(subdirs, sentence, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("keep")
    jobs = [replace(job(Path(), seed=k), subdir=name) for k, name in enumerate(subdirs)]
    with pytest.raises(UserError, match=re.escape(sentence)):
        place(jobs, tmp_path)


def test_a_job_is_logged_once_below_the_run_of_its_sweep(jobs, monkeypatch):
    logged = []
    monkeypatch.setattr(
        recorder.tracking,
        "log",
        lambda run, uri: (logged.append((run.name, run.parent, uri)), "id")[1],
    )
    opening: Future[str | None] = Future()
    opening.set_result("7")
    record = recorder.Recorder(jobs[0].folder.parent, opening)
    runfile.save(jobs[0].folder, TrackedRun("e", "r"), "sqlite:///x.db")
    for folder in (jobs[0].folder, jobs[0].folder, jobs[1].folder):  # the last kept nothing
        record.log(folder)
    assert logged == [("r", "7", "sqlite:///x.db")]
    assert runfile.read(jobs[0].folder).run_id == "id"


def test_a_store_that_is_away_is_asked_once_and_what_it_lacks_is_kept(jobs, monkeypatch, capsys):
    asked = []

    def refuse(run, uri):
        asked.append(run.name)
        raise UserError("the store is away")

    monkeypatch.setattr(recorder.tracking, "log", refuse)
    opening: Future[str | None] = Future()
    opening.set_result("7")
    record = recorder.Recorder(jobs[0].folder.parent, opening)
    for one in jobs:
        runfile.save(one.folder, TrackedRun("e", one.folder.name), "sqlite:///x.db")
        record.log(one.folder)
    assert asked == ["0"]
    assert capsys.readouterr().out.count("not logged yet: the store is away") == 1
    assert [runfile.read(one.folder).run_id for one in jobs] == [""] * 4
    waiting: Future[str | None] = Future()
    waiting.set_result(None)  # the run of the sweep could not be opened
    recorder.Recorder(jobs[0].folder.parent, waiting).log(jobs[0].folder)
    assert asked == ["0"]


def test_a_run_with_others_below_it_and_what_was_never_reached_is_read_back(tmp_path):
    """Those below end with it; what was never reached is kept, and left out where it is logged."""
    metrics = {"objective": 1.0, "search_simulations_to_floor": float("inf")}
    runfile.save(
        tmp_path,
        TrackedRun("e", "r", metrics=metrics, children=[TrackedRun("e", "below")]),
        "sqlite:///x.db",
    )
    back = runfile.read(tmp_path).run
    assert back.metrics == metrics
    assert [(child.name, child.ended) for child in back.children] == [("below", None)]


def test_the_jobs_of_a_worker_read_their_records_once_but_changed_ones_again():
    data = {"name": "csv", "train": ["pkg://tractexp.data/tibet_30pct.csv"], "validate": None}
    first = read_shared_events(data, inputs="as they are")
    assert read_shared_events(dict(data), inputs="as they are") is first
    assert read_shared_events(data, inputs="changed") is not first
