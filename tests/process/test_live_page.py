"""The page of a sweep that goes on: what it says meanwhile, and that what it says last stays."""

import json
import re

import pytest
from browser import BROWSER, drawn
from command_line import run_command

from tractexp.blocks import Report
from tractexp.blocks.block import Markup
from tractexp.sweep import launcher, live

QUICK = ("tracking.enabled=false", "optimizer.population=10", "budget=100")
ASKED = ("-m", *QUICK, "hydra.sweep.dir=sweep", "hydra.launcher.backend=sequential")
WATCHES = """
import pathlib, time
from hydra.experimental.callback import Callback

class Watches(Callback):
    \"\"\"Keeps the page that there is once it knows of all jobs before.\"\"\"

    def __init__(self, stop=-1):
        self.stop = stop

    def on_job_start(self, config, **more):
        number, page = config.hydra.job.num, pathlib.Path("sweep/sweep.html")
        if number == self.stop:
            raise KeyboardInterrupt
        until = time.monotonic() + 60
        while f"<p>{number} of " not in page.read_text() and time.monotonic() < until:
            time.sleep(0.02)
        pathlib.Path(f"page{number}.html").write_text(page.read_text())
"""
CALLBACK = "+hydra.callbacks.w={_target_: watches_the_page.Watches}"


@pytest.fixture
def watched(tmp_path, monkeypatch):
    """A folder with a callback that keeps the page as each job starts; looks are frequent."""
    (tmp_path / "watches_the_page.py").write_text(WATCHES)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(live, "PERIOD", 1)
    monkeypatch.setattr(live.LivePage, "follow", follow_closely)
    return tmp_path


def follow_closely(page, over):
    while not over.wait(0.02):
        if page.look():
            page.write()


def test_the_page_tells_of_what_has_ended_while_the_sweep_goes_on(watched):
    done = run_command(*ASKED, CALLBACK, "optimizer=pso,ssa", "seed=3,4", cwd=watched)
    assert done.returncode == 0, done.stderr
    page = watched / "sweep" / "sweep.html"
    assert f"to watch it: {page.as_uri()}" in done.stdout
    before, first, *_, third = [(watched / f"page{k}.html").read_text() for k in range(4)]
    for text, told in ((before, "0 of 4 jobs"), (first, "1 of 4 jobs"), (third, "3 of 4 jobs")):
        assert told in text
        assert '<meta http-equiv="refresh" content="1">' in text
    assert "time left not known yet" in first
    assert re.search(r"about \d+ s left", third)
    ended = json.loads((watched / "sweep" / "0" / "status.json").read_text())["metrics"]
    assert f"<td>{ended['search_objective']:.5g}</td>" in first
    assert "<figure" not in before.split("<body>")[1]
    assert 'class="chart' in first

    last = page.read_text()
    assert "4 of 4 jobs; ended" in last
    assert "http-equiv" not in last
    assert '<a href="comparison.html">' in last


def test_a_failure_and_a_stop_are_on_the_page_and_it_loads_no_more(watched):
    asked = (*ASKED, "optimizer=pso", "seed=0,1")
    failed = run_command(*asked, CALLBACK, "sweep.returns=[objectiv]", cwd=watched)
    assert failed.returncode == 2
    page = (watched / "sweep" / "sweep.html").read_text()
    assert "2 of 2 jobs, 2 failed; ended" in page
    assert page.count("sweep.returns names objectiv") == 2
    stop = CALLBACK.replace("Watches}", "Watches, stop: 1}")
    stopped = run_command(*asked, stop, "seed=2,3", cwd=watched)
    assert stopped.returncode == 130
    page = (watched / "sweep" / "sweep.html").read_text()
    assert "1 of 2 jobs; interrupted" in page
    assert "http-equiv" not in page


def test_of_another_sweeper_the_last_batch_is_known_at_the_end_of_the_process(watched, monkeypatch):
    atexit = []
    monkeypatch.setattr(launcher.atexit, "register", lambda *call: atexit.append(call))
    asked = ("hydra/sweeper=basic", "hydra.sweeper.max_batch_size=1", "optimizer=pso", "seed=0,1")
    assert run_command(*ASKED, *asked, cwd=watched).returncode == 0
    page = watched / "sweep" / "sweep.html"
    assert "http-equiv" in page.read_text()
    ((function, *arguments),) = [call for call in atexit if "LivePage" in str(call[0])]
    function(*arguments)
    assert "2 of 2 jobs; ended" in page.read_text()
    assert "http-equiv" not in page.read_text()


@pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed here")
@pytest.mark.parametrize(("reload", "loads"), [(1, True), (None, False)])
def test_a_browser_loads_the_page_again_only_while_the_sweep_goes_on(tmp_path, reload, loads):
    count = (
        "<p id=told></p><script>const n = 1 + Number(sessionStorage.n || 0); sessionStorage.n = n;"
        "document.getElementById('told').textContent = `loaded ${n} times`;"
        # else the browser, which waits until nothing is left to do, would do so for ever
        "addEventListener('load', () => setTimeout(() => n > 1 && window.stop()));</script>"
    )
    dom, complaints = drawn(Report("live", reload=reload).add(Markup(count)), tmp_path)
    assert complaints == []
    times = int(re.search(r"loaded (\d+) times", dom)[1])
    assert (times > 1) == loads
