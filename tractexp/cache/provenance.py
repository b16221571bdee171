"""Where a result comes from: the version, commit and code of this package, and digests of the
records.
"""

import functools
import hashlib
import subprocess
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).parents[1]


@functools.cache
def read_version() -> str:
    """The version of the installed package, "" where it runs uninstalled."""
    from importlib.metadata import PackageNotFoundError
    from importlib.metadata import version as installed

    try:
        return installed("tractexp")
    except PackageNotFoundError:
        return ""


@functools.cache
def find_commit(folder: Path = PACKAGE) -> str:
    """The commit of the repository that keeps the files of `folder`; "" where none does, as for an
    installed wheel.

    By default that of this package, wherever the process runs. Uncommitted changes to tracked files
    add "-dirty".
    """
    try:
        if not _run_git(folder, "ls-files", "--", "."):
            return ""
        return _run_git(folder, "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")
    except (OSError, subprocess.SubprocessError):
        return ""


def _run_git(folder: Path, *command: str) -> str:
    """The output of a git command in a folder."""
    done = subprocess.run(
        ["git", *command], cwd=folder, capture_output=True, text=True, timeout=5, check=True
    )
    return done.stdout.strip()


@functools.cache
def hash_code() -> str:
    """SHA-256 of the installed code, plugins of all packages included: what is computed by the same
    is the same.
    """
    total = hashlib.sha256()
    for file in sorted({file for folder in list_folders() for file in folder.rglob("*.py")}):
        total.update(hashlib.sha256(file.read_bytes()).digest())
    return total.hexdigest()


def list_folders() -> set[Path]:
    """The folders of this package and of those with plugins."""
    from tractexp.configuration import plugin  # which imports NumPy

    return {
        PACKAGE,
        *(Path(path) for package in plugin.import_packages() for path in package.__path__),
    }


def hash_record(record: Any) -> str:
    """SHA-256 of the channels of a `Record` as they were read: equal for equal numbers, whatever
    the file is called.
    """
    if record.digest:
        return record.digest

    import numpy as np

    total = hashlib.sha256()
    for name in ("t", "U", "P", "Q", "f", "U2"):
        values = getattr(record, name)
        if values is not None:
            total.update(name.encode())
            total.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    return total.hexdigest()
