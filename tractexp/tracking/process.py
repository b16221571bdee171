"""Log from a second process that gets MLflow ready while the job computes.

Importing MLflow and opening the store take two seconds, and in a thread they would hold up the job
by as much (measured). In a process of their own they cost a job that takes as long next to nothing,
if they begin when the command does: before the configuration is composed, and long before there is
anything to log. For a single job; the workers of a sweep keep every core busy and import MLflow
once each, so they call `tracking.log`.
"""

import atexit
import contextlib
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Iterable, Iterator
from types import TracebackType
from typing import Any

from tractexp.errors import UserError
from tractexp.process import interpreter
from tractexp.tracking.run import TrackedRun, log
from tractexp.tracking.store import import_mlflow, open_store

# what MLflow imports and logs without
OPTIONAL = ("pandas", "polars", "pyarrow", "scipy", "IPython", "pygments")
_ahead: "list[Logger]" = []


def start_ahead() -> None:
    """Start a process for `logger` to take; it ends with this one where nothing is logged."""
    if not _ahead:
        atexit.register(_end_ahead)
    _ahead.append(Logger())


def _end_ahead() -> None:
    """End the processes that nobody took. A process that was taken but got no run
    ends by itself.
    """
    while _ahead:
        _ahead.pop().close()


def open_logger(uri: str) -> "Logger":
    """The process that was started ahead or a new one, with the store at `uri` opened."""
    process = _ahead.pop() if _ahead else Logger()
    process.open(uri)
    return process


class Logger:
    """`with Logger(uri) as logger: ...; logger.log(run)`. Without a run it logs nothing.

    It imports MLflow at once. It creates the store when it gets the address, here or by `open`: do
    so once the input is valid.
    """

    def __init__(self, uri: str = ""):
        """Start the process that logs into a store."""
        self._process = subprocess.Popen(
            interpreter.build_command("-c", f"from {__name__} import main; main()"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            # Ctrl-C is the job's business: it ends this process by leaving the `with`
            start_new_session=True,
        )
        self._opened = False
        if uri:
            self.open(uri)

    def __enter__(self) -> "Logger":
        """The logger."""
        return self

    def open(self, uri: str) -> None:
        """Let the process create or open the store at `uri` meanwhile, once; `log` raises what is
        wrong with it.
        """
        self._tell(uri)
        self._opened = True

    def _tell(self, message: Any) -> None:
        """Send a message to the process."""
        assert self._process.stdin is not None
        try:
            pickle.dump(message, self._process.stdin)
            self._process.stdin.flush()
        except BrokenPipeError:
            pass  # it has ended, which `log` reports

    def log(self, run: TrackedRun) -> str:
        """Log a run by `tracking.log`, once. Paths in `run` are taken from where the process was
        started.
        """
        run.check()
        self._tell(run)
        answer, _ = self._process.communicate()
        if not answer:
            raise UserError(
                f"the process that logs to MLflow ended with code {self._process.returncode}"
            )
        run_id, error = pickle.loads(answer)
        if error:
            raise UserError(error)
        return run_id

    def close(self) -> None:
        """End the process: at once where no store was opened, else when the store is whole."""
        if self._process.returncode is None:
            if not self._opened:
                self._process.kill()
            self._process.communicate()  # it reads the end of its input and ends

    def __exit__(
        self, kind: type | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the process."""
        self.close()


@contextlib.contextmanager
def hide_packages(names: Iterable[str]) -> Iterator[None]:
    """Let imports of these packages fail as where they are not installed; what was imported before
    stays.
    """
    modules: dict[str, Any] = dict.fromkeys(name for name in names if name not in sys.modules)
    sys.modules.update(modules)  # None in the place of a module refuses its import
    try:
        yield
    finally:
        for name in modules:
            del sys.modules[name]


def main() -> None:
    """Get ready, wait for an address and a run on standard input, log the run, answer on standard
    output.

    What ends the job may be sent to all its processes. This one ends when the job does, by the end
    of its input, and finishes the run that it has.
    """
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    run_id = problem = ""
    try:
        with hide_packages(OPTIONAL):
            import_mlflow()
            open_store(uri := pickle.load(sys.stdin.buffer))
        run_id = log(pickle.load(sys.stdin.buffer), uri)
    except (EOFError, pickle.UnpicklingError):
        os._exit(0)  # nothing to log, and perhaps nobody listens
    except UserError as error:
        problem = str(error)
        sys.stdin.buffer.read()
    with contextlib.suppress(BrokenPipeError):
        sys.stdout.buffer.write(pickle.dumps((run_id, problem)))
        sys.stdout.flush()
    # all is on disk: do not keep the job waiting for the teardown of some thousand modules
    os._exit(0)
