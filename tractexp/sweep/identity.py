"""What makes two jobs the same: their settings, and the code and data they work with."""

import functools
import glob
import hashlib
import json
from collections.abc import Mapping
from typing import Any

from tractexp.cache import provenance
from tractexp.configuration.composition import list_texts
from tractexp.errors import UserError
from tractexp.storage import files
from tractexp.storage.files import locate_file


def hash_configuration(config: Mapping[str, Any], choices: Mapping[str, str]) -> str:
    """SHA-256 of a job's settings. Where it is logged and what it returns do not belong to what it
    does.
    """
    settings = {key: value for key, value in config.items() if key not in ("tracking", "sweep")}
    return _compute_digest(
        json.dumps([settings, dict(choices)], sort_keys=True, default=str).encode()
    )


def hash_inputs(config: Mapping[str, Any]) -> str:
    """SHA-256 of the installed code, plugins of all packages included, and of the data files the
    job names.
    """
    named = sorted(set(list_texts(config.get("data") or {})))
    return _compute_digest("".join([provenance.hash_code(), *map(_read_file, named)]).encode())


def _compute_digest(content: bytes) -> str:
    """The SHA-256 of a content."""
    return hashlib.sha256(content).hexdigest()


@functools.cache
def _read_file(name: str) -> str:
    """The content of the file `name` and of its companions of the same stem (a sidecar, a .dat); ""
    for no file.
    """
    try:
        path = locate_file(name)
        if not path.is_file():
            return ""
        beside = sorted(path.parent.glob(glob.escape(path.stem) + ".*"))
        return "".join(_compute_digest(files.read(file)) for file in beside if file.is_file())
    except (OSError, ValueError, UserError):  # the job will say what is wrong with it
        return ""
