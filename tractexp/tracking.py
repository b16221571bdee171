"""The one module that knows MLflow. Plain data goes in; MLflow is imported when something is logged, not before.

A run is written at its end and in one go, so a job that is killed leaves no run that claims to be running. The
store is created once, whoever comes first: the first process to arrive migrates an empty database aside, under a
lock, and moves it into place whole.
"""

import contextlib
import functools
import gc
import getpass
import json
import os
import re
import signal
import socket
import sqlite3
import ssl
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
import warnings
import webbrowser
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path
from typing import IO, Any

import numpy as np

from tractexp.errors import UserError, check_choice

STATUSES = ("FINISHED", "FAILED", "KILLED")
CURVE_POINTS = 1000  # a longer curve is thinned evenly; the files of the run keep every point
BATCH_METRICS, BATCH_PARAMETERS = 900, 100  # MLflow takes at most 1000 entries a batch, 100 of them parameters
VALUE_LENGTH = 6000  # characters MLflow stores of a parameter


@dataclass(frozen=True)
class Run:
    """What one job leaves in MLflow.

    `parameters` is the flattened configuration with the identified values, `metrics` the figures of the result.
    `curves` maps a name to (steps (n,) whole numbers, values (n,)), such as "fitness" by iteration. `artifacts` are
    files or folders to be copied. `parent` is the run id of the sweep. `seconds` is what the job took: MLflow shows
    it as the run's duration. `model` is a result file that `tractexp.identify.result.load` reads; with it the run
    offers a model for `mlflow.pyfunc.load_model`. `description` is Markdown.
    """

    experiment: str
    name: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    metrics: Mapping[str, float] = field(default_factory=dict)
    curves: Mapping[str, tuple[Sequence[float] | np.ndarray, Sequence[float] | np.ndarray]] = field(
        default_factory=dict
    )
    tags: Mapping[str, str] = field(default_factory=dict)
    artifacts: Sequence[Path] = ()
    description: str = ""
    parent: str | None = None
    status: str = "FINISHED"
    seconds: float = 0.0
    model: Path | None = None

    def check(self) -> None:
        """Raise `UserError` for a missing name, an unknown status, a file that is not there or a lopsided curve."""
        for key in ("experiment", "name"):
            if not getattr(self, key).strip():
                raise UserError(f"tracking: a run needs {key}, which is empty")
        check_choice("status", self.status, STATUSES)
        for path in (*self.artifacts, *([self.model] if self.model else [])):
            if not Path(path).exists():
                raise UserError(f"tracking: the artifact {path} of run '{self.name}' does not exist")
        for name, (steps, values) in self.curves.items():
            if len(steps) != len(values):
                raise UserError(f"tracking: the curve '{name}' has {len(steps)} steps and {len(values)} values")


def default_uri(folder: Path) -> str:
    """The store embedded in `folder`: an SQLite file under `outputs/`, as an absolute address."""
    return f"sqlite:///{(Path(folder).absolute() / 'outputs' / 'mlflow.db').as_posix()}"


def flatten(config: Mapping[str, Any], prefix: str = "") -> dict[str, str]:
    """A nested configuration as {"optimizer.population": "50"}; lists stay whole, values are spelled as in JSON."""
    flat: dict[str, str] = {}
    for key, value in config.items():
        if isinstance(value, Mapping):
            flat |= flatten(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = _text(value)
    return flat


def _text(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if value is None or isinstance(value, bool | int | float | list | tuple):
        return json.dumps(value, default=str, ensure_ascii=False)
    return str(value)


@functools.cache
def git_commit(folder: Path | None = None) -> str:
    """The commit of the repository around `folder` (default: where the process runs), "" where there is none.

    Uncommitted changes to tracked files add "-dirty".
    """
    command = ["git", "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=5)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def prepare(uri: str) -> None:
    """Create the store at `uri` if it is not there yet; any number of processes may do so at the same moment.

    Raises `UserError` when it cannot be written or reached, or was made by another version of MLflow.
    """
    _client(uri)


def log(run: Run, uri: str) -> str:
    """Write one finished run and return its id. Raises `UserError`; nothing is logged for a run that fails `check`."""
    run.check()
    client = _client(uri)
    with _sentences(uri):
        run_id, ended = _create(client, run, uri), _milliseconds()
        try:
            _write(client, run_id, run)
        except BaseException:
            client.set_terminated(run_id, "FAILED")
            raise
        client.set_terminated(run_id, run.status, end_time=ended)
    return run_id


def start_parent(run: Run, uri: str) -> str:
    """Open the run of a sweep and return its id, for `Run.parent` of the jobs. Close it in a `finally`."""
    run.check()
    client = _client(uri)
    with _sentences(uri):
        run_id = _create(client, run, uri)
        _write(client, run_id, run)
    return run_id


def finish_parent(
    run_id: str, uri: str, status: str, metrics: Mapping[str, float] | None = None, artifacts: Sequence[Path] = ()
) -> None:
    """Close the run of a sweep with its status, adding the figures and files of the sweep as a whole."""
    run = Run("sweep", run_id, metrics=metrics or {}, artifacts=artifacts, status=status)
    run.check()
    client = _client(uri)
    with _sentences(uri):
        _write(client, run_id, run)
        client.set_terminated(run_id, status)


def tag_experiment(experiment: str, tags: Mapping[str, str], uri: str) -> str:
    """Set tags on an experiment, such as a stored view of its runs, and return the experiment's id."""
    client = _client(uri)
    with _sentences(uri):
        experiment_id = _experiment(client, experiment, uri)
        for key, value in tags.items():
            client.set_experiment_tag(experiment_id, key, value)
    return experiment_id


def serve(uri: str, host: str = "127.0.0.1", port: int = 5000, page: str = "", open_browser: bool = False) -> int:
    """Run the MLflow UI on the store at `uri` until Ctrl-C or SIGTERM, and return the exit code.

    `page` is what follows the address, such as "#/experiments/1". Raises `UserError` when there is no store yet,
    the port is taken or the server does not start.
    """
    _check_servable(uri, host, port)
    address = f"http://{host}:{port}/"
    command = [sys.executable, "-m", "mlflow", "server", "--backend-store-uri", uri, "--registry-store-uri", uri]
    command += ["--host", host, "--port", str(port), "--workers", "1"]
    settings = {"MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false", "MLFLOW_DISABLE_TELEMETRY": "true"}
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    with tempfile.TemporaryFile() as output:
        server = subprocess.Popen(
            command, env=settings | os.environ, stdout=output, stderr=output, start_new_session=True
        )
        try:
            _wait_until_up(server, address, output)
            print(f"MLflow UI: {address}{page}  (Ctrl-C ends it)", flush=True)
            if open_browser:
                webbrowser.open(address + page)
            return server.wait()
        except KeyboardInterrupt:
            return 0
        finally:
            _end(server)


def _check_servable(uri: str, host: str, port: int) -> None:
    database = _database(uri)
    if database is None and uri.startswith("http"):
        raise UserError(f"{uri} is a running MLflow server already: open it in a browser")
    if database is not None and not database.is_file():
        raise UserError(f"there is no MLflow store {database} yet: the first run, 'python -m tractexp', creates it")
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except (OSError, OverflowError) as error:
            reason = error.strerror if isinstance(error, OSError) else "it must be 0 to 65535"
            raise UserError(f"port {port} on {host} cannot be used ({reason}): choose another, such as 5001") from error


def _wait_until_up(server: subprocess.Popen[bytes], address: str, output: IO[bytes], seconds: float = 120.0) -> None:
    """Return when the server answers; raises `UserError` with its last words if it ends or never does."""
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


def _create(client: Any, run: Run, uri: str) -> str:
    tags = {
        "mlflow.user": _user(),
        "mlflow.source.name": "tractexp",
        "mlflow.source.type": "LOCAL",
        "mlflow.source.git.commit": git_commit(),
        "mlflow.note.content": run.description,
        "mlflow.parentRunId": run.parent or "",
    }
    tags = {key: value for key, value in tags.items() if value} | {k: str(v) for k, v in run.tags.items()}
    started = _milliseconds() - round(1000 * run.seconds)
    return client.create_run(_experiment(client, run.experiment, uri), started, tags, run.name).info.run_id


def _write(client: Any, run_id: str, run: Run) -> None:
    from mlflow.entities import Metric, Param

    now = _milliseconds()
    points = [(name, value, 0) for name, value in run.metrics.items()]
    for name, (steps, values) in run.curves.items():
        keep = np.unique(np.linspace(0, len(steps) - 1, min(len(steps), CURVE_POINTS)).round().astype(int))
        points += [(name, values[i], steps[i]) for i in keep]
    metrics = [Metric(name, float(value), now, int(step)) for name, value, step in points]
    parameters = [Param(key, _text(value)[:VALUE_LENGTH]) for key, value in run.parameters.items()]
    chunks = zip_longest(_chunks(metrics, BATCH_METRICS), _chunks(parameters, BATCH_PARAMETERS), fillvalue=[])
    for some_metrics, some_parameters in chunks:
        client.log_batch(run_id, some_metrics, some_parameters)
    for path in run.artifacts:
        client.log_artifact(run_id, str(path))
    if run.model:
        from tractexp.tracking_model import log_model

        log_model(client, run_id, run.model)


def _chunks(items: list[Any], size: int) -> list[list[Any]]:
    return [items[i : i + size] for i in range(0, len(items), size)]


def _experiment(client: Any, name: str, uri: str) -> str:
    """The id of the experiment `name`, made if need be, its artifacts beside the database wherever the process runs."""
    from mlflow.exceptions import MlflowException

    found = client.get_experiment_by_name(name)
    if found is None:
        database = _database(uri)
        folder = re.sub(r"[^\w.-]+", "_", name)
        location = (database.parent / "mlartifacts" / folder).as_uri() if database else None
        try:
            return client.create_experiment(name, artifact_location=location)
        except MlflowException:  # another process made it first; if not, the next line raises
            found = client.get_experiment_by_name(name)
            if found is None:
                raise
    if found.lifecycle_stage == "deleted":
        raise UserError(
            f"the experiment '{name}' in {uri} was deleted: restore it with "
            f"'mlflow experiments restore --experiment-id {found.experiment_id}' or log under another name"
        )
    return found.experiment_id


def _milliseconds() -> int:
    return round(1000 * time.time())


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):  # a container without an entry for this user
        return ""


def _database(uri: str) -> Path | None:
    """The file behind an SQLite address, None for any other store."""
    return Path(uri.removeprefix("sqlite:///")) if uri.startswith("sqlite:///") else None


@functools.cache
def _client(uri: str) -> Any:
    """An open `MlflowClient`, the store behind it created or migrated. One per store and process."""
    if not uri.strip():
        raise UserError("tracking: the address of the MLflow store is empty; it is like sqlite:////folder/mlflow.db")
    database = _database(uri)
    _import(sql=database is not None)
    from mlflow import MlflowClient

    with _sentences(uri):
        if database is None:
            _reach(uri)
            return MlflowClient(uri, uri)
        database.parent.mkdir(parents=True, exist_ok=True)
        with _lock(database.with_name(database.name + ".lock")):
            if not database.exists():
                _create_database(database)
            _check_database(database)
            client = MlflowClient(uri, uri)
            client.search_experiments(max_results=1)
            return client


def _create_database(database: Path) -> None:
    """Migrate an empty database in memory and move a copy into place, so that a killed process leaves none half-made.

    On disk the migrations wait hundreds of times for the drive: 3 to 6 s on a busy one, against 1 s.
    """
    from mlflow import MlflowClient

    memory = "file:tractexp-fresh?mode=memory&cache=shared"
    with (
        contextlib.closing(sqlite3.connect(memory, uri=True)) as connection,
        tempfile.TemporaryDirectory(dir=database.parent) as folder,
    ):
        MlflowClient(f"sqlite:///{memory}&uri=true").search_experiments(max_results=1)
        connection.execute("VACUUM INTO ?", (str(Path(folder, "fresh.db")),))
        os.replace(Path(folder, "fresh.db"), database)


def _check_database(database: Path) -> None:
    """Raise at once what MLflow would take minutes of retrying to find: no database, or one that is read-only."""
    with contextlib.closing(sqlite3.connect(database)) as connection:
        connection.execute("PRAGMA schema_version")
    if not os.access(database, os.W_OK):
        raise PermissionError(f"{database} may not be written")


@functools.cache
def _import(sql: bool) -> None:
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
    os.environ.setdefault("MLFLOW_LOGGING_LEVEL", "WARNING")
    with light_import():
        import mlflow

        if sql:  # here, outside the lock that is held to open the database
            import mlflow.store.tracking.sqlalchemy_store  # noqa: F401


@contextlib.contextmanager
def light_import() -> Iterator[None]:
    """Import large packages quietly and without looking for garbage.

    What they make lives for ever: looking through it costs a third of the import, and as much again at the end of
    the process unless it is set aside (`gc.freeze`).
    """
    collecting = gc.isenabled()
    gc.disable()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        gc.freeze()
        if collecting:
            gc.enable()


@contextlib.contextmanager
def _lock(path: Path) -> Iterator[None]:
    """Hold `path` exclusively among processes; a process that dies lets go of it."""
    with path.open("a+b") as file:
        if os.name == "nt":
            import msvcrt

            file.seek(0)
            while True:
                try:
                    msvcrt.locking(file.fileno(), msvcrt.LK_LOCK, 1)  # gives up after ten seconds
                    break
                except OSError:
                    continue
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX)
        yield


@contextlib.contextmanager
def _sentences(uri: str) -> Iterator[None]:
    """Turn what MLflow, the database and the file system raise into one sentence that names the store.

    What they warn of is for those who develop with them, and stays off the user's terminal.
    """
    from mlflow.exceptions import MlflowException

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except Exception as error:
        known = isinstance(error, MlflowException | sqlite3.Error | OSError)
        if not known and not type(error).__module__.startswith("sqlalchemy."):
            raise
        reason = str(error).strip().partition("\n")[0]
        if "database schema" in reason or "Can't locate revision" in reason:
            raise UserError(
                f"the MLflow store {uri} was made by another version of MLflow: 'mlflow db upgrade {uri}' brings an "
                "older one up to date (keep a copy), a newer one needs the newer MLflow"
            ) from error
        raise UserError(f"the MLflow store {uri} cannot be used: {reason}") from error


def _reach(uri: str) -> None:
    """Ask a server for its health, briefly: MLflow itself would go on trying for minutes. Raises `OSError`."""
    if not uri.startswith(("http://", "https://")):
        return
    try:
        urllib.request.urlopen(uri.rstrip("/") + "/health", timeout=3).close()
    except urllib.error.HTTPError:
        pass  # it answered; whether it lets us in is MLflow's to say
    except urllib.error.URLError as error:
        if not isinstance(error.reason, ssl.SSLError):
            raise
