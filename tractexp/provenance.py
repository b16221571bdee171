"""Where a result comes from: the version, commit and code of this package, and digests of the records."""

import functools
import hashlib
import shlex
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).parent


@functools.cache
def version() -> str:
    """The version of the installed package, "" where it runs uninstalled."""
    from importlib.metadata import PackageNotFoundError
    from importlib.metadata import version as installed

    try:
        return installed("tractexp")
    except PackageNotFoundError:
        return ""


@functools.cache
def commit(folder: Path = PACKAGE) -> str:
    """The commit of the repository that keeps the files of `folder`; "" where none does, as for an installed wheel.

    By default that of this package, wherever the process runs. Uncommitted changes to tracked files add "-dirty".
    """
    try:
        if not _git(folder, "ls-files", "--", "."):
            return ""
        return _git(folder, "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*")
    except (OSError, subprocess.SubprocessError):
        return ""


def _git(folder: Path, *command: str) -> str:
    done = subprocess.run(["git", *command], cwd=folder, capture_output=True, text=True, timeout=5, check=True)
    return done.stdout.strip()


@functools.cache
def code() -> str:
    """SHA-256 of the installed code, plugins of all packages included: what is computed by the same is the same."""
    made = hashlib.sha256()
    for file in sorted({file for folder in folders() for file in folder.rglob("*.py")}):
        made.update(hashlib.sha256(file.read_bytes()).digest())
    return made.hexdigest()


def folders() -> set[Path]:
    """The folders of this package and of those with plugins."""
    from tractexp import plugin

    return {PACKAGE, *(Path(path) for package in plugin.packages() for path in package.__path__)}


def told(record: Any) -> dict[str, Any]:
    """The identity of a `Record`: sha256, source, base and, where another one, that of its file.

    Kilovolts and MVA are null where nobody said what one per unit is.
    """
    known = record.file_base.in_mva
    source = {"file": record.source, **record.identity}
    made = {"sha256": digest(record), "source": source, "base": _base(record.base, known)}
    return made | ({} if record.original_base is None else {"given_base": _base(record.original_base, known)})


def in_words(told: Mapping[str, Any]) -> str:
    """The identity of a record as `told` gives it: where it is from and what one per unit is; "" in early results."""
    source, said = told.get("source", {}), []
    said += [f"{key} {text}" * (key != "file") or text for key, text in source.items() if text]
    for key, name in (("base", "per unit of"), ("given_base", "in the file of")):
        base = told.get(key, {})
        sizes = [f"{base[size]:.6g} {size.partition('_')[2]}" for size in ("voltage_kV", "power_MVA") if base.get(size)]
        said += [f"{name} {' and '.join(sizes)}"] if sizes else []
    return "; ".join(said)


def _base(base: Any, known: bool) -> dict[str, Any]:
    voltage = None if base.voltage == 1.0 else base.voltage
    power = base.power if known else None
    return {"voltage_kV": voltage, "power_MVA": power, "frequency_Hz": base.frequency, "origin": base.origin}


def digest(record: Any) -> str:
    """SHA-256 of the channels of a `Record` as they were read: equal for equal numbers, whatever the file is called."""
    if record.digest:
        return record.digest

    import numpy as np

    made = hashlib.sha256()
    for name in ("t", "U", "P", "Q", "f", "U2"):
        values = getattr(record, name)
        if values is not None:
            made.update(name.encode())
            made.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
    return made.hexdigest()


_started: list[str] = []


def started(arguments: list[str]) -> None:
    """Remember the command line that this process was started by."""
    _started[:] = ["tractexp", *arguments]


def command() -> str:
    """The command line of this run, to be typed again; "" where there was none, as from Python."""
    return shlex.join(_started)
