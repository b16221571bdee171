"""`tractexp` as a person types it: in this process, or in one of its own where that
is the point.
"""

import contextlib
import gc
import io
import logging
import os
import signal
import socket
import subprocess
import sys
import warnings
from unittest import mock

COLUMNS = {"COLUMNS": "1000"}  # no sentence is folded


def start_command(*arguments, cwd, **environment) -> subprocess.CompletedProcess:
    """`python -m tractexp` in a folder, in a process of its own."""
    command = [sys.executable, "-m", "tractexp", *arguments]
    there = os.environ | COLUMNS | environment
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, env=there)


def run_command(*arguments, cwd, **environment) -> subprocess.CompletedProcess:
    """The same in this process, which is then as it was: for what is printed, written
    and refused.
    """
    from tractexp.__main__ import main

    out, err = io.StringIO(), io.StringIO()
    printed = contextlib.redirect_stdout(out), contextlib.redirect_stderr(err)
    with as_it_was(environment), contextlib.chdir(cwd), printed[0], printed[1]:
        try:
            code = main(arguments)
        except SystemExit as end:
            code = end.code
    return subprocess.CompletedProcess(
        ["tractexp", *arguments], code, out.getvalue(), err.getvalue()
    )


def free_port() -> int:
    """A port that nobody listens to, asked of the system."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextlib.contextmanager
def as_it_was(environment):
    """Give back to the process what a command changes: surroundings, signals, warnings, loggers,
    garbage, Hydra.
    """
    from hydra.core.global_hydra import GlobalHydra
    from hydra.core.hydra_config import HydraConfig

    from tractexp.configuration import run_command
    from tractexp.sweep import identity
    from tractexp.text import progress
    from tractexp.tracking import process

    root, thresholds, handler = (
        logging.getLogger(),
        gc.get_threshold(),
        signal.getsignal(signal.SIGTERM),
    )
    handlers, level = root.handlers[:], root.level
    surroundings = mock.patch.dict(os.environ, COLUMNS | environment)
    # MLflow is imported where something is logged, not for each sentence that refuses a command
    not_ahead = mock.patch.object(process, "start_ahead")
    hydra = GlobalHydra.instance().hydra
    GlobalHydra.instance().clear()
    progress.build_console.cache_clear()  # a process of its own would have one of its own width
    try:
        with (
            surroundings,
            mock.patch.object(sys, "argv", ["tractexp"]),
            not_ahead,
            warnings.catch_warnings(),
        ):
            yield
    finally:
        process._end_ahead()
        progress.build_console.cache_clear()
        GlobalHydra.instance().hydra = hydra
        HydraConfig.instance().cfg = None
        run_command.remember_command([])
        run_command._started.clear()
        identity._read_file.cache_clear()
        signal.signal(signal.SIGTERM, handler)
        root.handlers[:], root.level = handlers, level
        gc.unfreeze()
        gc.set_threshold(*thresholds)
