"""Where files are, and the one door through which they are written: whole, or not at all."""

import importlib.resources
import json
import math
import os
import tempfile
from pathlib import Path
from typing import Any

from tractexp.errors import UserError

PACKAGE = "pkg://"  # starts the path of a file inside an installed package


def located(path: str) -> Path:
    """The path of a file that may be named as `pkg://package/file`; raises `UserError` for an unknown package."""
    if not path.startswith(PACKAGE):
        return Path(path)
    package, _, name = path.removeprefix(PACKAGE).partition("/")
    try:
        return Path(str(importlib.resources.files(package))) / name
    except (ImportError, ValueError, TypeError) as error:
        raise UserError(f"{path}: there is no installed package '{package}'") from error


def write(path: Path | str, content: str | bytes) -> Path:
    """Write a file in one move and return its path: a reader never sees half of it, a full disk leaves none.

    Raises `UserError` where the folder or the file cannot be written.
    """
    path = Path(path)
    data = content.encode() if isinstance(content, str) else content
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
            os.chmod(temporary, 0o666 & ~_umask())
            os.replace(temporary, path)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
    except OSError as error:
        raise UserError(f"{path} cannot be written: {error.strerror or error}") from error
    return path


def write_json(path: Path | str, content: Any) -> Path:
    """Write JSON that any reader takes: numbers that do not exist (nan, infinity) become null."""
    return write(path, json.dumps(plain(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def plain(content: Any) -> Any:
    """Content as JSON knows it: NumPy's numbers and arrays, tuples and paths turned into plain ones, nan into None."""
    if isinstance(content, dict):
        return {str(key): plain(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [plain(value) for value in content]
    if hasattr(content, "tolist"):
        return plain(content.tolist())
    if isinstance(content, float):
        return content if math.isfinite(content) else None
    return content if isinstance(content, str | int | bool | None) else str(content)


def _umask() -> int:
    now = os.umask(0)
    os.umask(now)
    return now
