"""MLflow's own page on the runs, on this machine only."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
import webbrowser
from collections.abc import Callable
from typing import IO

from tractexp.errors import UserError
from tractexp.process import interpreter
from tractexp.tracking.store import find_database

USUAL_START_SECONDS = 10  # s until the server answers: 5 on two free cores, 20 on busy ones


def serve(
    uri: str,
    host: str = "127.0.0.1",
    port: int = 5000,
    page: Callable[[str], str] = lambda uri: "",
    open_browser: bool = False,
) -> int:
    """Run the MLflow UI on the store at `uri` until Ctrl-C or SIGTERM, and return the exit code.

    `page` makes what follows the address, such as "#/experiments/1", of the store, while the server
    starts. Raises `UserError` when there is no store yet, the port is taken or the server does not
    start.
    """
    check_servable(uri, host, port)
    address = f"http://{host}:{port}/"
    print(
        f"starting the MLflow UI on port {port}, which takes about {USUAL_START_SECONDS} s; it"
        f" shows {uri}",
        flush=True,
    )
    started = time.monotonic()
    command = interpreter.build_command("-m", "tractexp.compat.mlflow_own_origin", "server")
    command += ["--backend-store-uri", uri, "--registry-store-uri", uri]
    command += ["--host", host, "--port", str(port), "--workers", "1", *_guard(host, port)]
    settings = {
        "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false",
        "MLFLOW_DISABLE_TELEMETRY": "true",
    } | os.environ
    settings["MLFLOW_SERVER_DISABLE_SECURITY_MIDDLEWARE"] = "false"
    settings[interpreter.SAFE_PATH] = "1"  # for the servers that MLflow starts
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    with tempfile.TemporaryFile() as output:
        server = subprocess.Popen(
            command, env=settings, stdout=output, stderr=output, start_new_session=True
        )
        try:
            opened = address + page(uri)
            _wait_until_up(server, address, output)
            print(
                f"ready after {time.monotonic() - started:.0f} s: {opened}  (Ctrl-C ends it)",
                flush=True,
            )
            if open_browser:
                webbrowser.open(opened)
            return server.wait()
        except KeyboardInterrupt:
            return 0
        finally:
            _end(server)


def _guard(host: str, port: int) -> list[str]:
    """Options by which pages from elsewhere are refused: by the name they call this computer, and
    by their origin.

    MLflow's own choice lets in every name of a private network; and the settings of a server of the
    user's own, which may stand in the environment, are not meant for this one.
    """
    served = [f"{each}:{port}" for each in dict.fromkeys((host, "localhost"))]
    names = [name for each in served for name in (each.rpartition(":")[0], each)]
    origins = [f"http://{name}" for name in (names if port == 80 else served)]
    options = {
        "allowed-hosts": ",".join(names),
        "cors-allowed-origins": ",".join(origins),
        "x-frame-options": "DENY",
    }
    return [word for name, value in options.items() for word in (f"--{name}", value)]


def check_servable(uri: str, host: str = "127.0.0.1", port: int = 5000) -> None:
    """Raise `UserError` when there is no store at `uri` yet or the port is taken;
    creates nothing.
    """
    database = find_database(uri)
    if database is None and uri.startswith("http"):
        raise UserError(f"{uri} is a running MLflow server already: open it in a browser")
    if database is not None and not database.is_file():
        raise UserError(
            f"there is no MLflow store {database} yet: the first run, 'python -m tractexp', creates"
            " it"
        )
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except (OSError, OverflowError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it must be 0 to 65535"
            raise UserError(
                f"port {port} on {host} cannot be used ({reason}): choose another, such as 5001"
            ) from error


def _wait_until_up(
    server: subprocess.Popen[bytes], address: str, output: IO[bytes], seconds: float = 120.0
) -> None:
    """Return when the server answers; raises `UserError` with its last words if it ends or never
    does.
    """
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline and server.poll() is None:
        with contextlib.suppress(OSError), urllib.request.urlopen(address + "health", timeout=2):
            return
        time.sleep(0.1)
    output.seek(0)
    last = output.read().decode(errors="replace").strip().rpartition("\n")[2]
    raise UserError(f"the MLflow UI did not start on {address}: {last or 'it said nothing'}")


def _end(server: subprocess.Popen[bytes]) -> None:
    """End the server with the workers it started, which share its session."""
    if os.name == "nt":
        server.terminate()
    else:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(server.pid, signal.SIGTERM)
    try:
        server.wait(10)
    except subprocess.TimeoutExpired:
        server.kill()
