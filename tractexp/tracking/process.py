"""Log from a second process that gets MLflow ready while the job computes.

Importing MLflow and opening the store take over a second, and in a thread they would hold up the job by as much
(measured). In a process of their own they cost a job that computes that long next to nothing. For a single job;
the workers of a sweep keep every core busy and import MLflow once each, so they call `tracking.log`.
"""

import os
import pickle
import subprocess
import sys
from types import TracebackType

from tractexp.errors import UserError
from tractexp.tracking.run import Run, log
from tractexp.tracking.store import prepare


class Logger:
    """`with Logger(uri) as logger: ...; logger.log(run)`. Left without a run, it logs nothing.

    Start it when the input has been found right: the process creates the store.
    """

    def __init__(self, uri: str):
        command = [sys.executable, "-c", f"from {__name__} import main; main({uri!r})"]
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is the job's business: it ends this process by leaving the `with`
        )

    def __enter__(self) -> "Logger":
        return self

    def log(self, run: Run) -> str:
        """As `tracking.log`, once. Paths in `run` are taken from where the process was started."""
        run.check()
        answer, _ = self._process.communicate(pickle.dumps(run))
        if not answer:
            raise UserError(f"the process that logs to MLflow ended with code {self._process.returncode}")
        run_id, error = pickle.loads(answer)
        if error:
            raise UserError(error)
        return run_id

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._process.returncode is None:
            self._process.communicate()  # it reads the end of its input and ends


def main(uri: str) -> None:
    """Get ready, wait for the run on standard input, log it, answer on standard output."""
    run_id = problem = ""
    try:
        prepare(uri)
        if run := sys.stdin.buffer.read():
            run_id = log(pickle.loads(run), uri)
    except UserError as error:
        problem = str(error)
        sys.stdin.buffer.read()
    sys.stdout.buffer.write(pickle.dumps((run_id, problem)))
    sys.stdout.flush()
    os._exit(0)  # all is on disk: do not keep the job waiting for the teardown of some thousand modules
