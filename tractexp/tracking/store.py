"""The store behind an address: created once by the first process, opened quickly, its errors as one
sentence.

MLflow's own migrations fail when two processes start them together, and stay half-done when a
process is killed. Here the first process makes the database in memory, under a lock, and moves it
into place whole.
"""

import contextlib
import functools
import gc
import logging
import os
import sqlite3
import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tractexp.errors import UserError
from tractexp.storage import credentials, files, locks
from tractexp.text import quoting
from tractexp.tracking.owner import close_quietly

PATIENCE = 15.0  # s to wait for a process that writes to the database
VARIABLE = "MLFLOW_TRACKING_URI"  # by which MLflow's own tools choose the store
LONGEST_STORE_WAIT = 120.0  # s to wait for another process that makes the store or opens it


def find_default_uri(folder: Path) -> str:
    """The store embedded in `folder`: an SQLite file under `outputs/`, as an absolute address."""
    return f"sqlite:///{(Path(folder).absolute() / 'outputs' / 'mlflow.db').as_posix()}"


def choose_uri(setting: str | None) -> str:
    """The store that a setting chooses, else MLflow's own variable; "" where neither does."""
    return setting or os.environ.get(VARIABLE, "").strip()


def resolve_address(setting: str | None) -> str:
    """The store that was chosen, or the default one; both from the current folder, as an absolute
    address.

    Raises `UserError` where it holds a password.
    """
    chosen = choose_uri(setting)
    if not chosen:
        return find_default_uri(Path.cwd())
    credentials.check("the MLflow store", chosen)
    database = find_database(chosen)
    return f"sqlite:///{database.as_posix()}" if database else chosen


def find_database(uri: str) -> Path | None:
    """The file behind an SQLite address, None for any other store; a relative one counts from the
    current folder.
    """
    return Path(uri.removeprefix("sqlite:///")).absolute() if uri.startswith("sqlite:///") else None


@functools.cache
def open_store(uri: str) -> Any:
    """An open `MlflowClient`, the store behind it created where it is not there yet. One per store
    and process.

    Any number of processes may do so at the same moment. Runs still marked as running by processes
    that have ended are closed. Raises `UserError` for a store that cannot be written or reached, or
    comes from another version of MLflow.
    """
    credentials.check("the MLflow store", uri)
    if not uri.strip():
        raise UserError(
            "tracking: the address of the MLflow store is empty; it is like"
            " sqlite:////folder/mlflow.db"
        )
    database = find_database(uri)
    import_mlflow(sql=database is not None)
    from mlflow import MlflowClient

    with raise_sentences(uri):
        if database is None:
            _reach(uri)
            client = MlflowClient(uri, uri)
            close_quietly(client)
            return client
        database.parent.mkdir(parents=True, exist_ok=True)
        with locks.lock_file(database.with_name(database.name + ".lock"), LONGEST_STORE_WAIT):
            if not database.exists():
                _create_database(database)
            _check_database(database)
            client = MlflowClient(uri, uri)
            client.search_experiments(max_results=1)
        close_quietly(client)
        return client


def _create_database(database: Path) -> None:
    """Put an empty database in place whole, so that a killed process leaves no half of one.

    MLflow's migrations take a second of work; what they came to is kept for the next folder.
    """
    # imports NumPy, for which the process that logs does not wait
    from tractexp.cache.store import DATABASES, compute_key, read_version

    makers = [read_version(name) for name in ("mlflow", "sqlalchemy", "alembic")]
    files.write(database, DATABASES.get(compute_key(makers, sqlite3.sqlite_version), _migrate))


def _migrate() -> bytes:
    """The content of an empty database, migrated in memory: without the experiment that MLflow
    opens one with, whose place is the folder of its user.

    On disk the migrations wait hundreds of times for the drive: 3 to 6 s on a busy one, against 1
    s.
    """
    from mlflow import MlflowClient

    memory = "file:tractexp-fresh?mode=memory&cache=shared"
    with (
        contextlib.closing(sqlite3.connect(memory, uri=True)) as connection,
        tempfile.TemporaryDirectory() as folder,
    ):
        MlflowClient(f"sqlite:///{memory}&uri=true").search_experiments(max_results=1)
        with connection:
            connection.execute("DELETE FROM experiments")
        connection.execute("VACUUM INTO ?", (str(Path(folder, "fresh.db")),))
        return Path(folder, "fresh.db").read_bytes()


def _check_database(database: Path) -> None:
    """Raise soon what MLflow would take minutes of retrying to find: no database, one damaged,
    locked or read-only.
    """
    with contextlib.closing(sqlite3.connect(database, timeout=PATIENCE)) as connection:
        connection.execute("SELECT count(*) FROM sqlite_master").fetchall()
    if not os.access(database, os.W_OK):
        raise PermissionError(f"{database} may not be written")


@functools.cache
def import_mlflow(sql: bool = False) -> None:
    """Import MLflow without its telemetry and remarks, and with `sql` what it needs
    for a database.
    """
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
    os.environ.setdefault("MLFLOW_LOGGING_LEVEL", "WARNING")
    os.environ.setdefault("MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR", "false")
    # what cannot be sent now is sent later by `sync`
    os.environ.setdefault("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "2")
    os.environ.setdefault("MLFLOW_HTTP_REQUEST_TIMEOUT", "30")
    with import_lightly():
        import mlflow

        if sql:  # here, outside the lock that is held to open the database
            import mlflow.store.tracking.sqlalchemy_store  # noqa: F401


@contextlib.contextmanager
def import_lightly() -> Iterator[None]:
    """Import large packages quietly and without looking for garbage.

    What they make lives for ever: looking through it costs a third of the import, and as much again
    at the end of the process unless it is set aside (`gc.freeze`).
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
def raise_sentences(uri: str) -> Iterator[None]:
    """Turn what MLflow, the database and the file system raise into one sentence that names the
    store.

    What they warn of, and what MLflow logs of an error before it raises it, is for those who
    develop with them, and stays off the user's terminal.
    """
    from mlflow.exceptions import MlflowException

    try:
        with warnings.catch_warnings(), _silence_logger("mlflow"):
            warnings.simplefilter("ignore")
            yield
    except Exception as error:
        expected = isinstance(error, MlflowException | sqlite3.Error | OSError)
        if not expected and not type(error).__module__.startswith("sqlalchemy."):
            raise
        reason = str(error).strip().partition("\n")[0]
        if "database schema" in reason or "Can't locate revision" in reason:
            raise UserError(
                f"the MLflow store {uri} comes from another version of MLflow:"
                f" '{quoting.shell('mlflow', 'db', 'upgrade', uri)}' brings an older one up to date"
                " (keep a copy), a newer one needs the newer MLflow"
            ) from error
        raise UserError(f"the MLflow store {uri} cannot be used: {reason}") from error


@contextlib.contextmanager
def _silence_logger(name: str) -> Iterator[None]:
    """Let a logger and those below it say nothing."""
    logger = logging.getLogger(name)
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(level)


def _reach(uri: str) -> None:
    """Ask a server for its health, briefly: MLflow itself would go on trying for minutes. Raises
    `OSError`.
    """
    if not uri.startswith(("http://", "https://")):
        return
    import ssl
    import urllib.error
    import urllib.request

    try:
        urllib.request.urlopen(uri.rstrip("/") + "/health", timeout=3).close()
    except urllib.error.HTTPError:
        pass  # it answered; whether it lets us in is MLflow's to say
    except urllib.error.URLError as error:
        if not isinstance(error.reason, ssl.SSLError):
            raise
