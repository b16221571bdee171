"""`sweep.json`, by which the jobs of a sweep, and later tasks, find its parent run."""

import json
from pathlib import Path
from typing import Any

FILE = "sweep.json"
PAGES = ("comparison.json", "comparison.html")  # of a sweep, written when its jobs have ended


def parent_of(folder: Path) -> str | None:
    """The run id of the sweep in `folder`; None where it is not logged."""
    return _content(folder).get("run")


def waits(folder: Path) -> bool:
    """Whether the run of the sweep in `folder` is still to be logged: its jobs then wait, too."""
    return "run" in (content := _content(folder)) and content["run"] is None


def _content(folder: Path) -> dict[str, Any]:
    try:
        content = json.loads((folder / FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}
