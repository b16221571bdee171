"""`sweep.json`, by which the jobs of a sweep, and later tasks, find its parent run."""

import json
from pathlib import Path

FILE = "sweep.json"


def parent_of(folder: Path) -> str | None:
    """The run id of the sweep in `folder`; None where it is not logged."""
    try:
        return json.loads((folder / FILE).read_text(encoding="utf-8"))["run"]
    except (OSError, ValueError, KeyError):
        return None
