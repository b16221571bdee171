"""Locks of files among processes: one that dies lets go of what it held."""

import contextlib
import errno
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from tractexp.errors import UserError
from tractexp.storage import files


@contextlib.contextmanager
def lock_file(path: Path, seconds: float) -> Iterator[None]:
    """Hold the file `path` exclusively among processes; one that dies lets go of it.

    Raises `TimeoutError` where another process holds it for so long.
    """
    deadline = time.monotonic() + seconds
    with path.open("a+b") as file:
        while not _try_lock(file):
            if time.monotonic() > deadline:
                raise TimeoutError(f"another process has held {path} for {seconds:.0f} s")
            time.sleep(0.05)
        yield


@contextlib.contextmanager
def claim_file(path: Path, claimant: str) -> Iterator[None]:
    """Hold the file `path`, which says by whom, and remove it at the end; a process that dies lets
    go of it.

    Raises `UserError` where another process holds it. A file system without locks holds nothing.
    """
    with files.raise_as_user_error(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        file = _take_lock(path)
    with file:
        file.truncate(0)
        file.write(files.encode_text(claimant))
        file.flush()
        try:
            yield
        finally:
            with contextlib.suppress(OSError):
                path.unlink()


def read_claim(path: Path) -> str:
    """By whom a file is held that `claim_file` made; "" where nobody holds it."""
    try:
        with files.open_ordinary_file(path) as file:
            return "" if _try_lock(file) else _read_claimant(file)
    except OSError:
        return ""


def _read_claimant(file: IO[bytes]) -> str:
    """Who holds a lock, as its file says."""
    return file.read(200).decode(errors="replace") or "another process"


def _take_lock(path: Path) -> IO[bytes]:
    """The file of a lock, locked. What was removed between opening and locking it is
    none any more.
    """
    while True:
        files.is_there(path)
        file = path.open("a+b")
        try:
            if not _try_lock(file):
                file.seek(0)
                raise UserError(
                    f"{path.parent} is in use by {_read_claimant(file)}: wait until that has ended,"
                    " or give another folder"
                )
            if os.name == "nt" or (
                path.exists() and os.path.samestat(os.fstat(file.fileno()), os.stat(path))
            ):
                return file
        except BaseException:
            file.close()
            raise
        file.close()


def _try_lock(file: IO[bytes]) -> bool:
    """Whether this process got the lock of an open file."""
    try:
        if os.name == "nt":
            import msvcrt

            file.seek(0)
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EAGAIN, errno.EDEADLK):
            return False
        # a file system that knows no locks
        if error.errno not in (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS):
            raise
    return True
