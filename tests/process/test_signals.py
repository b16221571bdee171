"""Ctrl-C and SIGTERM end every task within two seconds of its own processor time, and say so in one
sentence.

Both raise a `KeyboardInterrupt`, of which every task hears once, and one task by either way.
"""

import os
import signal
import threading
import time

import matplotlib.figure  # noqa: F401  an import that a signal ends would leave half a package to the tests that follow
import numpy as np
import pytest
import sympy  # noqa: F401
from command_line import run_command

from tractexp.__main__ import end_on_signal

if os.name == "nt":
    pytest.skip("ends a run by a signal", allow_module_level=True)

HEARD = 2.0  # s
ALWAYS = ("tracking.enabled=false", "hydra.run.dir=run")
QUICK = "optimizer=multistart_least_squares"
TASKS = {
    "identify": ("optimizer=issa", "optimizer.iterations=1000000"),
    # the search ends soon: the estimate, its profiles and rivals are at work
    "judgement": (QUICK, "data=tibet_30pct"),
    "discrepancy": ("task=discrepancy", "data=tibet_30pct"),
    "profile": (QUICK, "task=profile"),
    "posterior": (QUICK, "task=posterior", "task.steps=200000"),
    "generalise": (QUICK, "task=generalise", "data=tibet"),
    "benchmark": ("task=benchmark", "task.cores=1"),
    "paper": ("task=paper", "task.workers=1"),
    "judgement of a table": (QUICK, "budget=200", "data=csv", "data.train=[shorter.csv]"),
    "survey of a long table": ("task=survey", "data.path=.", "task.cores=1"),
    "long table": (QUICK, "data=csv", "data.train=[long.csv]"),
}
WAYS = {signal.SIGTERM: 143, signal.SIGINT: 130}


class Sender:
    """Sends this process a signal, so many seconds of its processor time after a command has begun
    to run.
    """

    def __init__(self, way: int, after: float):
        self.way, self.after, self.sent, self.over = way, after, 0.0, False
        self.begun = time.process_time()
        self.thread = threading.Thread(target=self._run)
        self.thread.start()

    def _run(self) -> None:
        while signal.getsignal(signal.SIGTERM) is not end_on_signal:  # it would end the tests
            time.sleep(0.01)
            if self.over:
                return
        begun = time.process_time()
        while time.process_time() < begun + self.after and not self.over:
            time.sleep(0.01)
        if not self.over:
            self.sent = time.process_time()
            os.kill(os.getpid(), self.way)

    def heard(self) -> float:
        """Seconds from the signal until now."""
        self.over = True
        self.thread.join()
        return time.process_time() - self.sent


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    """A folder with a table of five hours, and one of ten minutes."""
    folder, rows = tmp_path_factory.mktemp("desk"), 900_000
    t = np.arange(rows) / 50
    U = np.where((t > 100) & (t % 300 > 50) & (t % 300 < 50.2), 0.6, 1.0)
    lines = map(
        "{:.2f},{:.1f},{:.2f},{:.2f}".format,
        t.tolist(),
        U.tolist(),
        (0.8 * U).tolist(),
        (0.6 * U).tolist(),
    )
    lines = ["t,U,P,Q", *lines]
    (folder / "long.csv").write_text("\n".join(lines) + "\n")
    (folder / "shorter.csv").write_text("\n".join(lines[:30_000]) + "\n")
    return folder


@pytest.mark.parametrize(
    ("task", "way"),
    [("identify", signal.SIGINT), *((task, signal.SIGTERM) for task in TASKS)],
    ids=lambda one: one.name if isinstance(one, signal.Signals) else one,
)
def test_a_task_hears_a_signal(task, way, desk, tmp_path):
    folder = desk if "table" in task else tmp_path
    # as shells leave it to what they run in the background
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    sender = Sender(way, 0.7 if way == signal.SIGTERM else 1.4)
    try:
        done = run_command(*ALWAYS, *TASKS[task], cwd=folder)
    finally:
        took = sender.heard()
    assert sender.sent, f"the command ended before the signal was sent: {done.stderr}"
    assert took < HEARD
    assert done.returncode == WAYS[way], done.stderr
    said = [line for line in done.stderr.splitlines() if line.startswith("tractexp: ")]
    assert len(said) == 1, done.stderr
    assert "Traceback" not in done.stderr
    assert not (folder / "run" / "result.json").exists()
